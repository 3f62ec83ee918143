"""Pictures of results that are kept: lineages that were run, other grids, landscapes, studies of walks."""

from __future__ import annotations

import json
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from of_archive import ARCHIVE, CHAIN
from saving import RESULTS

from nichechain.plots.landscape import MAPS, plot_landscape
from nichechain.plots.validation import (
    plot_calibration,
    plot_filling,
    plot_reached,
    plot_scores,
    plot_surprise,
)
from nichechain.plots.walks import draw_study
from nichechain.validation import Lineages, compare, grid_size

STUDIES = {
    "pressure": "Evolutionary pressure and evolvability, on fetch",
    "metrics": "Diversity metrics and evolvability, on fetch",
}
"""Titles of studies of walks whose records are in the results."""


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


def study(name: str) -> Figure:
    """The figure of a study of walks, from its records."""
    told = json.loads((RESULTS / name / "statistics.json").read_text())["study"]
    records = pd.read_parquet(RESULTS / name / "records.parquet")
    return draw_study(
        records,
        step=int(records["step"].max()),
        conditions=[condition["label"] for condition in told["conditions"]],
        ordered=name == "pressure",
        unit="m",
        title=STUDIES[name],
    )


PICTURES: dict[str, Callable[[Figure], None]] = {
    "calibration": calibration,
    "sweep": sweep,
    "landscape": landscape,
}
