"""Small walks on an arm, and how their births are read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nichechain import variation
from nichechain.domains import PlanarArm
from nichechain.niches import GridNiches
from nichechain.walks import Selective, WalkConfig, walk

from ..arms import BrittleArm


class LatticeArm(BrittleArm):
    """One whose hand snaps to a coarse lattice, so that offspring tie."""

    def evaluate(self, genotypes):
        fine = super().evaluate(genotypes)
        return replace(fine, behavior=np.round(fine.behavior * 4) / 4)


ARM = PlanarArm()
LATTICE = LatticeArm()
MUTATE = variation.gaussian(0.2)
NICHES = GridNiches((5, 5), ARM.bounds)


def walked(selection=None, *, domain=LATTICE, runs=3, steps=4, niches=NICHES, **values):
    config = WalkConfig(selection=selection or Selective(), **{"offspring": 8, "seed": 1, **values})
    return walk(domain, MUTATE, config, runs=runs, steps=steps, niches=niches)


def by_birth(result):
    """(run, uid) → row of the births."""
    return {(row["run"], row["uid"]): row for row in result.births.to_pylist()}


def behavior_of(row):
    return np.array([row["behavior_0"], row["behavior_1"]], float)
