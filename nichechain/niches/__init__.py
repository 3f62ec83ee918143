"""Niches: a grid or a Voronoi tessellation of the behavior space, and the state outside it."""

from __future__ import annotations

from nichechain.niches.base import OUTSIDE, OUTSIDE_MODES, Niche, Niches, one_hot
from nichechain.niches.centroids import read_centroids
from nichechain.niches.cvt import CVTNiches
from nichechain.niches.grid import GridNiches
from nichechain.niches.parsing import parse_bounds, parse_niche, parse_niches, parse_shape

__all__ = [
    "OUTSIDE",
    "OUTSIDE_MODES",
    "CVTNiches",
    "GridNiches",
    "Niche",
    "Niches",
    "one_hot",
    "parse_bounds",
    "parse_niche",
    "parse_niches",
    "parse_shape",
    "read_centroids",
]
