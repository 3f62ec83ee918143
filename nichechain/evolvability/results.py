"""What an answer is: a number with what it rests on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import NicheChain
from nichechain.core.checks import check_whole
from nichechain.core.notebook import facts_table

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Evolvability:
    """l-evolvability of one root, with what it rests on.

    Parameters
    ----------
    value : float
        Expected number of niches visited: exact where T is given, the mean over posterior draws
        of T (and of D) where they are estimated.
    standard_error : float
        Of ``value``, from the finite number of draws and simulations.
    low, high : float
        5 % and 95 % quantiles over the draws: what births leave open. NaN where T is not drawn: it is
        given, or estimated by ``mle``, which has no posterior.
    l, lineages : int
        Generations, and number U of lineages.
    method, convention, estimator : str
        How it was computed, what was counted, where T came from.
    births : int, optional
        Births behind the root's row of T; None where T is given or the root has no row.
    saturated : bool
        Whether the lineages see nearly all that endlessly many would: fewer tell roots apart
        better.
    offspring : int, optional
        For a genotype: children that were evaluated now and did not fail.
    recorded : int, optional
        For a genotype: children that the archive has recorded of it, among those that gave D.
    """

    value: float
    standard_error: float
    low: float
    high: float
    l: int
    lineages: int
    method: str
    convention: str
    estimator: str
    births: int | None
    saturated: bool
    offspring: int | None = None
    recorded: int | None = None

    def _repr_html_(self) -> str:
        return facts_table(
            f"{self.l}-evolvability: {self.value:.2f} niches",
            {
                "90 % interval": self._interval,
                "standard error": self.standard_error,
                "lineages": f"{self.lineages}, saturated" if self.saturated else self.lineages,
                "births behind the row": "T is given" if self.births is None else self.births,
                "estimator": self.estimator,
                "convention": self.convention,
                "method": self.method,
            },
        )

    def __str__(self) -> str:
        return (
            f"{self.value:.2f} niches ({self._interval}; l = {self.l}, "
            f"{self.lineages} lineages, {self.convention}, {self.estimator}, {self.method})"
        )

    @property
    def _interval(self) -> str:
        return "no interval" if np.isnan(self.low) else f"{self.low:.2f} to {self.high:.2f}"


@dataclass(frozen=True)
class NicheEvolvability:
    """l-evolvability of every niche, as arrays (n_niches,); the fields of :class:`Evolvability`."""

    value: Floats
    standard_error: Floats
    low: Floats
    high: Floats
    births: NDArray[np.int64] | None
    l: int
    lineages: int
    method: str
    convention: str
    estimator: str
    saturated: bool

    def _repr_html_(self) -> str:
        best = int(np.argmax(self.value))
        return facts_table(
            f"{self.l}-evolvability of {self.value.size} niches",
            {
                "mean": float(self.value.mean()),
                "largest": f"{self.value[best]:.2f}, niche number {best}",
                "births behind its row": "T is given" if self.births is None else self.births[best],
                "lineages": f"{self.lineages}, saturated" if self.saturated else self.lineages,
                "estimator": self.estimator,
                "convention": self.convention,
                "method": self.method,
            },
        )

    def to_frame(self, chain: NicheChain) -> pd.DataFrame:
        """One row per niche, with its label."""
        import pandas as pd

        columns = {
            "niche": np.arange(self.value.size),
            "index": [chain.label(niche) for niche in range(self.value.size)],
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "standard_error": self.standard_error,
        }
        if self.births is not None:
            columns["births"] = self.births
        return pd.DataFrame(columns)

    def ranking(self, chain: NicheChain, *, min_births: int = 20) -> pd.DataFrame:
        """Rows of :meth:`to_frame`, the largest value first, without niches of fewer births.

        A niche that births say little about would rank by its prior.
        """
        check_whole(min_births=min_births)
        frame = self.to_frame(chain)
        if self.births is not None:
            frame = frame[frame["births"] >= min_births]
        return frame.sort_values("value", ascending=False, kind="stable").reset_index(drop=True)
