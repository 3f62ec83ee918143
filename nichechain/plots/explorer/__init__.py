"""A page to explore a chain with: click a niche, see where its descendants go."""

from nichechain.plots.explorer.page import write_explorer
from nichechain.plots.explorer.transitions import LONGEST

__all__ = ["LONGEST", "write_explorer"]
