"""Pictures of what walks measure and select for, around an elite of the shipped archive."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from of_archive import ARCHIVE, cells

from nichechain.plots.style import EDGE, INK, LONG_JUMP, START, behavior_axes
from nichechain.walks import diversity


def local_measures(figure: Figure) -> None:
    """LS and η of one elite, from its recorded children."""
    figure.set_size_inches(5.2, 6)
    ax = figure.subplots()
    parent, children = _family()
    behavior_axes(ax, ARCHIVE)
    cells(ax)
    farthest = children[np.linalg.norm(children - parent, axis=1).argmax()]
    apart = np.linalg.norm(children[:, None] - children[None], axis=2)
    first, second = np.unravel_index(apart.argmax(), apart.shape)
    sensitivity, evolvability = np.linalg.norm(farthest - parent), apart.max()
    ax.plot(*children.T, "o", color=EDGE, markersize=4, alpha=0.8, markeredgewidth=0, label="offspring")
    ax.plot(*parent, "s", color=INK, markersize=8, label="parent")
    ax.plot(
        *np.stack([parent, farthest]).T,
        color=START,
        linewidth=2.2,
        label=f"LS = {sensitivity:.2f} m: parent to farthest offspring",
    )
    ax.plot(
        *children[[first, second]].T,
        color=LONG_JUMP,
        linewidth=2.2,
        label=f"η = {evolvability:.2f} m: the two offspring farthest apart",
    )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), frameon=False, fontsize="small")
    ax.set_title(
        f"An elite and its {len(children)} children on the table; r = {evolvability / sensitivity:.2f}"
    )


def metrics(figure: Figure) -> None:
    """G over the table, by five metrics, around what a walk has seen."""
    figure.set_size_inches(15, 5)
    parent, children = _family()
    archive = _archive_sample()
    x, y = np.meshgrid(np.linspace(1.05, 1.55, 90), np.linspace(0.4, 1.1, 126))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    around = diversity.Surroundings(
        siblings=children[None],
        archive=archive[None],
        age=np.ones((1, len(archive)), np.int64),
        path=np.stack([[1.34, 0.75], [1.25, 0.66], parent])[None, None],
        span=np.array([0.5, 0.7]),
    )
    nobody, lineage = np.full(len(points), -1), np.zeros(len(points), np.int64)
    named = {
        "kNN with archive": diversity.make("knn"),
        "kNN without": diversity.make("knn-no-archive"),
        "parent": diversity.make("parent"),
        "ancestors": diversity.make("ancestors"),
        "KDE": diversity.make("kde"),
    }
    for ax, (name, metric) in zip(figure.subplots(1, 5), named.items(), strict=True):
        score = metric(points[None], lineage, nobody, around)[0].reshape(x.shape)
        ax.pcolormesh(x, y, score, cmap="viridis", rasterized=True)
        ax.contour(x, y, score, 8, colors="white", linewidths=0.4)
        ax.plot(*children.T, ".", color="white", markersize=4)
        if metric.remembers:
            ax.plot(*archive.T, "x", color="white", markersize=4, markeredgewidth=0.7)
        if name == "ancestors":
            ax.plot(*around.path[0, 0].T, "s-", color=LONG_JUMP, markersize=5)
        if name == "parent":
            ax.plot(*parent, "s", color=LONG_JUMP, markersize=6)
        ax.set(title=name, aspect="equal", xticks=[], yticks=[], xlim=(1.05, 1.55), ylim=(0.4, 1.1))


def between(figure: Figure) -> None:
    """KNN and KDE between two points."""
    figure.set_size_inches(7, 3.4)
    ax = figure.subplots()
    ends = np.array([[0.0, 0.0], [1.0, 0.0]])
    where = np.linspace(-0.25, 1.25, 301)
    query = np.stack([where, np.zeros_like(where)], axis=1)[None]
    knn = diversity.knn_distance(query, ends[None], 2)[0]
    kde = -diversity.kernel_density(query, ends[None], np.eye(2) * 0.25**2)[0]
    for name, score, color in (("kNN, k = 2", knn, EDGE), ("KDE, bandwidth 0.25", kde, LONG_JUMP)):
        ax.plot(where, (score - score.min()) / np.ptp(score), color=color, label=name)
    ax.plot(ends[:, 0], [0, 0], "o", color=INK, clip_on=False, zorder=5)
    for end, name in zip(ends, "AB", strict=True):
        ax.annotate(name, end, (0, 8), textcoords="offset points", ha="center")
    ax.set(xlabel="position on the line", ylabel="G, scaled to 0 … 1", ylim=(0, 1.02))
    ax.legend(frameon=False)
    ax.spines[["top", "right"]].set_visible(False)


def _family() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """An elite and its children on the table: that of 25 or more whose children differ most."""
    rows = ARCHIVE.births().set_index("uid")
    on_table = rows[rows["child_niche"] < len(ARCHIVE.niches)]
    best, found = -1.0, None
    for parent, children in on_table.groupby("parent_uid"):
        if not 25 <= len(children) <= 40 or rows.loc[parent, "child_niche"] >= len(ARCHIVE.niches):
            continue
        ends = children[["behavior_x", "behavior_y"]].to_numpy(float)
        spread = float(np.linalg.norm(ends[:, None] - ends[None], axis=2).mean())
        if spread > best:
            best = spread
            found = rows.loc[parent, ["behavior_x", "behavior_y"]].to_numpy(float), ends
    assert found is not None
    return found


def _archive_sample() -> NDArray[np.float64]:
    """Forty behaviors of the archive's elites, as a novelty archive might hold them."""
    inside = ARCHIVE.elites.behavior[ARCHIVE.elites.niche < len(ARCHIVE.niches)]
    return inside[np.random.default_rng(0).choice(len(inside), 40, replace=False)]


PICTURES: dict[str, Callable[[Figure], None]] = {
    "local_measures": local_measures,
    "diversity": metrics,
    "between": between,
}
