"""One row per niche: what births, the chain and the recorded children of its elite say of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import LINEAGE
from nichechain.chain.estimators import estimate
from nichechain.chain.model import NicheChain
from nichechain.chain.structure.wormholes import wormholes
from nichechain.core.checks import check_at_least
from nichechain.evolvability.niches import answer_for_niches
from nichechain.evolvability.question import DRAWS, Question
from nichechain.landscape.behaviors import (
    dissimila_ratio,
    expected_evolvability,
    expected_local_sensitivity,
)
from nichechain.landscape.dissimila import find_dissimila
from nichechain.search.parents import curiosity

if TYPE_CHECKING:
    import pandas as pd

    from nichechain.archive.archive import Archive

Floats = NDArray[np.float64]

FEWEST_CHILDREN = 5
"""Recorded children that an elite needs for its r*."""

# More than these tell no more, and pairs of them grow with the square.
_MOST_CHILDREN = 200


def niche_table(
    archive: Archive,
    *,
    l: int = 5,
    lineages: int = 100,
    estimator: str = "empirical-bayes",
    children: int = FEWEST_CHILDREN,
    draws: int = DRAWS,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> pd.DataFrame:
    """What is known of every niche that births fell in, one row each.

    Parameters
    ----------
    archive : Archive
    l, lineages, draws, seed
        As in :func:`nichechain.niche_evolvability`.
    estimator : {"empirical-bayes", "dirichlet", "mle"}
    children : int
        So many recorded children must an elite have for its r*, at least 2.
    on_done : callable, optional
        Told how many more draws of T are done.

    Returns
    -------
    pandas.DataFrame
        In the order of niches: ``niche`` and its label ``index``; ``visits``, births that fell in it, and
        ``births``, those behind its row of T; ``curiosity`` of all elites that it had, and ``entered``, the
        share of their children that entered the archive; ``evolvability`` with ``low`` and ``high``;
        ``wormholes_out`` and ``wormholes_in``, shortcuts that begin and end in it; of its elite
        ``elite_children``, those recorded that did not fail, ``expected_ratio``, r* of them, and
        ``dissimilum``, whether r* is among the lowest tenth. What births do not tell is missing.

    Raises
    ------
    NichechainError
        If an argument is out of range.

    Notes
    -----
    Wormholes are those beyond both displacement and destination, see
    :func:`nichechain.chain.structure.wormholes`. The children of an elite are those that the search
    happened to make, fewer or more of each: :func:`nichechain.landscape.measure_archive` evaluates a
    sample of the same size for all.
    """
    import pandas as pd

    check_at_least(2, children=children)
    question = Question(l, lineages, draws=draws, seed=seed)
    counts = archive.counts
    chain = estimate(counts, estimator)  # type: ignore[arg-type]
    n = len(archive.niches)
    there = np.flatnonzero(counts.visits[:n] > 0)
    frame = pd.DataFrame(
        {
            "niche": there,
            "index": [archive.niches.label(niche) for niche in there.tolist()],
            "visits": counts.visits[there],
            "births": counts.births[there],
        }
    )
    births = archive.births()
    frame = frame.join(_curiosity(births), on="niche")
    if there.size:
        scores = answer_for_niches(chain, question, roots=there, on_done=on_done)
        for name in ("value", "low", "high"):
            frame["evolvability" if name == "value" else name] = getattr(scores, name)[there]
    else:
        frame[["evolvability", "low", "high"]] = np.empty((0, 3))
    frame = frame.join(_wormholes(chain), on="niche")
    return frame.join(_dissimila(archive, births, children), on="niche")


def _curiosity(births: pd.DataFrame) -> pd.DataFrame:
    """Curiosity and share of children that entered, by niche; missing where births do not say who entered."""
    import pandas as pd

    # The parent of such a birth was selected by nobody.
    selected = births if LINEAGE not in births else births[~births[LINEAGE].fillna(value=False).astype(bool)]
    if selected["accepted"].isna().any():
        return pd.DataFrame({"curiosity": [], "entered": []}, dtype=np.float64)
    found = curiosity(selected, by="niche").set_index("niche")
    return pd.DataFrame({"curiosity": found["score"], "entered": found["rate"]})


def _wormholes(chain: NicheChain) -> pd.DataFrame:
    """Wormholes that begin and end in each niche; missing where T has no posterior."""
    import pandas as pd

    niches = pd.RangeIndex(chain.n_niches)
    if chain.posterior is None:
        return pd.DataFrame({"wormholes_out": pd.NA, "wormholes_in": pd.NA}, niches, dtype="Int64")
    found = wormholes(chain, beyond="both")
    flagged = found[found["wormhole"].astype(bool)]
    ends = {"wormholes_out": "parent", "wormholes_in": "child"}
    numbers = {
        name: np.bincount(flagged[end].to_numpy(np.int64), minlength=chain.n_niches)
        for name, end in ends.items()
    }
    return pd.DataFrame(numbers, niches, dtype="Int64")


def _dissimila(archive: Archive, births: pd.DataFrame, fewest: int) -> pd.DataFrame:
    """r* of the recorded children of each niche's elite, and whether it is a dissimilum."""
    import pandas as pd

    elites = archive.elites[np.flatnonzero(archive.elites.niche < len(archive.niches))]
    axes = [f"behavior_{name}" for name in archive.meta.facts.behavior_names]
    there = births["failed"].isna() & births["parent_uid"].isin(elites.uid)
    families = dict(iter(births[there].groupby("parent_uid")[axes]))
    number = np.zeros(len(elites), np.int64)
    ratio, away = np.full((2, len(elites)), np.nan)
    for row, uid in enumerate(elites.uid.tolist()):
        if uid not in families:
            continue
        number[row] = len(families[uid])
        born = families[uid].to_numpy(np.float64)[:_MOST_CHILDREN]
        if number[row] >= fewest:
            away[row] = expected_local_sensitivity(elites.behavior[row], born)
            ratio[row] = dissimila_ratio(expected_evolvability(born), away[row])
    known = np.flatnonzero(~np.isnan(ratio))
    flags = pd.array([pd.NA] * len(elites), "boolean")
    if known.size:
        found = find_dissimila(ratio[known], away[known])
        flags[known] = found.dissimila
        # Where no child differs from its parent, r* says nothing.
        ratio[known[found.neutral]] = np.nan
    columns = {
        "elite_children": pd.array(number, "Int64"),
        "expected_ratio": ratio,
        "dissimilum": flags,
    }
    return pd.DataFrame(columns, index=pd.Index(elites.niche))
