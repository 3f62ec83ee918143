"""Lineages without selection, really mutated and evaluated."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nichechain.archive.archive import Archive
from nichechain.births.table import NONE, niches_of
from nichechain.chain.model import NicheChain
from nichechain.core.checks import as_whole, check_at_least, check_seed, check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.machine import library_versions, machine
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.niches import answer_for_niches
from nichechain.evolvability.question import Question
from nichechain.execution import Executor
from nichechain.niches.plain import to_plain
from nichechain.validation.evaluated import Evaluated
from nichechain.variation.unborn import Unborn, litters

if TYPE_CHECKING:
    import pandas as pd

Float32s = NDArray[np.float32]
Ints = NDArray[np.int64]
OnDone = Callable[[int], None]

OFFSPRING = 30
MIN_BIRTHS = 20

# States of lineages that are kept, of 8 bytes each.
_MOST_STATES = 2**28


@dataclass(frozen=True)
class Lineages:
    """Lineages without selection, really evaluated.

    Parameters
    ----------
    roots : (R,) int64 array
        States of the elites they begin with.
    states : (R, U, l) int64 array
        States of generations 1 to l; ``NONE`` from a failed birth on.
    offspring : (R, m) int64 array
        States of further children of each elite, ``NONE`` where they failed.
    """

    roots: Ints
    states: Ints
    offspring: Ints

    @property
    def failed(self) -> int:
        """Lineages that ended with a birth whose evaluation failed."""
        return int(np.count_nonzero((self.states == NONE).any(axis=2)))

    @property
    def walks(self) -> Ints:
        """Every lineage from its root on, (R·U, l + 1)."""
        roots = np.broadcast_to(self.roots[:, None, None], (*self.states.shape[:2], 1))
        return np.concatenate([roots, self.states], axis=2).reshape(-1, self.states.shape[2] + 1)

    def reached(self, niches: int) -> Ints:
        """Distinct niches among the first ``niches`` states up to each generation, (R, l)."""
        return niches_reached(self.states, niches)

    def to_frame(self) -> pd.DataFrame:
        """One row per birth: root, lineage, generation, state (null where it failed)."""
        import pandas as pd

        index = np.indices(self.states.shape).reshape(3, -1)
        state = pd.array(self.states.ravel(), "Int64")
        state[self.states.ravel() == NONE] = pd.NA
        return pd.DataFrame(
            {"root": self.roots[index[0]], "lineage": index[1], "generation": index[2] + 1, "state": state}
        )


def sample_roots(
    chain: NicheChain,
    filled: Ints,
    size: int,
    *,
    l: int,
    lineages: int,
    min_births: int = MIN_BIRTHS,
    seed: int = 0,
) -> Ints:
    """Niches to check: one drawn from each of ``size`` equal groups by predicted l-evolvability.

    Parameters
    ----------
    chain : NicheChain
        Estimated from births.
    filled : (K,) int64 array
        Niches with an elite.
    size : int
        How many, at least 3; all that qualify where those are fewer.
    l, lineages, seed
        As in :func:`nichechain.niche_evolvability`.
    min_births : int
        Niches with fewer births behind their row of T do not qualify, as they are not ranked.

    Returns
    -------
    (R,) int64 array, sorted

    Raises
    ------
    NichechainError
        If fewer than 3 are asked for or qualify.
    """
    check_whole(elites=size, min_births=min_births)
    if size < 3:
        raise NichechainError(f"elites are {size}, but a rank correlation needs at least 3")
    if chain.births is None:
        raise NichechainError("this chain was given, but roots are chosen by the births behind one")
    filled = as_whole("filled", filled)
    if filled.size and not 0 <= filled.min() <= filled.max() < chain.states:
        raise NichechainError(f"filled has values that are no states, which are 0 to {chain.states - 1}")
    niches = filled[(filled < chain.n_niches) & (chain.births[filled] >= min_births)]
    if niches.size < 3:
        raise NichechainError(
            f"{niches.size} niches have {min_births} births behind their row of T, but at least 3 are needed"
        )
    scores = answer_for_niches(chain, Question(l, lineages, draws=10, seed=seed)).value
    ranked = niches[np.argsort(scores[niches], kind="stable")]
    rng = keyed(seed, Purpose.CHECKED)
    groups = np.array_split(ranked, min(size, ranked.size))
    return np.sort(np.array([rng.choice(group) for group in groups]))


def run_lineages(
    archive: Archive,
    roots: Ints,
    executor: Executor,
    *,
    l: int,
    lineages: int,
    offspring: int = OFFSPRING,
    seed: int = 0,
    keep: Path | None = None,
    on_done: OnDone | None = None,
) -> Lineages:
    """Mutate and evaluate: U lineages of l generations from each elite, and m more children.

    A birth depends on its elite, its lineage's number, its generation and the seed alone: not on
    how many other elites or lineages there are, nor on the executor.

    Parameters
    ----------
    archive : Archive
        Where elites, domain, mutation and niches come from.
    roots : (R,) int64 array
        Niches with an elite.
    executor : Executor
    l, lineages, offspring : int
        At least 1.
    seed : int
    keep : Path, optional
        A file to keep what is evaluated in, should the evaluation be interrupted. What it holds is not
        evaluated again.
    on_done : callable, optional
        Told how many more have been evaluated, or were kept; R·(l·U + m) in all, but for failures.

    Returns
    -------
    Lineages

    Raises
    ------
    NichechainError
        If a number is out of range, a niche is empty, or the file does not fit.
    """
    check_at_least(1, l=l, lineages=lineages, offspring=offspring)
    check_seed(seed)
    # Short numbers of NumPy would overflow.
    l, lineages, offspring = int(l), int(lineages), int(offspring)
    roots = np.atleast_1d(as_whole("roots", roots))
    most = _MOST_STATES // max(1, len(roots) * lineages)
    if l > most:
        raise NichechainError(
            f"l is {l}, but must be at most {most} for {lineages} lineages of each of {len(roots)} elites"
        )
    elites = np.stack([archive.elite(int(root)).genotype for root in roots])
    mutate, niches = archive.mutate, archive.niches
    sizes = {"l": l, "lineages": lineages, "offspring": offspring, "seed": seed}
    evaluated = Evaluated(keep, {**sizes, **_provenance(archive, roots, elites)} if keep else {}, on_done)

    def land(children: Unborn, tell: OnDone | None) -> Ints:
        return niches_of(executor.evaluate(archive.domain, children, tell), niches)

    states = np.full((len(elites), lineages, l), NONE, np.int64)
    # Elite and number of each lineage under way, its latest genotype, and where that stands among them.
    elite, lineage = np.indices(states.shape[:2]).reshape(2, -1)
    genotypes, at = elites, elite
    for generation in range(l):
        if not elite.size:
            break
        whose = zip(elite.tolist(), lineage.tolist(), strict=True)
        number = [_birth(int(roots[r]), u, generation) for r, u in whose]
        seeds = (seed,) * len(genotypes)
        children = Unborn(mutate, Purpose.LINEAGE, genotypes, seeds, at, np.array(number, np.int64))
        landed = evaluated.of(children, land)
        states[elite, lineage, generation] = landed
        alive = landed != NONE
        elite, lineage = elite[alive], lineage[alive]
        if generation + 1 < l:
            genotypes, at = children[alive].grow(), np.arange(len(elite))
    if niches.outside == "absorb":
        states = _absorbed(states, len(niches))
    further = evaluated.of(litters(mutate, Purpose.OFFSPRING, elites, seed, offspring), land)
    return Lineages(np.asarray(roots, np.int64), states, further.reshape(len(elites), offspring))


def _provenance(archive: Archive, roots: Ints, elites: Float32s) -> dict[str, Any]:
    """What decides where lineages go, besides their number, length and seed."""
    return {
        "elites": [np.asarray(roots).tolist(), hashlib.sha256(elites.tobytes()).hexdigest()],
        "configuration": archive.config.to_json(),
        "niches": to_plain(archive.niches),
        "versions": library_versions(),
        "machine": machine(),
    }


def niches_reached(states: Ints, niches: int) -> Ints:
    """Distinct niches up to each generation, (R, l), of lineages (R, U, l)."""
    roots, lineages, generations = states.shape
    seen = np.zeros((roots, niches + 1), bool)
    rows = np.repeat(np.arange(roots), lineages)
    reached = np.empty((roots, generations), np.int64)
    for k in range(generations):
        here = states[:, :, k].ravel()
        # The last column stands for all that does not count.
        seen[rows, np.where((here >= 0) & (here < niches), here, niches)] = True
        reached[:, k] = np.count_nonzero(seen[:, :niches], axis=1)
    return reached


def _absorbed(states: Ints, outside: int) -> Ints:
    """Lineages that stay outside once they are."""
    gone = np.logical_or.accumulate(states == outside, axis=2)
    return np.where(gone, outside, states)


def _birth(root: int, lineage: int, generation: int) -> int:
    """One number for a birth, whatever the numbers of elites, lineages and generations."""
    return (root << 40) | (lineage << 16) | generation
