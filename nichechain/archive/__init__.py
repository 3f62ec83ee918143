"""An archive is a folder: elites, births, and what made them."""
