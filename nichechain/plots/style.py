"""What the figures share: colours that colour-blind eyes tell apart, and axes over behavior."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.core.text import rounded
from nichechain.niches import GridNiches

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

    from nichechain.archive.archive import Archive

Floats = NDArray[np.float64]

EMPTY = "#ececec"
"""A niche that nobody was born in."""
EDGE = "#35618f"
"""An ordinary transition."""
LONG_JUMP = "#d1495b"
"""A transition to a far niche."""
FAINT = "#b9c0c7"
"""What happens so often that it would hide the rest."""
START = "#e8a33d"
"""Where a block, or a hand, is if nothing is done."""
INK = "#333333"
_NAMES = "#777777"
# Letters of a line under a map.
_NOTE = 62
# An outlier is further from the quartiles than so many times the distance between these.
_FAR = 3.0

# Height of a strip that shows one axis of behavior, over its width.
_STRIP = 0.18
# Where one axis is so many times as long as the other, a map to scale is a line.
_MOST_UNEQUAL = 10.0
# Distance of the legend from the map, in inches: ticks and the name of an axis stand between.
_LEGEND = 0.42


def axes_of(ax: Axes | None) -> Axes:
    """The Axes given, or one of a new figure, which notebooks show."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    _, made = plt.subplots(layout="constrained")
    return made


def behavior_axes(ax: Axes, archive: Archive, *, strip: bool = True) -> None:
    """Label an Axes with the one or two axes of behavior and mark the start.

    The axes are to scale, unless one is more than ten times as long as the other.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    archive : Archive
    strip : bool
        Whether what is drawn makes sense as a strip along one axis.

    Raises
    ------
    NichechainError
        If behavior has more axes, or one where that makes no sense.
    """
    facts = archive.meta.facts
    names = [plain(f"{name} ({facts.unit})") for name in facts.behavior_names]
    if len(names) > 2 or (len(names) == 1 and not strip):
        raise NichechainError(
            f"behavior has {len(names)} axes, but this is drawn over {'1 or 2' if strip else '2'}: "
            "growth, transitions and transitions-by-class are drawn of any number"
        )
    if len(names) == 2:
        (left, right), (bottom, top) = archive.niches.bounds
        sides = sorted((right - left, top - bottom))
        aspect = "equal" if sides[1] <= _MOST_UNEQUAL * sides[0] else "auto"
        ax.set(xlim=(left, right), ylim=(bottom, top), aspect=aspect, xlabel=names[0], ylabel=names[1])
        _name_niches(ax, archive)
    else:
        ax.set(xlim=archive.niches.bounds[0], ylim=(0.0, 1.0), yticks=[], xlabel=names[0])
        ax.set_box_aspect(_STRIP)
    ax.tick_params(length=3, color=INK)
    for spine in ax.spines.values():
        spine.set_color("#999999")
    if facts.start is not None and _near(facts.start, archive.niches.bounds):
        ax.plot(
            *on_map(facts.start),
            marker="P",
            markersize=9,
            markerfacecolor=START,
            markeredgecolor="black",
            markeredgewidth=0.8,
            linestyle="none",
            clip_on=False,
            zorder=10,
            label="start",
        )


def _name_niches(ax: Axes, archive: Archive) -> None:
    """Along the other two sides, the numbers that name niches of a grid, such as 14,3."""
    niches = archive.niches
    if not isinstance(niches, GridNiches):
        return
    sides = (ax.secondary_xaxis("top"), ax.secondary_yaxis("right"))
    for side, name, (low, high), cells in zip(sides, "ij", niches.bounds, niches.shape, strict=True):
        each = max(1, -(-cells // 5))
        kept = np.arange(0, cells, each)
        axis = side.xaxis if name == "i" else side.yaxis
        axis.set_ticks(low + (kept + 0.5) * (high - low) / cells, [str(k) for k in kept])
        side.tick_params(length=0, pad=2, labelsize="x-small", labelcolor=_NAMES)
        side.spines[:].set_visible(False)
        axis.set_label_text(f"niche {name}", fontsize="x-small", color=_NAMES)
        axis.labelpad = 1


def check_records(records: pd.DataFrame, *columns: str) -> None:
    """Refuse what is no table of a study.

    Raises
    ------
    NichechainError
        If it is no DataFrame, or a column is missing.
    """
    import pandas as pd

    if not isinstance(records, pd.DataFrame):
        raise NichechainError(f"records is {shown(records)}, but must be a DataFrame")
    missing = [name for name in columns if name not in records]
    if missing:
        raise NichechainError(f"records have no column {missing[0]}, but need {', '.join(columns)}")


def plain(text: str) -> str:
    """A name whose dollars are dollars: between two of them matplotlib would read a formula."""
    return text.replace("$", r"\$")


def on_map(behavior: ArrayLike) -> tuple[Floats, Floats]:
    """Where behaviors (..., B) lie on a map; in the middle of a strip if they have one axis."""
    places = np.moveaxis(np.asarray(behavior, np.float64), -1, 0)
    return (places[0], places[1]) if len(places) > 1 else (places[0], np.full_like(places[0], 0.5))


def without_outliers(values: Floats) -> tuple[float | None, float | None]:
    """Smallest and largest of values (n,) that are no outliers; NaN is left out, and None is of no values."""
    known = values[np.isfinite(values)]
    if not known.size:
        return None, None
    lower, upper = np.quantile(known, (0.25, 0.75))
    # Where half of the values are one and the same, all others would be outliers.
    far = _FAR * (upper - lower) or np.inf
    near = known[(known >= lower - far) & (known <= upper + far)]
    return float(near.min()), float(near.max())


def colorbar(ax: Axes, mappable: ScalarMappable, label: str, values: Floats | None = None) -> None:
    """A colour bar as high as the map.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    mappable : matplotlib.cm.ScalarMappable
    label : str
    values : (n,) array, optional
        Those that are drawn: if some are beyond the ends of the bar, it says so.
    """
    figure = ax.get_figure()
    assert figure is not None
    beyond = {} if values is None else _beyond(mappable, values)
    ends = {(): "neither", ("min",): "min", ("max",): "max"}.get(tuple(beyond), "both")
    bar = figure.colorbar(mappable, cax=ax.inset_axes((1.11, 0.0, 0.045, 1.0)), extend=ends)
    bar.set_label(plain("\n".join([label, *(["; ".join(beyond.values())] if beyond else [])])))
    bar.outline.set_visible(False)


def _beyond(mappable: ScalarMappable, values: Floats) -> dict[str, str]:
    """What lies beyond the ends of a colour bar, by the end."""
    low, high = mappable.get_clim()
    said = {}
    if (below := values[values < low]).size:
        said["min"] = f"{below.size} lower, down to {rounded(below.min())}"
    if (above := values[values > high]).size:
        said["max"] = f"{above.size} higher, up to {rounded(above.max())}"
    return said


def key(ax: Axes, *handles: Any, note: str | None = None) -> None:
    """A legend under the map, where it hides nothing, and under it where the numbers come from."""
    from matplotlib.transforms import ScaledTranslation

    figure = ax.get_figure()
    assert figure is not None
    shown = [*handles, *ax.get_legend_handles_labels()[0]]
    if shown or note:
        legend = ax.legend(
            handles=shown,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=ax.transAxes + ScaledTranslation(0.0, -_LEGEND, figure.dpi_scale_trans),
            ncols=2 if len(shown) == 4 else min(3, max(1, len(shown))),
            frameon=False,
            fontsize="small",
        )
        if note:
            # As the legend's title it moves with it, however many lines the legend has.
            lines = [line for part in note.split("\n") for line in textwrap.wrap(part, _NOTE)]
            legend.set_title("\n".join(lines))
            legend.get_title().set(fontsize="small", color="#555555")


def _near(place: Sequence[float], bounds: Sequence[tuple[float, float]]) -> bool:
    """Whether a place is on the map, or beside it by no more than a tenth of its size."""
    margin = 0.1
    return all(
        low - margin * (high - low) <= at <= high + margin * (high - low)
        for at, (low, high) in zip(place, bounds, strict=False)
    )
