"""Arms that break, for tests of what becomes of births that fail."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.domains import Evaluation, PlanarArm


class RoughArm(PlanarArm):
    """An arm that breaks where its first joint is bent too far, handed out in small chunks."""

    chunk = 5

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        angles = np.asarray(genotypes)
        fine = super().evaluate(angles)
        broken = self.breaks(angles[:, 0])
        return Evaluation(
            np.where(broken[:, None], np.nan, fine.behavior),
            np.where(broken, np.nan, fine.objective),
            broken,
            tuple("the first joint broke" if bad else "" for bad in broken),
        )

    def breaks(self, angle: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Where the angle (N,) of the first joint is too large."""
        return angle > 0.8


class BrittleArm(RoughArm):
    """One that breaks sooner, and to either side."""

    def breaks(self, angle: NDArray[np.float32]) -> NDArray[np.bool_]:
        return np.abs(angle) > 0.4
