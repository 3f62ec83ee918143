"""How often 90 % intervals of niche l-evolvability hold what they are intervals of.

Births are simulated from a known T by a MAP-Elites of its own, which shares no code with the package;
T is estimated from them, and the interval of every niche is compared with the exact value under the
true T. Each elite has a row of its own, Dirichlet((1 - rho) / rho T_i), so that its children are alike.

    python benchmarks/interval_coverage.py [--replicates 12] [--draws 50] [--truths prior posterior sparse]

Truths, all fitted to the shipped archive: ``prior``, rows drawn around the base measure; ``posterior``,
one draw of the posterior; ``sparse``, row-normalised counts, rows without births where children land in
general. Niches of one data set share its errors, so that the standard error is over data sets.
"""

from __future__ import annotations

import argparse
import time

import numba
import numpy as np

import nichechain as nc
from nichechain.evolvability.coverage import expected_coverage

QUESTIONS = ((1, 30), (5, 100))
CORRELATIONS = (0.0, 0.03, 0.1)
TRUTHS = ("prior", "posterior", "sparse")
BIRTHS, BATCH, INITIAL = 40_000, 200, 100
FEW = 20


def main() -> None:
    """Print a row for every truth and correlation."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--replicates", type=int, default=12)
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--truths", nargs="+", default=TRUTHS, choices=TRUTHS)
    parser.add_argument("--correlations", nargs="+", type=float, default=CORRELATIONS)
    options = parser.parse_args()
    counts = nc.load("fetch-pick-and-place").counts
    print("truth      rho   l  U    covered (se)    with 20 births   bias    truth   fit, s")
    for truth in options.truths:
        for rho in options.correlations:
            rows, seconds = [], []
            for replicate in range(options.replicates):
                rng = np.random.default_rng([TRUTHS.index(truth), round(rho * 1000), replicate])
                T = true_matrix(truth, counts, rng)
                parent, child, elite = simulate(T, rho, rng)
                births = nc.TransitionCounts.from_births(parent, child, counts.niches, elite=elite)
                began = time.perf_counter()
                chain = nc.estimate(births)
                seconds.append(time.perf_counter() - began)
                rows.append([judge(chain, T, *question, options.draws, replicate) for question in QUESTIONS])
            table = np.array(rows)
            for (l, lineages), column in zip(QUESTIONS, table.transpose(1, 0, 2), strict=True):
                mean = column.mean(axis=0)
                error = column[:, 0].std(ddof=1) / np.sqrt(len(column)) if len(column) > 1 else np.nan
                print(
                    f"{truth:10} {rho:<5g} {l}  {lineages:<4} {mean[0]:.3f} ({error:.3f})   {mean[1]:.3f}"
                    f"            {mean[2]:+6.2f}  {mean[3]:6.2f}  {np.median(seconds):.2f}",
                    flush=True,
                )


def judge(chain: nc.NicheChain, T: np.ndarray, l: int, lineages: int, draws: int, seed: int) -> list[float]:
    """Share of niches covered, and of those with births of their own, bias and true mean."""
    n = chain.n_niches
    true = expected_coverage(T, T[:n], l, lineages, counted=n)
    found = nc.niche_evolvability(chain, l=l, lineages=lineages, draws=draws, seed=seed)
    held = (found.low <= true) & (true <= found.high)
    known = chain.births[:n] >= FEW
    return [held.mean(), held[known].mean(), (found.value - true).mean(), true.mean()]


def true_matrix(truth: str, counts: nc.TransitionCounts, rng: np.random.Generator) -> np.ndarray:
    """A transition matrix that resembles the archive's, (S, S)."""
    if truth == "sparse":
        T = nc.estimate(counts, "mle", unvisited="base").T
        return T if isinstance(T, np.ndarray) else T.toarray()
    posterior = nc.estimate(counts).posterior
    if truth == "posterior":
        T = posterior.draw(rng)
        return T if isinstance(T, np.ndarray) else T.toarray()
    drawn = rng.standard_gamma(posterior.strength * posterior.base.rows(np.arange(counts.niches.states)))
    return drawn / drawn.sum(axis=1, keepdims=True)


def simulate(
    T: np.ndarray, rho: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State of the parent, state of the child and number of the parent, -1 for initial births."""
    upto = np.cumsum(T, axis=1)
    concentration = np.inf if rho == 0 else (1.0 - rho) / rho
    start = int(np.argmax(T.sum(axis=0)[:-1]))
    return _simulate(upto / upto[:, -1:], concentration, start, BIRTHS, BATCH, INITIAL, rng)


@numba.njit
def _simulate(upto, concentration, start, births, batch, initial, rng):
    """MAP-Elites with random replacement; an elite's own row by Polya's urn."""
    states = upto.shape[0]
    elite, parent, child = np.full(births, -1), np.full(births, -1), np.full(births, -1)
    standing, key = np.full(states, -1), np.full(states, -1.0)
    latest, sibling, family = np.full(births, -1), np.full(births, -1), np.zeros(births, np.int64)
    occupied = np.empty(states, np.int64)
    done = 0
    while done < births:
        size = min(batch if done else initial, births - done)
        number = 0
        for state in range(states):
            if standing[state] >= 0:
                occupied[number] = state
                number += 1
        for birth in range(done, done + size):
            if not done:
                child[birth] = start
                continue
            row = occupied[int(rng.random() * number)]
            mother = standing[row]
            parent[birth], elite[birth] = row, mother
            before = family[mother]
            if rng.random() * (concentration + before) < before:
                model = latest[mother]
                for _ in range(int(rng.random() * before)):
                    model = sibling[model]
                child[birth] = child[model]
            else:
                child[birth] = min(np.searchsorted(upto[row], rng.random(), side="right"), states - 1)
            sibling[birth], latest[mother], family[mother] = latest[mother], birth, before + 1
        for birth in range(done, done + size):
            drawn = rng.random()
            if drawn > key[child[birth]]:
                key[child[birth]], standing[child[birth]] = drawn, birth
        done += size
    return parent, child, elite


if __name__ == "__main__":
    main()
