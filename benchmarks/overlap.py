"""How far lineages of one elite overlap: predicted over reached niches, by how many and how long they are.

    python benchmarks/overlap.py [--folder build/truth] [--only NAME ...] [--held-out]

The data sets are those of ``truth.py make``, with 40,000 births of which one in twenty is of lineages. Beside
the law of lineages that such births gave, laws are tried that are fitted to the truth itself: a τ, and with
it a taste κ, which gives each elite weights of niches, Gamma(κ) / κ, the same for all generations of its
lineages. They show what the form of the law could reach at best. ``rms`` is the root mean square of the
logarithm of predicted over reached, over 2 generations and more.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import numpy as np
from truth_data import DATASETS, load

from nichechain import TransitionCounts, estimate
from nichechain.chain.lineages import scattered_rows
from nichechain.chain.model import NicheChain
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.rarefaction import distinct_among
from nichechain.evolvability.coverage import expected_coverage
from nichechain.evolvability.question import Question, dense

BIRTHS, SHARE = 40_000, 0.05
GENERATIONS = (1, 2, 5, 10)
LINEAGES = (2, 5, 10, 20, 50, 100)
CONCENTRATIONS = (40.0, 15.0, 6.0, 3.0)
TASTES = (4.0, 1.6, 0.8, 0.4)
_DRAWS = 8


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=Path("build/truth"))
    parser.add_argument("--only", nargs="+", choices=tuple(DATASETS))
    parser.add_argument("--held-out", action="store_true")
    given = parser.parse_args()
    for name in given.only or [name for name, data in DATASETS.items() if data.development or given.held_out]:
        truth = load(name, given.folder)
        if truth is None:
            print(f"{name}: not made yet")
            continue
        counts = TransitionCounts.from_births(truth.given(BIRTHS, SHARE), truth.niches)
        chain = estimate(counts)
        known = counts.visits[truth.lineages.roots] > 0
        roots, states = truth.lineages.roots[known], truth.lineages.states[known]
        sizes = [size for size in LINEAGES if size <= states.shape[1]]
        reached = np.array([mean_reached(states[:, :, :l], len(truth.niches), sizes) for l in GENERATIONS])
        found = predicted(chain, roots, sizes)
        show(
            f"{name}, the law of its births: τ {chain.posterior.law.concentration:.1f}",
            found / reached,
            sizes,
        )
        alone = [(tau, None) for tau in CONCENTRATIONS]
        for kind, laws in (("τ", alone), ("τ and κ", itertools.product(CONCENTRATIONS, TASTES))):
            tried = {law: predicted(chain, roots, sizes, *law) / reached for law in laws}
            best = min(tried, key=lambda law: error(tried[law]))
            show(
                f"{name}, the best {kind}: {best[0]:g}{'' if best[1] is None else f', {best[1]:g}'}",
                tried[best],
                sizes,
            )


def mean_reached(states: np.ndarray, niches: int, sizes: list[int]) -> list[float]:
    """Niches that so many of the lineages of an elite reach, the mean over elites (R, U, l)."""
    elites, lineages, _ = states.shape
    total = np.zeros(len(sizes))
    for own in states:
        visited = np.zeros((lineages, niches), bool)
        lineage, generation = np.nonzero((own >= 0) & (own < niches))
        visited[lineage, own[lineage, generation]] = True
        total += [distinct_among(visited.sum(axis=0), lineages, size) for size in sizes]
    return (total / elites).tolist()


def predicted(
    chain: NicheChain,
    roots: np.ndarray,
    sizes: list[int],
    tau: float | None = None,
    taste: float | None = None,
) -> np.ndarray:
    """What the chain says of them, (generations, sizes), under the law of its births or another."""
    question = Question(max(GENERATIONS), max(sizes), draws=_DRAWS)
    found = np.zeros((len(GENERATIONS), len(sizes)))
    for number in range(_DRAWS):
        drawn = question.sample(chain, number)
        onward, first = drawn.onward, drawn.children(roots)
        if tau is not None:
            rng = keyed(0, Purpose.LINEAGE_LAW, number)
            onward = dense(drawn.rows).copy()
            onward[np.diag_indices_from(onward)] *= np.exp(chain.posterior.law.stay)
            onward = scattered_rows(onward / onward.sum(axis=1, keepdims=True), tau, rng)
            if taste is not None:
                onward = onward * (rng.standard_gamma(taste, onward.shape[1]) + 1e-9)
                onward /= onward.sum(axis=1, keepdims=True)
        for row, generations in zip(found, GENERATIONS, strict=True):
            row += expected_coverage(onward, first, generations, sizes, counted=chain.n_niches).mean(axis=0)
    return found / _DRAWS


def error(level: np.ndarray) -> float:
    """How far levels are from 1."""
    return float(np.sqrt((np.log(level[1:]) ** 2).mean()))


def show(title: str, level: np.ndarray, sizes: list[int]) -> None:
    """One table."""
    print(f"{title}: rms {error(level):.3f}")
    print("  generations  " + "".join(f"{f'U = {size}':>9}" for size in sizes))
    for generations, row in zip(GENERATIONS, level, strict=True):
        print(f"  {generations:11d}  " + "".join(f"{value:9.2f}" for value in row), flush=True)


if __name__ == "__main__":
    main()
