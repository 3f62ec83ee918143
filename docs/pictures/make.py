"""Draw the pictures of the documentation, from the shipped archive, results and the examples.

``python docs/pictures/make.py [NAME ...]`` draws all of them, or those of the given names, beside
this file; all together it takes some minutes. ``explorer`` needs Selenium and Chromium.
"""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

import nichechain as nc
from nichechain import plots
from nichechain.chain.structure.wormholes import wormholes
from nichechain.plots.explorer import write_explorer
from nichechain.plots.landscape import MAPS, plot_landscape
from nichechain.plots.style import EDGE, EMPTY, INK, LONG_JUMP, START, behavior_axes
from nichechain.plots.validation import (
    plot_calibration,
    plot_filling,
    plot_reached,
    plot_scores,
    plot_surprise,
)
from nichechain.plots.walks import draw_study
from nichechain.validation import Lineages, compare, grid_size
from nichechain.walks import diversity

# Twice what a page shows, so that letters stay sharp.
_DPI = 160

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "examples"
RESULTS = EXAMPLES / "results"
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
    _cells(ax)
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


def local_measures(figure: Figure) -> None:
    """LS and η of one elite, from its recorded children."""
    figure.set_size_inches(5.2, 6)
    ax = figure.subplots()
    parent, children = _family()
    behavior_axes(ax, ARCHIVE)
    _cells(ax)
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


def calibration(figure: Figure) -> None:
    """What lineages of 100 elites reached, beside what the chain says."""
    figure.set_size_inches(13, 4.6)
    figure.set_layout_engine("constrained")
    with np.load(RESULTS / "truth" / "fetch-1.npz") as kept:
        found = Lineages(*(kept[name].astype(np.int64) for name in ("root_niche", "niches", "offspring")))
    check = compare(CHAIN, found, ARCHIVE.niches)
    one, five, all_of_them = figure.subplots(1, 3)
    plot_calibration(check, one, generation=1)
    plot_calibration(check, five, generation=5)
    plot_reached(check, all_of_them)


def sweep(figure: Figure) -> None:
    """Grids of several sizes over the births."""
    figure.set_size_inches(13, 4.6)
    found = grid_size.sweep(ARCHIVE)
    left, middle, right = figure.subplots(1, 3, gridspec_kw={"wspace": 0.3})
    plot_filling(found, left)
    plot_surprise(found, middle)
    plot_scores(found, right)


def landscape(figure: Figure) -> None:
    """Maps of every elite's measures, from the table that the command left."""
    table = pd.read_csv(RESULTS / "landscape" / "fetch-pick-and-place.csv")
    told = json.loads((RESULTS / "landscape" / "fetch-pick-and-place.json").read_text())
    found = SimpleNamespace(
        dissimila=table["dissimilum"].to_numpy(bool),
        neutral=table["neutral"].to_numpy(bool),
        threshold=told["dissimila"]["threshold"],
    )
    measured = SimpleNamespace(
        niches=ARCHIVE.niches,
        state=table["niche"].to_numpy(),
        measures={name: table[name].to_numpy(float) for name in MAPS},
        dissimila=found,
        parent=table[["behavior_x", "behavior_y"]].to_numpy(),
        unit=told["unit"],
    )
    plot_landscape(ARCHIVE, measured, figure)


PICTURES: dict[str, Callable[[Figure], None]] = {
    "visits": visits,
    "evolvability": evolvability,
    "reachability": reachability,
    "births": births,
    "rows": rows_of_t,
    "transitions": transitions,
    "growth": growth,
    "wormholes": wormhole_map,
    "local_measures": local_measures,
    "diversity": metrics,
    "between": between,
    "landscape": landscape,
    "calibration": calibration,
    "sweep": sweep,
}
TITLES = {
    "pressure": "Evolutionary pressure and evolvability, on fetch",
    "metrics": "Diversity metrics and evolvability, on fetch",
}
"""Studies of walks whose records are in the results."""


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


def _cells(ax: Axes) -> None:
    x, y = _edges()
    ax.vlines(x, y[0], y[-1], color=EMPTY, linewidth=0.6, zorder=0)
    ax.hlines(y, x[0], x[-1], color=EMPTY, linewidth=0.6, zorder=0)


def shrink(path: Path, width: int = 1600) -> None:
    """No wider than a sharp screen shows a page. All colours stay: a palette makes bands of a scale."""
    with Image.open(path) as image:
        whole = image.convert("RGB")
    if whole.width > width:
        whole = whole.resize((width, round(whole.height * width / whole.width)), Image.Resampling.LANCZOS)
    whole.save(path, optimize=True)


def draw_example(path: Path) -> None:
    """Run an example and keep its picture."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            runpy.run_path(str(path), run_name="__main__")
            (picture,) = Path(folder).glob("*.png")
            out = HERE / "examples" / f"{path.stem}.png"
            out.parent.mkdir(exist_ok=True)
            out.write_bytes(picture.read_bytes())
        finally:
            os.chdir(before)
    shrink(out)
    print(f"wrote {out}")


def draw_walks(name: str) -> None:
    """The figure of a study of walks, from its records."""
    told = json.loads((RESULTS / name / "statistics.json").read_text())["study"]
    records = pd.read_parquet(RESULTS / name / "records.parquet")
    figure = draw_study(
        records,
        step=int(records["step"].max()),
        conditions=[condition["label"] for condition in told["conditions"]],
        ordered=name == "pressure",
        unit="m",
        title=TITLES[name],
    )
    _save(figure, name)


def draw_explorer() -> None:
    """The explorer's page, as a browser shows it."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for argument in ("headless", "no-sandbox", "disable-gpu", "window-size=1280,1000"):
        options.add_argument(f"--{argument}")
    service = webdriver.ChromeService(shutil.which("chromedriver"))
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "explore.html"
        write_explorer(ARCHIVE, CHAIN, page)
        browser = webdriver.Chrome(options=options, service=service)
        try:
            browser.get(f"{page.as_uri()}#niche=14,14")
            browser.save_screenshot(str(HERE / "explorer.png"))
        finally:
            browser.quit()
    shrink(HERE / "explorer.png")
    print(f"wrote {HERE / 'explorer.png'}")


def draw_gallery() -> None:
    """Run the blocks of the gallery, which write its pictures, and keep these."""
    before, names = Path.cwd(), {}
    blocks = re.findall(r"^```python\n(.*?)^```$", (HERE.parent / "gallery.md").read_text(), re.S | re.M)
    out = HERE / "gallery"
    out.mkdir(exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        plt.rc_context({"figure.figsize": (5.4, 5.8), "savefig.dpi": 140}),
    ):
        os.chdir(folder)
        try:
            for block in blocks:
                exec(block, names)  # noqa: S102  # our own page
        finally:
            os.chdir(before)
        for picture in sorted(Path(folder).glob("*.png")):
            (out / picture.name).write_bytes(picture.read_bytes())
            print(f"wrote {out / picture.name}")


def _save(figure: Figure, name: str) -> None:
    out = HERE / f"{name}.png"
    # A layout of its own keeps to the size asked for.
    figure.savefig(out, dpi=_DPI, bbox_inches=None if figure.get_layout_engine() else "tight")
    shrink(out)
    print(f"wrote {out}")


def draw(name: str) -> None:
    """Draw the picture of that name, as it is made."""
    if name in TITLES:
        draw_walks(name)
    elif name in MADE_OTHERWISE:
        MADE_OTHERWISE[name]()
    elif name in NUMBERED:
        draw_example(NUMBERED[name])
    else:
        figure = Figure()
        PICTURES[name](figure)
        _save(figure, name)


MADE_OTHERWISE: dict[str, Callable[[], None]] = {
    "explorer": draw_explorer,
    "gallery": draw_gallery,
}
NUMBERED = {path.stem: path for path in EXAMPLES.glob("0[1-4]_*.py")}


if __name__ == "__main__":
    for picture in sys.argv[1:] or [*PICTURES, *TITLES, *MADE_OTHERWISE, *sorted(NUMBERED)]:
        draw(picture)
