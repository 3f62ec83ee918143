"""Heat maps of landscape measures over niches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nichechain.landscape import Landscape, Measure, find_measure, find_measures
from nichechain.plots.cells import fill, hatch
from nichechain.plots.style import EMPTY, behavior_axes, colorbar, key, on_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from nichechain.archive.archive import Archive

MAPS = (
    "local_sensitivity",
    "evolvability",
    "ratio",
    "expected_local_sensitivity",
    "expected_evolvability",
    "expected_ratio",
)
"""What small multiples show by default: the three measures, and below them their expected variants."""

_COLUMNS = 3
# Inches: the longer side of a map, and what stands beside and below it.
_SIZE = 4.2
_BESIDE = 1.5
_BELOW = 1.2
_DISSIMILUM = "#41b6e6"
_NEUTRAL = "#8a8a8a"
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def plot_landscape(
    archive: Archive, landscape: Landscape, figure: Figure, measures: Sequence[str] = MAPS
) -> None:
    """Maps of several measures, one beside the other.

    Parameters
    ----------
    archive : Archive
        Whose elites were measured.
    landscape : Landscape
    figure : matplotlib.figure.Figure
        An empty one. Its size is set, and what hangs over it belongs to it: save it with
        ``bbox_inches="tight"``.
    measures : sequence of str
        Names in :data:`nichechain.landscape.MEASURES`.

    Raises
    ------
    NichechainError
        If there is no such measure, or behavior has more than two axes.
    """
    shown = find_measures(measures)
    columns = min(_COLUMNS, len(shown))
    rows = math.ceil(len(shown) / columns)
    extent = landscape.niches.upper - landscape.niches.lower
    # One axis of behavior is drawn as a strip.
    width, height = _SIZE * extent / extent.max() if len(extent) == 2 else (_SIZE, _SIZE / 4)
    figure.set_size_inches((width + _BESIDE) * columns, (height + _BELOW) * rows)
    axes = figure.subplots(
        rows,
        columns,
        squeeze=False,
        gridspec_kw={
            "left": 0.0,
            "right": 1.0 - _BESIDE / ((width + _BESIDE) * columns),
            "bottom": _BELOW / ((height + _BELOW) * rows),
            "top": 1.0,
            "wspace": _BESIDE / width,
            "hspace": _BELOW / height,
        },
    )
    for number, ax in enumerate(axes.flat):
        if number >= len(shown):
            ax.remove()
            continue
        plot_measure(archive, landscape, ax, shown[number].name)
        if number % columns:
            ax.set_ylabel("")
        if number + columns < len(shown):
            ax.set_xlabel("")


def plot_measure(archive: Archive, landscape: Landscape, ax: Axes, measure: str) -> Axes:
    """One measure of the elite of every niche.

    Dissimila are marked on r*; neutral elites, of which r and r* say nothing, are hatched there.

    Parameters
    ----------
    archive : Archive
        Whose elites were measured.
    landscape : Landscape
    ax : matplotlib.axes.Axes
    measure : str
        A name in :data:`nichechain.landscape.MEASURES`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If there is no such measure, or behavior has more than two axes.
    """
    chosen = find_measure(measure)
    found, niches = landscape.dissimila, landscape.niches
    inside = landscape.state < len(niches)
    values = np.full(len(niches), np.nan)
    values[landscape.state[inside]] = landscape.measures[chosen.name][inside]
    behavior_axes(ax, archive)
    ax.set_facecolor(EMPTY)
    handles = []
    if chosen.name in ("ratio", "expected_ratio"):
        silent = np.zeros(len(niches), bool)
        silent[landscape.state[inside & found.neutral]] = True
        values[silent] = np.nan
        if silent.any():
            from matplotlib.patches import Patch

            hatch(ax, niches, silent, _NEUTRAL)
            handles.append(Patch(facecolor=EMPTY, hatch="////", edgecolor=_NEUTRAL, label="neutral"))
    mesh = fill(ax, niches, values, "magma")
    marked = landscape.state[inside & found.dissimila]
    if chosen.name == "expected_ratio" and len(marked):
        ax.plot(
            *on_map(niches.centers[marked]),
            marker="o",
            linestyle="none",
            markersize=5,
            markerfacecolor="none",
            markeredgecolor=_DISSIMILUM,
            markeredgewidth=1.3,
            label=f"dissimila, r* ≤ {found.threshold:.2f}",
        )
    colorbar(ax, mesh, _unit(chosen, landscape))
    ax.set_title(f"{chosen.title[0].upper()}{chosen.title[1:]}, {chosen.symbol}")
    key(ax, *handles)
    return ax


def _unit(measure: Measure, landscape: Landscape) -> str:
    """Unit of a measure."""
    unit = landscape.unit
    if measure.axes == "none" or not unit:
        return ""
    axes = landscape.parent.shape[1] if measure.axes == "all" else 1
    power = "" if axes == 1 else str(axes).translate(_SUPERSCRIPTS)
    return f"{unit}{power}"
