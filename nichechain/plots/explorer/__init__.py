"""A page to explore a chain with: click a niche, see where its descendants go."""

from nichechain.plots.explorer.page import draws_of, write_explorer
from nichechain.plots.explorer.transitions import LONGEST

__all__ = ["LONGEST", "draws_of", "write_explorer"]
