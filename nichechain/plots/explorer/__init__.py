"""A page to explore a chain with: click a niche, see where its descendants go.

The page holds everything it shows and asks nothing of any network. What it computes itself it
computes from the posterior mean of T, a *plug-in*; means and intervals over posterior draws are
computed here and shown beside it.
"""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.displacement import GridDisplacement
from nichechain.chain.operator import PooledTransition
from nichechain.chain.structure.graph import LONG_JUMP
from nichechain.chain.structure.wormholes import wormholes
from nichechain.core.errors import NichechainError
from nichechain.core.files import write_atomically
from nichechain.evolvability.coverage import coverage_by_generation
from nichechain.evolvability.question import Question
from nichechain.evolvability.returns import all_return_probabilities
from nichechain.niches import GridNiches

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive
    from nichechain.chain import NicheChain

Floats = NDArray[np.float64]

__all__ = ["LONGEST", "write_explorer"]

LONGEST = 10
"""Generations that the page's slider goes up to."""

# One program in parts: they see each other's names.
_PROGRAM = ("chain.js", "shown.js", "map.js", "panel.js", "page.js")
# Returns are found by products of whole matrices, which take memory and time.
_STATES = 4_000
# Numbers of lineages that intervals are computed for, besides the one asked for.
_LINEAGES = (10, 1000)
_MOST_LINEAGES = 10_000


def write_explorer(
    archive: Archive,
    chain: NicheChain,
    out: Path,
    *,
    l: int = 5,
    lineages: int = 100,
    draws: int = 20,
    seed: int = 0,
) -> None:
    """Write the page, one self-contained HTML file.

    Parameters
    ----------
    archive : Archive
        Of two axes of behavior.
    chain : NicheChain
        Its chain.
    out : Path
        Appears whole or not at all.
    l, lineages : int
        What the page shows first: generations (1 to 10) and lineages U (1 to 10,000).
    draws, seed : int
        Posterior draws of T behind the intervals.

    Raises
    ------
    NichechainError
        If a number is out of range, behavior does not have two axes, or there are too many niches.
    """
    text = explorer_page(archive, chain, l=l, lineages=lineages, draws=draws, seed=seed)
    write_atomically(out, text.encode())


def explorer_page(
    archive: Archive,
    chain: NicheChain,
    *,
    l: int = 5,
    lineages: int = 100,
    draws: int = 20,
    seed: int = 0,
) -> str:
    """The page as text; see :func:`write_explorer`."""
    question = Question(l, lineages, draws=draws, seed=seed)
    if l > LONGEST:
        raise NichechainError(f"l is {l}, but the page goes up to {LONGEST} generations")
    if lineages > _MOST_LINEAGES:
        raise NichechainError(f"lineages is {lineages}, but the page goes up to {_MOST_LINEAGES}")
    axes = len(archive.meta.facts.behavior_names)
    if axes != 2:
        raise NichechainError(f"behavior has {axes} axes, but the page is a map over 2")
    if not isinstance(archive.niches, GridNiches):
        raise NichechainError(f"{archive.folder} has niches of a tessellation, but the page shows a grid")
    if chain.niches != archive.niches:
        raise NichechainError(f"the chain is not over the niches of {archive.folder}")
    if chain.states > _STATES:
        raise NichechainError(f"the chain has {chain.states} states, but a page holds at most {_STATES}")
    content = {
        **_facts(archive, chain),
        **_elites(archive),
        **_transition(chain),
        **_observed(archive, chain),
        **_intervals(chain, question),
    }
    style, program = _text("page.css"), "\n".join(map(_text, _PROGRAM))
    # Within an element, only the sign that could end it has to be written differently.
    data = json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    page = _text("page.html")
    # Data come last, so that no mark is looked for in them.
    for mark, text in (("STYLE", style), ("PROGRAM", program), ("DATA", data)):
        page = page.replace(f"/*{mark}*/", text, 1)
    return page


def _text(name: str) -> str:
    return files(__name__).joinpath(name).read_text(encoding="utf-8")


def _facts(archive: Archive, chain: NicheChain) -> dict[str, Any]:
    facts, niches, counts = archive.meta.facts, archive.niches, archive.counts
    assert isinstance(niches, GridNiches)
    return {
        "name": archive.folder.resolve().name,
        "domain": archive.config.domain,
        "births": archive.meta.births,
        "birthsOutside": counts.births_outside,
        "filled": archive.filled,
        "shape": list(niches.shape),
        "bounds": [list(pair) for pair in niches.bounds],
        "axes": list(facts.behavior_names),
        "unit": facts.unit,
        "objectiveName": facts.objective_name,
        "start": None if facts.start is None else list(facts.start),
        "states": chain.states,
        "niches": chain.n_niches,
        "estimator": chain.estimator,
        "longJump": LONG_JUMP,
        "visits": _packed(counts.visits, np.uint32),
        "children": _packed(counts.births, np.uint32),
    }


def _elites(archive: Archive) -> dict[str, Any]:
    """Of every niche; NaN where there is none."""
    elites = archive.elites
    inside = elites.niche < len(archive.niches)
    found = np.full((5, len(archive.niches)), np.nan)
    found[:, elites.niche[inside]] = [
        elites.objective[inside],
        elites.depth[inside],
        elites.uid[inside],
        *elites.behavior[inside].T,
    ]
    return {"elites": _packed(found, np.float64)}


def rounded_transition(chain: NicheChain) -> PooledTransition:
    """T as the page keeps it: in parts, each rounded to single precision."""
    whole = chain.operator
    if not isinstance(whole, PooledTransition):
        nothing = np.zeros(chain.states)
        whole = PooledTransition.shared(sparse.csr_array(whole), nothing, nothing)
    kept = whole.kept.astype(np.float32).astype(np.float64)
    kept.eliminate_zeros()
    kept.sort_indices()
    displacement = whole.displacement
    if displacement is not None:
        assert isinstance(displacement, GridDisplacement)
        displacement = replace(displacement, kernel=_rounded(displacement.kernel))
    return replace(
        whole,
        kept=kept,
        shares=_rounded(whole.shares),
        pools=_rounded(whole.pools),
        spread=_rounded(whole.spread),
        displacement=displacement,
    )


def _rounded(values: Floats) -> Floats:
    return values.astype(np.float32).astype(np.float64)


def _transition(chain: NicheChain) -> dict[str, Any]:
    T = rounded_transition(chain)
    kernel = T.displacement.kernel if isinstance(T.displacement, GridDisplacement) else np.zeros(0)
    return {
        "rowStart": _packed(T.kept.indptr, np.uint32),
        "column": _packed(T.kept.indices, np.uint16),
        "probability": _packed(T.kept.data, np.float32),
        "shares": _packed(T.shares, np.float32),
        "pools": _packed(T.pools, np.float32),
        "spread": _packed(T.spread, np.float32),
        "kernel": _packed(kernel, np.float32),
        "returns": _packed(all_return_probabilities(T.toarray(), LONGEST - 1), np.float64),
    }


def _observed(archive: Archive, chain: NicheChain) -> dict[str, Any]:
    """Births of every pair of states, and which pairs are wormholes."""
    matrix = archive.counts.matrix.tocsr()
    matrix.sort_indices()
    found: dict[str, Any] = {
        "countStart": _packed(matrix.indptr, np.uint32),
        "countColumn": _packed(matrix.indices, np.uint16),
        "count": _packed(matrix.data, np.uint32),
        "wormholes": None,
    }
    if chain.posterior is not None:
        flagged = wormholes(chain, beyond="both")
        flagged = flagged[flagged["wormhole"]]
        pairs = zip(flagged["parent"], flagged["child"], flagged["exceeds"], strict=True)
        found["wormholes"] = [[int(i), int(j), round(float(p), 4)] for i, j, p in pairs]
    return found


def _intervals(chain: NicheChain, question: Question) -> dict[str, Any]:
    """Mean, 5 % and 95 % quantile over the draws: (3, U, l, niches)."""
    sizes = sorted({*_LINEAGES, question.lineages})
    roots = np.arange(chain.n_niches)
    drawn = [
        coverage_by_generation(matrix, roots, LONGEST, sizes, chain.n_niches).astype(np.float32)
        for matrix in question.transitions(chain)
    ]
    summary = np.stack([np.mean(drawn, axis=0), *np.quantile(drawn, (0.05, 0.95), axis=0, method="weibull")])
    return {
        "l": question.l,
        "lineages": question.lineages,
        "draws": len(drawn) if chain.posterior is not None else 0,
        "sizes": sizes,
        "scores": _packed(summary.transpose(0, 3, 2, 1), np.float32),
    }


def _packed(values: Any, kind: type[np.generic]) -> str:
    """An array as base64, little-endian, which is what every browser's typed arrays are."""
    array = np.ascontiguousarray(values).astype(np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(array.tobytes()).decode("ascii")
