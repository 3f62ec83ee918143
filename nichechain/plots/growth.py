"""Curves of l-evolvability: against the generations l, and against the number U of lineages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import NicheChain
from nichechain.core.checks import as_tuple, check_at_least, check_fits
from nichechain.core.errors import NichechainError
from nichechain.core.intervals import drawn_interval
from nichechain.core.text import some
from nichechain.evolvability.averaging import ENDLESS, SATURATED
from nichechain.evolvability.coverage import coverage_by_generation
from nichechain.evolvability.question import Question, dense
from nichechain.niches import Niche
from nichechain.plots.style import EDGE, INK, LONG_JUMP, START, axes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Lines of up to four niches: told apart by lightness and by marker as well as by hue.
_COLORS = (EDGE, LONG_JUMP, START, "#4a4a4a")
_MARKERS = ("o", "s", "^", "D")
_MOST_STATES = 4_000


def plot_generations(
    chain: NicheChain,
    ax: Axes | None = None,
    *,
    niches: Sequence[Niche],
    lineages: int = 100,
    longest: int = 10,
    draws: int = 20,
    seed: int = 0,
) -> Axes:
    """l-evolvability of some niches against l, with 90 % bands, hollow where U saturates.

    Parameters
    ----------
    chain : NicheChain
    ax : matplotlib.axes.Axes, optional
        By default one of its own.
    niches : sequence of int or tuple of int
        One to four of them.
    lineages : int
        U.
    longest : int
        Largest l.
    draws, seed : int
        Posterior draws of T, where it is estimated.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If a niche does not exist, a number is out of range, or there are too many niches.
    """
    ax = axes_of(ax)
    niches = as_tuple("niches", niches)
    check_at_least(1, longest=longest)
    check_fits(longest=longest)
    question = Question(longest, lineages, draws=draws, seed=seed)
    covered = _covered(chain, niches, question, np.array([lineages, ENDLESS]))
    _lines(ax, chain, niches, np.arange(1, longest + 1), covered[..., 0], covered[..., 1])
    ax.set(xlabel="generations l", xlim=(0.5, longest + 0.5), title=f"Against l, {some(lineages, 'lineage')}")
    ax.set_xticks(range(1, longest + 1, 1 + longest // 16))
    return ax


def plot_lineages(
    chain: NicheChain,
    ax: Axes | None = None,
    *,
    niches: Sequence[Niche],
    l: int = 5,
    most: int = 10_000,
    draws: int = 20,
    seed: int = 0,
) -> Axes:
    """l-evolvability of some niches against U, with 90 % bands, hollow where U saturates.

    Parameters
    ----------
    chain, ax, niches, draws, seed
        As in :func:`plot_generations`.
    l : int
        Generations.
    most : int
        Largest U, at least 2.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        As in :func:`plot_generations`.
    """
    ax = axes_of(ax)
    niches = as_tuple("niches", niches)
    question = Question(l, draws=draws, seed=seed)
    check_at_least(2, most=most)
    check_fits(most=most)
    sizes = np.unique(np.round(np.geomspace(1, most, 17)).astype(np.int64))
    covered = _covered(chain, niches, question, np.append(sizes, ENDLESS))[:, :, -1]
    _lines(ax, chain, niches, sizes, covered[..., :-1], covered[..., -1:])
    ax.set(xscale="log", xlabel="lineages U", title=f"Against U, {some(l, 'generation')}")
    return ax


def check_growth(states: int) -> None:
    """Refuse chains whose curves would take too long, by their states, before anything is computed.

    Raises
    ------
    NichechainError
        If there are more than 4,000 states.
    """
    if states > _MOST_STATES:
        raise NichechainError(
            f"the chain has {states} states, but growth is computed in closed form, "
            f"for at most {_MOST_STATES}"
        )


def _covered(chain: NicheChain, niches: Sequence[Niche], question: Question, lineages: Ints) -> Floats:
    """Coverage (draws, niches, generations, lineages)."""
    if not 1 <= len(niches) <= len(_COLORS):
        raise NichechainError(f"{len(niches)} niches are given, but one to {len(_COLORS)} can be told apart")
    check_growth(chain.states)
    roots = [chain.state(niche) for niche in niches]
    replace(question, method="exact").warn_if_long(chain)
    return np.array(
        [
            coverage_by_generation(
                drawn.onward,
                roots,
                question.l,
                lineages,
                chain.n_niches,
                first=dense(drawn.children(np.array(roots))),
            )
            for drawn in question.samples(chain)
        ]
    )


def _lines(
    ax: Axes, chain: NicheChain, niches: Sequence[Niche], x: Ints, values: Floats, endless: Floats
) -> None:
    """A line for each niche of (draws, niches, x); ``endless`` is what no U can exceed."""
    from matplotlib.lines import Line2D

    hollows = False
    for number in range(len(niches)):
        here = values[:, number]
        mean = here.mean(axis=0)
        low, high = drawn_interval(here)
        saturated = np.median(here / endless[:, number], axis=0) > SATURATED
        hollows |= bool(saturated.any())
        color, marker = _COLORS[number], _MARKERS[number]
        ax.fill_between(x, low, high, color=color, alpha=0.15, linewidth=0)
        ax.plot(x, mean, color=color, linewidth=1.4, zorder=3)
        for hollow in (False, True):
            chosen = saturated == hollow
            ax.plot(
                x[chosen],
                mean[chosen],
                marker,
                color=color,
                markerfacecolor="white" if hollow else color,
                markersize=5,
                linestyle="none",
                zorder=4,
            )
    handles = [
        Line2D(
            [], [], color=_COLORS[k], marker=_MARKERS[k], markersize=5, label=chain.label(chain.state(niche))
        )
        for k, niche in enumerate(niches)
    ]
    if hollows:
        words = "saturated: over 95 % of what\nendless lineages would visit"
        dot = Line2D([], [], color=INK, marker="o", markerfacecolor="white", linestyle="none", label=words)
        handles.append(dot)
    ax.legend(handles=handles, title="niche", alignment="left", frameon=False, fontsize="small")
    ax.set(ylabel="niches reached (90 % band)", ylim=(0.0, None))
    ax.tick_params(length=3, color=INK)
    ax.spines[["top", "right"]].set_visible(False)
