"""Pictures of the shipped archive: its births, its chain, what these say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

import nichechain as nc
from nichechain import plots
from nichechain.chain.structure.wormholes import wormholes
from nichechain.plots.style import EDGE, EMPTY, LONG_JUMP, behavior_axes

ROOT = (14, 14)

ARCHIVE = nc.load("fetch-pick-and-place")
CHAIN = ARCHIVE.chain()


def visits(figure: Figure) -> None:
    """Births in every niche."""
    figure.set_size_inches(5.2, 6)
    plots.plot_visits(ARCHIVE, figure.subplots())


def evolvability(figure: Figure) -> None:
    """l-evolvability of every niche."""
    figure.set_size_inches(5.2, 6)
    plots.plot_evolvability(ARCHIVE, nc.niche_evolvability(CHAIN, l=5, lineages=100), figure.subplots())


def reachability(figure: Figure) -> None:
    """Which niches lead to which."""
    figure.set_size_inches(5.2, 6)
    plots.plot_reachability(ARCHIVE, CHAIN, figure.subplots(), threshold=0.03)


def births(figure: Figure) -> None:
    """Where children of one niche were born."""
    figure.set_size_inches(5.2, 6)
    ax = figure.subplots()
    behavior_axes(ax, ARCHIVE)
    cells(ax)
    state = ARCHIVE.niches.flat(ROOT)
    rows = ARCHIVE.births()
    rows = rows[rows["parent_niche"] == state]
    inside = rows[rows["child_niche"] < len(ARCHIVE.niches)]
    ends = inside[["behavior_x", "behavior_y"]].to_numpy(float)
    center = _center(state)
    for end in ends:
        ax.plot(*np.stack([center, end]).T, color=EDGE, linewidth=0.5, alpha=0.35)
    ax.plot(*ends.T, "o", color=EDGE, markersize=3.5, alpha=0.8, markeredgewidth=0)
    ax.plot(*center, "s", color=LONG_JUMP, markersize=9)
    gone = len(rows) - len(inside)
    ax.set_title(f"{len(rows)} births of parents in niche 14,14; {gone} outside")


def rows_of_t(figure: Figure) -> None:
    """One row of T, as three estimators see it."""
    figure.set_size_inches(13, 6)
    births_behind = ARCHIVE.counts.births[: len(ARCHIVE.niches)]
    # A niche that few births speak for, but more than one.
    state = int(np.flatnonzero(births_behind == 12)[0])
    named = {
        "row-normalised counts": ARCHIVE.chain("mle"),
        "Dirichlet, uniform base": ARCHIVE.chain("dirichlet"),
        "empirical Bayes": CHAIN,
    }
    axes = figure.subplots(1, 3, gridspec_kw={"wspace": 0.3})
    mesh = None
    for ax, (name, chain) in zip(axes, named.items(), strict=True):
        behavior_axes(ax, ARCHIVE)
        if ax is not axes[0]:
            ax.set_ylabel("")
        row = chain.T[[state]]
        row = np.asarray(row.toarray() if hasattr(row, "toarray") else row).ravel()[: len(ARCHIVE.niches)]
        x, y = _edges()
        mesh = ax.pcolormesh(
            x,
            y,
            ARCHIVE.niches.as_grid(row).T,
            cmap="Blues",
            norm=PowerNorm(0.3, 0.0, 0.5),
            edgecolors="white",
        )
        mesh.set_linewidth(0.2)
        ax.plot(*_center(state), "s", color=LONG_JUMP, markersize=6)
        possible = int((row > 0).sum())
        ax.set_title(f"{name}\n{possible} of 400 niches possible", fontsize="medium")
    assert mesh is not None
    figure.colorbar(mesh, ax=axes, label="probability of a child's niche", shrink=0.8)
    figure.suptitle(f"The row of niche {CHAIN.label(state)}: 12 births", y=0.95)


def transitions(figure: Figure) -> None:
    """The matrix as a picture."""
    figure.set_size_inches(7, 6.5)
    plots.plot_transitions(ARCHIVE, CHAIN, figure.subplots())


def growth(figure: Figure) -> None:
    """l-evolvability against l and against U."""
    figure.set_size_inches(9.5, 4.2)
    ranking = nc.niche_evolvability(CHAIN, l=5, lineages=100).ranking(CHAIN)["niche"]
    niches = [int(ranking.iloc[place]) for place in (0, len(ranking) // 2, -1)]
    left, right = figure.subplots(1, 2)
    plots.plot_generations(CHAIN, left, niches=niches)
    plots.plot_lineages(CHAIN, right, niches=niches)


def wormhole_map(figure: Figure) -> None:
    """Transitions that displacement and destination do not explain."""
    figure.set_size_inches(5.2, 6)
    plots.plot_wormholes(ARCHIVE, wormholes(CHAIN, beyond="both"), figure.subplots())


def _center(state: int) -> NDArray[np.float64]:
    column, row = ARCHIVE.niches.index(state)
    x, y = _edges()
    return np.array([x[column : column + 2].mean(), y[row : row + 2].mean()])


def _edges() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Borders of the cells along the two axes."""
    x, y = (
        np.linspace(*bound, cells + 1)
        for bound, cells in zip(ARCHIVE.niches.bounds, ARCHIVE.niches.shape, strict=True)
    )
    return x, y


def cells(ax: Axes) -> None:
    """Draw the borders of the cells."""
    x, y = _edges()
    ax.vlines(x, y[0], y[-1], color=EMPTY, linewidth=0.6, zorder=0)
    ax.hlines(y, x[0], x[-1], color=EMPTY, linewidth=0.6, zorder=0)


PICTURES: dict[str, Callable[[Figure], None]] = {
    "visits": visits,
    "evolvability": evolvability,
    "reachability": reachability,
    "births": births,
    "rows": rows_of_t,
    "transitions": transitions,
    "growth": growth,
    "wormholes": wormhole_map,
}
