"""Walks on a behavior landscape: one genotype after another, each an offspring of the one before.

How the next is chosen decides the evolutionary pressure: highly selective, adaptive, random.
"""

from __future__ import annotations

from nichechain.walks.advance import Step, Walks
from nichechain.walks.config import WalkConfig, run_seed
from nichechain.walks.selection import (
    AtLeast,
    BetterThanParent,
    Selection,
    Selective,
    TopFraction,
    Uniform,
)
from nichechain.walks.state import StepRecord, WalkState, record_table
from nichechain.walks.walking import WalkResult, draw_starts, walk

__all__ = [
    "AtLeast",
    "BetterThanParent",
    "Selection",
    "Selective",
    "Step",
    "StepRecord",
    "TopFraction",
    "Uniform",
    "WalkConfig",
    "WalkResult",
    "WalkState",
    "Walks",
    "draw_starts",
    "record_table",
    "run_seed",
    "walk",
]
