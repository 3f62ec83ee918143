"""Searches compared: what a selection of parents is worth, at equal evaluations and paired by seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.core.lazy import lazily

if TYPE_CHECKING:
    from nichechain.studies.searches.comparing import compare_selections
    from nichechain.studies.searches.folder import read_searches
    from nichechain.studies.searches.running import run_searches
    from nichechain.studies.searches.study import SelectionStudy

__getattr__, __dir__ = lazily(
    __name__,
    comparing="compare_selections",
    folder="read_searches",
    running="run_searches",
    study="SelectionStudy",
)

__all__ = ["SelectionStudy", "compare_selections", "read_searches", "run_searches"]
