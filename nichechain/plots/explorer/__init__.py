"""A page to explore a chain with: click a niche, see where its descendants go."""

from nichechain.plots.explorer.page import check_drawable, draws_of, write_explorer
from nichechain.plots.explorer.transitions import LONGEST

__all__ = ["LONGEST", "check_drawable", "draws_of", "write_explorer"]
