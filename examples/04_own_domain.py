"""A domain of your own in twenty lines: where a kicked ball comes to rest.

A genotype is a kick, its direction and its strength; the behavior is where the ball stops on a table
whose cushions it bounces off. Whatever has these names, ``sample`` and ``evaluate`` is a domain. It takes
about ten seconds and leaves ``own_domain.png`` in the current folder.
"""

import tempfile

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

import nichechain as nc
from nichechain import plots


class Billiard:
    """A ball on a table of 1 by 1 m, kicked from near a corner."""

    name, unit, behavior_names = "billiard", "m", ("x", "y")
    objective_name = "minus the way of the ball (m)"
    bounds = ((0.0, 1.0), (0.0, 1.0))
    genotype_length, chunk = 2, 4096
    start = np.array([0.15, 0.15])

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed

    def sample(self, n: int, *, seed: int | np.random.Generator) -> NDArray[np.float32]:
        """Gentle kicks in any direction, (n, 2)."""
        rng = np.random.default_rng(seed)
        return rng.uniform([-np.pi, 0.0], [np.pi, 0.3], (n, 2)).astype(np.float32)

    def evaluate(self, genotypes: ArrayLike) -> nc.domains.Evaluation:
        """Where the ball rests after each kick (N, 2)."""
        angle, strength = np.asarray(genotypes, np.float64).T
        way = strength**2
        straight = self.start + way[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        # A cushion mirrors the way, so the table is unfolded and folded up again.
        rest = 1.0 - np.abs(1.0 - straight % 2.0)
        failed = ~np.isfinite(rest).all(axis=1)
        return nc.domains.Evaluation(rest, -way, failed, tuple("too strong" if bad else "" for bad in failed))


billiard = Billiard()
config = nc.BuildConfig(
    "billiard",
    shape=(20, 20),
    bounds=billiard.bounds,
    evaluations=10_000,
    mutation="gaussian",
    scale=0.1,
    replacement="objective",  # of the kicks that end in a niche, the gentlest is its elite
)
with tempfile.TemporaryDirectory() as folder, nc.Threads() as threads:
    nc.build(config, folder, threads, domain=billiard)
    archive = nc.load(folder, domain=billiard)
    chain = archive.chain()
    print(archive)
    print(chain)

    # Kicks that end near the ball are gentle, and so is every change of them; strong ones end anywhere.
    scores = nc.niche_evolvability(chain, l=3, lineages=30)
    near, far = archive.niches.of([[0.15, 0.15], [0.6, 0.6]])
    for niche in (near, far):
        print(f"niche {chain.label(niche)}: {scores.value[niche]:.1f} niches in 3 generations")

    figure = Figure(figsize=(14, 6.5))
    left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.4})
    plots.plot_visits(archive, left)
    plots.plot_evolvability(archive, scores, right)
    figure.savefig("own_domain.png", dpi=130, bbox_inches="tight")
print("wrote own_domain.png")
