"""The behavior landscape of an archive: the local measures of its elites, and of them all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import as_floats, check_at_least, check_seed, check_share
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.ranks import rank_correlation
from nichechain.landscape.behaviors import (
    expected_global_sensitivity,
    expected_local_sensitivity,
    global_sensitivity,
)
from nichechain.landscape.dissimila import QUANTILES, Dissimila, find_dissimila
from nichechain.landscape.measures import MEASURES, LocalMeasures, check_sample_size, measure_behaviors
from nichechain.landscape.sampling import Kept, operator_digest, sample_families
from nichechain.niches import Niches
from nichechain.variation import AdditiveMutation, Mutation, SelfAdaptiveMutation
from nichechain.variation.noise import BallNoise

if TYPE_CHECKING:
    import pandas as pd

    from nichechain.archive.archive import Archive
    from nichechain.execution import Executor

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_FORMAT = 1

OFFSPRING = 30
"""Offspring of an elite, as in the paper's walks."""


@dataclass(frozen=True)
class Correlation:
    """Spearman's rank correlation.

    Parameters
    ----------
    measure : str
    rho, p_value : float
        NaN where one side is constant. The test is two-sided.
    n : int
        Pairs.
    """

    measure: str
    rho: float
    p_value: float
    n: int


@dataclass(frozen=True, eq=False, repr=False)
class Landscape:
    """Local measures of the elites of an archive ("Definitions and metrics").

    Parameters
    ----------
    niches : Niches
    behavior_names : tuple of str
    unit : str
        Unit of behavior.
    seed : int
        Of the noise, which the i-th children of all elites share.
    bounded : bool
        Whether N(θ) is bounded. Where it is not, or not known to be, LS, GS and η are lower bounds
        that grow with the sample.
    share : float
        Quantile of r* up to which an elite is a dissimilum.
    state, uid, depth : (G,) int64 arrays
        Which elites, in the order of their niches; the outside elite comes last.
    parent : (G, B) array
        Behaviors of the elites.
    offspring : (G, n, B) array
        Behaviors of their offspring, NaN where an evaluation failed.
    """

    niches: Niches
    behavior_names: tuple[str, ...]
    unit: str
    seed: int
    bounded: bool
    share: float
    state: Ints
    uid: Ints
    depth: Ints
    parent: Floats
    offspring: Floats

    def __post_init__(self) -> None:
        for name in ("state", "uid", "depth", "parent", "offspring"):
            # What was measured is kept once it is computed, so nobody may change the arrays.
            view = getattr(self, name).view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)

    def __len__(self) -> int:
        return len(self.state)

    def __repr__(self) -> str:
        return f"Landscape({len(self)} elites, {self.sample_size} offspring of each, seed {self.seed})"

    @property
    def sample_size(self) -> int:
        """Offspring of each elite."""
        return int(self.offspring.shape[1])

    @cached_property
    def measures(self) -> LocalMeasures:
        """The local measures, a column each."""
        return measure_behaviors(self.parent, self.offspring, self.niches)

    @cached_property
    def dissimila(self) -> Dissimila:
        """Which elites are dissimila, and quantiles of r*."""
        measures = self.measures
        return find_dissimila(measures.expected_ratio, measures.expected_local_sensitivity, share=self.share)

    @property
    def global_sensitivity(self) -> float:
        """Largest local sensitivity of the elites, GS."""
        return global_sensitivity(self.parent, self.offspring)

    @property
    def expected_global_sensitivity(self) -> float:
        """Mean expected local sensitivity of the elites, GS*."""
        return expected_global_sensitivity(self.parent, self.offspring)

    @cached_property
    def expected_global_sensitivity_error(self) -> float:
        """Standard error of GS* for these elites, over which noise their offspring were made with.

        Elites share their noise, so what is left out is the i-th child of all of them at once
        (delete-one jackknife).
        """
        size = self.sample_size
        without = np.array(
            [
                np.nanmean(expected_local_sensitivity(self.parent, np.delete(self.offspring, i, axis=1)))
                for i in range(size)
            ]
        )
        return float(np.sqrt((size - 1) * without.var()))

    def frame(self) -> pd.DataFrame:
        """One row per elite: where and who it is, its measures, and whether it is a dissimilum."""
        import pandas as pd

        measures = self.measures
        columns: dict[str, Any] = {
            "niche": self.state,
            "index": [self.niches.label(int(state)) for state in self.state],
            "uid": self.uid,
            "depth": self.depth,
        }
        columns |= {f"behavior_{name}": self.parent[:, axis] for axis, name in enumerate(self.behavior_names)}
        columns |= {"sample_size": measures.sample_size, "failed": measures.failed}
        columns |= {name: measures[name] for name in MEASURES}
        columns |= {"neutral": self.dissimila.neutral, "dissimilum": self.dissimila.dissimila}
        return pd.DataFrame(columns)

    def summary(self) -> dict[str, Any]:
        """Measures of the set of elites, as plain values: null where there is nothing to measure."""
        found = self.dissimila
        quantiles = {
            f"{level:.0%}": _finite(value)
            for level, value in zip(QUANTILES, found.quantiles.tolist(), strict=True)
        }
        return {
            "measured_elites": len(self),
            "sample_size": self.sample_size,
            "seed": self.seed,
            "bounded": self.bounded,
            "failed": int(self.measures.failed.sum()),
            "unit": self.unit,
            "global_sensitivity": _finite(self.global_sensitivity),
            "expected_global_sensitivity": _finite(self.expected_global_sensitivity),
            "expected_global_sensitivity_error": _finite(self.expected_global_sensitivity_error),
            "expected_ratio_quantiles": quantiles,
            "neutral": int(found.neutral.sum()),
            "dissimila": {
                "share": self.share,
                "threshold": _finite(found.threshold),
                "count": int(found.dissimila.sum()),
            },
        }

    def correlations(self, values: Floats) -> tuple[Correlation, ...]:
        """Rank correlation of every measure with something else known of niches.

        Parameters
        ----------
        values : (n_niches,) array
            Such as their l-evolvability; NaN leaves a niche out.

        Returns
        -------
        tuple of Correlation
            Over the elites within niches whose measure is known. Neutral ones have no r and r*.

        Raises
        ------
        NichechainError
            If there is not one value per niche.
        """
        other = as_floats("values", values)
        if other.shape != (len(self.niches),):
            raise NichechainError(
                f"values have shape {other.shape}, but there must be one for each of "
                f"{len(self.niches)} niches"
            )
        inside = self.state < len(self.niches)
        beside = np.full(len(self), np.nan)
        beside[inside] = other[self.state[inside]]
        found = []
        for name in MEASURES:
            column = self.measures[name]
            known = ~np.isnan(column) & ~np.isnan(beside)
            if name in ("ratio", "expected_ratio"):
                known &= ~self.dissimila.neutral
            rho = p_value = np.nan
            pair = column[known], beside[known]
            if known.sum() > 2 and all(np.ptp(side) > 0 for side in pair):
                rho, p_value = rank_correlation(*pair)
            found.append(Correlation(name, rho, p_value, int(known.sum())))
        return tuple(found)


def measure_archive(
    archive: Archive,
    offspring: int = OFFSPRING,
    seed: int = 0,
    executor: Executor | None = None,
    *,
    mutate: Mutation | None = None,
    elites: int | None = None,
    share: float = 0.1,
    keep: Path | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Landscape:
    """Measure the elites of an archive, each by a sample of its offspring.

    Parameters
    ----------
    archive : Archive
    offspring : int
        Sample size, at least 2. Measures of different sizes do not compare.
    seed : int
        An elite's measures are a function of its genotype, the operator, the sample size and this
        seed, and those of :func:`measure`: neither other elites nor workers change them.
    executor : Executor, optional
        Where to evaluate; by default here.
    mutate : Mutation, optional
        By default the operator that the archive was built with.
    elites : int, optional
        So many of them, drawn at random; a larger sample holds a smaller one. All by default.
    share : float
        Quantile of r* up to which an elite is a dissimilum.
    keep : Path, optional
        A file to keep what is evaluated in, should the evaluation be interrupted. What it holds is
        not evaluated again.
    on_done : callable, optional
        Told how many more evaluations are done, of 1 + ``offspring`` for each elite.

    Returns
    -------
    Landscape

    Raises
    ------
    NichechainError
        If a number is out of range, the archive has no elites, one of them fails to evaluate, or
        the file does not fit.
    """
    check_sample_size(offspring, "offspring")
    check_seed(seed)
    check_share(share=share)
    if elites is not None:
        check_at_least(1, elites=elites)
    operator = archive.mutate if mutate is None else mutate
    if not len(archive.elites):
        raise NichechainError(f"{archive.folder} has no elites to measure")
    order = keyed(seed, Purpose.CHECKED).permutation(len(archive.elites))
    chosen = archive.elites[np.sort(order[:elites])]
    kept = Kept.read(keep, {} if keep is None else _provenance(archive, operator, offspring, seed))
    families = sample_families(
        archive.domain, chosen.genotype, operator, offspring, seed, kept, executor, on_done
    )
    for row in np.flatnonzero(np.isnan(families[:, 0]).any(axis=1)):
        where = archive.niches.label(int(chosen.niche[row]))
        raise NichechainError(f"the elite of niche {where} failed to evaluate, though it did not when born")
    facts = archive.meta.facts
    return Landscape(
        niches=archive.niches,
        behavior_names=facts.behavior_names,
        unit=facts.unit,
        seed=seed,
        bounded=is_bounded(operator),
        share=share,
        state=chosen.niche,
        uid=chosen.uid,
        depth=chosen.depth,
        parent=families[:, 0],
        offspring=families[:, 1:],
    )


def is_bounded(mutate: Mutation) -> bool:
    """Whether N(θ) is known to be bounded."""
    if not isinstance(mutate, AdditiveMutation | SelfAdaptiveMutation):
        return False
    # A step size that is a gene has no largest value.
    ball = isinstance(mutate, AdditiveMutation) and isinstance(mutate.noise, BallNoise)
    return ball or mutate.bound is not None


def _provenance(archive: Archive, mutate: Mutation, offspring: int, seed: int) -> dict[str, Any]:
    """What shapes the behaviors of a family besides its parent."""
    from nichechain.core.machine import library_versions, machine

    config = archive.config
    return {
        "format": _FORMAT,
        "domain": [config.domain, config.domain_seed, dict(config.domain_options)],
        "sample size": offspring,
        "seed": seed,
        "mutation": operator_digest(mutate, archive.domain.genotype_length, seed),
        "versions": library_versions(),
        "machine": machine(),
    }


def _finite(value: float) -> float | None:
    """None for what JSON has no number for."""
    return value if np.isfinite(value) else None
