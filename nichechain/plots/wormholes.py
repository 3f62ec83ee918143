"""Wormholes as a map: transitions far more probable than distance and destination explain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nichechain.plots.cells import fill
from nichechain.plots.style import EMPTY, INK, behavior_axes, colorbar, key

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive

_WIDEST = 3.0
_BEND = 0.15
_MOST_LABELS = 12


def plot_wormholes(archive: Archive, found: pd.DataFrame, ax: Axes) -> Axes:
    """An arrow for every wormhole, over the births of every niche.

    Width shows the probability of the transition, colour how surely it is a wormhole; singletons
    are dotted. The number beside an arrow is how many of how many births took it.

    Parameters
    ----------
    archive : Archive
    found : pandas.DataFrame
        From :func:`nichechain.chain.structure.wormholes.wormholes`; only flagged rows are drawn.
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If behavior does not have two axes.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.patheffects import withStroke

    behavior_axes(ax, archive, strip=False)
    ax.set_facecolor(EMPTY)
    visits = archive.counts.visits[: len(archive.niches)].astype(float)
    shown = np.where(visits > 0, visits, np.nan)
    # Births in faint grey: where there are many, a jump means less.
    fill(ax, archive.niches, shown, "Greys", LogNorm(1.0, 1000.0 * max(2.0, visits.max())))
    flagged = found[found["wormhole"]].sort_values("exceeds", kind="stable")
    low = min(0.5, float(flagged["exceeds"].min())) if len(flagged) else 0.5
    scale = ScalarMappable(Normalize(low, 1.0), colormaps["plasma_r"])
    centers = archive.niches.centers
    for number, row in enumerate(flagged.itertuples()):
        strength = float(np.sqrt(row.probability))
        color = scale.to_rgba(row.exceeds)
        ax.add_patch(
            FancyArrowPatch(
                tuple(centers[row.parent]),
                tuple(centers[row.child]),
                # Curved, so that an arrow and its opposite do not lie on each other.
                connectionstyle=f"arc3,rad={_BEND}",
                arrowstyle="-|>",
                mutation_scale=8 + 8 * strength,
                linewidth=0.8 + _WIDEST * strength,
                linestyle=":" if row.singleton else "-",
                color=color,
                shrinkA=2,
                shrinkB=2,
                zorder=3,
                path_effects=[withStroke(linewidth=2.5 + _WIDEST * strength, foreground="#ffffffb0")],
            )
        )
        if number >= len(flagged) - _MOST_LABELS:
            way = centers[row.child] - centers[row.parent]
            # The middle of the curve.
            middle = centers[row.parent] + way / 2 + _BEND / 2 * np.array([way[1], -way[0]])
            ax.annotate(
                f"{row.count}/{row.exposure}",
                middle,
                fontsize="x-small",
                ha="center",
                va="center",
                zorder=4,
                path_effects=[withStroke(linewidth=2.0, foreground="white")],
            )
    colorbar(ax, scale, "posterior probability of being one")
    singles = int(flagged["singleton"].sum())
    ax.set_title(f"Wormholes: {len(flagged)} of {len(found)} observed transitions")
    handles = []
    if len(flagged) > singles:
        handles.append(Line2D([], [], color=INK, label="wormhole (births that took it / births)"))
    if singles:
        handles.append(Line2D([], [], color=INK, linestyle=":", label=f"by a single birth: {singles}"))
    false = float(flagged["cumulated_false"].max()) if len(flagged) else 0.0
    key(ax, *handles, note=f"shade: births; {false:.2g} of the wormholes are expected to be none")
    return ax
