"""What the figures share: colours that colour-blind eyes tell apart, and axes over behavior."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nichechain.errors import NichechainError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

    from nichechain.archive import Archive
    from nichechain.niches import GridNiches

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


def behavior_axes(ax: Axes, archive: Archive) -> None:
    """Label an Axes with the two axes of behavior, to scale, and mark the start.

    Raises
    ------
    NichechainError
        If behavior does not have two axes.
    """
    facts = archive.meta.facts
    if len(facts.behavior_names) != 2:
        raise NichechainError(f"behavior has {len(facts.behavior_names)} axes, but maps are drawn over 2")
    (left, right), (bottom, top) = archive.niches.bounds
    ax.set(
        xlim=(left, right),
        ylim=(bottom, top),
        aspect="equal",
        xlabel=f"{facts.behavior_names[0]} ({facts.unit})",
        ylabel=f"{facts.behavior_names[1]} ({facts.unit})",
    )
    ax.tick_params(length=3, color=INK)
    for spine in ax.spines.values():
        spine.set_color("#999999")
    if facts.start is not None:
        ax.plot(
            *facts.start,
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


def edges(niches: GridNiches) -> tuple[np.ndarray, np.ndarray]:
    """Borders of the cells along the two axes."""
    (left, right), (bottom, top) = niches.bounds
    columns, rows = niches.shape
    return np.linspace(left, right, columns + 1), np.linspace(bottom, top, rows + 1)


def colorbar(ax: Axes, mappable: ScalarMappable, label: str) -> None:
    """A colour bar as high as the map."""
    figure = ax.get_figure()
    assert figure is not None
    bar = figure.colorbar(mappable, cax=ax.inset_axes((1.03, 0.0, 0.045, 1.0)))
    bar.set_label(label)
    bar.outline.set_visible(False)


def key(ax: Axes, *handles: Any, note: str | None = None) -> None:
    """A legend under the map, where it hides nothing, and under it where the numbers come from."""
    shown = [*handles, *ax.get_legend_handles_labels()[0]]
    if shown or note:
        legend = ax.legend(
            handles=shown,
            loc="upper center",
            bbox_to_anchor=(0.5, -0.09),
            ncols=2 if len(shown) == 4 else min(3, max(1, len(shown))),
            frameon=False,
            fontsize="small",
        )
        if note:
            # As the legend's title it moves with it, however many lines the legend has.
            legend.set_title(note)
            legend.get_title().set(fontsize="x-small", color="#555555")
