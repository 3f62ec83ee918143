"""How far the final places of two sets of episodes are apart, in metres and in niches."""

from pathlib import Path

import numpy as np
from fetch_model import KINDS

with np.load(Path(__file__).parent / "reference.npz") as file:
    REFERENCE = dict(file)


def niches(places):
    """Niche of the 20 by 20 grid; 400 is outside, 401 is no number."""
    low, high = REFERENCE["bounds"].T
    finite = np.isfinite(places).all(1)
    cells = np.floor((np.where(finite[:, None], places, 0)[:, :2] - low) / (high - low) * 20).astype(int)
    inside = ((cells >= 0) & (cells < 20)).all(1)
    return np.where(finite, np.where(inside, cells[:, 0] * 20 + cells[:, 1], 400), 401)


def histogram(cells):
    """Share of episodes in each niche, outside and failed."""
    return np.bincount(cells, minlength=402) / len(cells)


def chance(one, other, draws=200):
    """Total variation of two histograms of one law: half the episodes of each, exchanged at random."""
    rng = np.random.default_rng(0)
    swap = rng.random((draws, len(one))) < 0.5
    return np.array(
        [
            0.5 * np.abs(histogram(np.where(s, one, other)) - histogram(np.where(s, other, one))).sum()
            for s in swap
        ]
    )


def quantiles(values):
    """How far blocks end apart."""
    return {
        str(q): float(np.quantile(values, q)) for q in (0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 1) if len(values)
    }


def compare(places, other):
    """Distances of paired final places, and what they do to niches."""
    distance = np.linalg.norm(places - other, axis=1)
    # What falls off the table is far apart in height within a moment; behavior is x and y.
    flat = np.linalg.norm((places - other)[:, :2], axis=1)
    finite = np.isfinite(distance)
    moved = finite & (np.linalg.norm(other - REFERENCE["start_place"], axis=1) > 0.01)
    one, two = niches(places), niches(other)
    swapped = chance(one, two)
    edges = 10.0 ** np.arange(-9, 1)
    return {
        "episodes": len(places),
        "not finite": int((~finite).sum()),
        "moved over 1 cm": int(moved.sum()),
        "distance m, quantiles": quantiles(distance[finite]),
        "of those moved": quantiles(distance[moved]),
        "distance in x and y m, quantiles": quantiles(flat[finite]),
        "in x and y, of those moved": quantiles(flat[moved]),
        "distance under 1e-9..1 m": [int((distance < e).sum()) for e in edges],
        "same niche": float((one == two).mean()),
        "same niche, of those moved": float((one == two)[moved].mean()) if moved.any() else None,
        "niches": [len(np.unique(one)), len(np.unique(two))],
        "total variation of niches": float(0.5 * np.abs(histogram(one) - histogram(two)).sum()),
        "total variation if pairs are swapped at random, mean and 95 %": [
            float(swapped.mean()),
            float(np.quantile(swapped, 0.95)),
        ],
        "outside": [int((one == 400).sum()), int((two == 400).sum())],
    }


def compare_all(places):
    """With the CPU's final places of the true model and of the model in each form."""
    n = len(places)
    found = {"cpu": compare(places, REFERENCE["final"][:n])}
    for name in KINDS:
        if f"cpu {name}" in REFERENCE:
            found[f"cpu {name}"] = compare(places, REFERENCE[f"cpu {name}"][:n])
    return found


def yardsticks():
    """The CPU against itself: disturbed a little, rounded to float32, or with the changed model."""
    final = REFERENCE["final"]
    found = {
        name: compare(REFERENCE[name], final)
        for name in ("cpu 1e-7", "cpu float32", *(f"cpu {kind}" for kind in KINDS))
        if name in REFERENCE
    }
    rng = np.random.default_rng(1)
    order = rng.permutation(len(final))
    halves = niches(final[order[: len(final) // 2]]), niches(final[order[len(final) // 2 :]])
    found["total variation of two halves of the CPU's"] = float(
        0.5 * np.abs(histogram(halves[0]) - histogram(halves[1])).sum()
    )
    return found
