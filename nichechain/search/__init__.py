"""The search: a MAP-Elites loop that remembers who was born where, and from which niche."""
