"""The page as text: what it holds, its style and its program, in one file.

The page asks nothing of any network. Numbers of niches reached, with their intervals, are computed here
for every stop of its sliders. What it computes itself are probabilities of reaching single niches, by the
posterior mean of T.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from nichechain.archive.archive import Archive
from nichechain.chain import NicheChain
from nichechain.chain.structure.graph import LONG_JUMP
from nichechain.core.errors import NichechainError
from nichechain.core.files import as_path, replace_file
from nichechain.evolvability.by_generation import evolvability_table
from nichechain.evolvability.question import DRAWS, MOST_EXACT, Question
from nichechain.niches import GridNiches
from nichechain.plots.cells import voronoi_cells
from nichechain.plots.explorer.packing import in_steps, packed
from nichechain.plots.explorer.past import past
from nichechain.plots.explorer.transitions import LONGEST, observed, transition

# One program in parts: they see each other's names.
_PROGRAM = ("chain.js", "shown.js", "map.js", "arrows.js", "panel.js", "saved.js", "page.js")
# Returns are found by products of whole matrices, which take memory and time.
_STATES = 4_000
# Numbers of lineages that the slider stops at, besides the one asked for.
_LINEAGES = (1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 300, 500, 1000)
_LINEAGES_OF_MANY = (1, 2, 5, 10, 20, 50, 100)
_MOST_LINEAGES = 10_000
_FEW_DRAWS = 6

_FILMS = {".gif": "image/gif", ".png": "image/png", ".mp4": "video/mp4"}
_MOST_FILM_BYTES = 2_000_000


def write_explorer(
    archive: Archive,
    chain: NicheChain,
    out: Path,
    *,
    l: int = 5,
    lineages: int = 100,
    draws: int | None = None,
    seed: int = 0,
    films: Path | None = None,
    beside: tuple[Archive, NicheChain] | None = None,
    on_done: Callable[[int], None] | None = None,
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
    draws : int, optional
        Posterior draws of T behind numbers and intervals; by default 50, and 6 where there are more than
        a thousand states.
    seed : int
        Of the draws.
    films : Path, optional
        Folder with what ``nichechain watch`` made of elites, each file named by its niche, such as
        ``14,14.gif``; PNG and MP4 as well. 2 MB in all.
    beside : (Archive, NicheChain), optional
        A second archive, shown beside the first.
    on_done : callable, optional
        Told how many more draws are done, of both archives together.

    Raises
    ------
    NichechainError
        If a number is out of range, behavior does not have two axes, there are too many niches, or a
        film is of no niche.
    """
    out = as_path("out", out)
    options: dict[str, Any] = {"l": l, "lineages": lineages, "draws": draws, "seed": seed, "on_done": on_done}
    text = explorer_page(archive, chain, films=None if films is None else as_path("films", films), **options)
    if beside is not None:
        kinds = tuple(map(type, beside)) if isinstance(beside, tuple) else ()
        if not (len(kinds) == 2 and issubclass(kinds[0], Archive) and issubclass(kinds[1], NicheChain)):
            raise NichechainError("beside must be an archive and its chain, as a pair")
        pages = [text, explorer_page(*beside, **options)]
        names = " and ".join(one.folder.resolve().name for one in (archive, beside[0]))
        text = _filled_in("beside.html", {"NAMES": _as_data(names), "DATA": _as_data(pages)})
    replace_file(out, text.encode())


def explorer_page(
    archive: Archive,
    chain: NicheChain,
    *,
    l: int = 5,
    lineages: int = 100,
    draws: int | None = None,
    seed: int = 0,
    films: Path | None = None,
    on_done: Callable[[int], None] | None = None,
) -> str:
    """The page as text; see :func:`write_explorer`."""
    question = Question(l, lineages, draws=draws_of(chain) if draws is None else draws, seed=seed)
    if l > LONGEST:
        raise NichechainError(f"l is {l}, but the page goes up to {LONGEST} generations")
    if lineages > _MOST_LINEAGES:
        raise NichechainError(f"lineages is {lineages}, but the page goes up to {_MOST_LINEAGES}")
    check_drawable(archive)
    if chain.niches != archive.niches:
        raise NichechainError(f"the chain is not over the niches of {archive.folder}")
    content = {
        **_facts(archive, chain),
        **_cells(archive),
        **_elites(archive),
        **transition(chain),
        **observed(archive, chain),
        **past(archive),
        **_scores(chain, question, on_done),
        "films": {} if films is None else _films(archive, films),
    }
    program = "\n".join(map(_text, _PROGRAM))
    return _filled_in(
        "page.html", {"STYLE": _text("page.css"), "PROGRAM": program, "DATA": _as_data(content)}
    )


def _as_data(content: Any) -> str:
    # Within an element, only the sign that could end it has to be written differently.
    return json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _filled_in(name: str, marks: dict[str, str]) -> str:
    page = _text(name)
    # Data come last, so that no mark is looked for in them.
    for mark, text in marks.items():
        page = page.replace(f"/*{mark}*/", text, 1)
    return page


def _text(name: str) -> str:
    return files(__package__ or "").joinpath(name).read_text(encoding="utf-8")


def _facts(archive: Archive, chain: NicheChain) -> dict[str, Any]:
    facts, niches, counts = archive.meta.facts, archive.niches, archive.counts
    return {
        "name": archive.folder.resolve().name,
        "domain": archive.config.domain,
        "births": archive.meta.births,
        "birthsSeen": archive.meta.births if archive.steps is None else len(archive.table(["step"])),
        "steps": None if archive.steps is None else list(archive.steps),
        "birthsOutside": counts.births_outside,
        "filled": archive.filled,
        "bounds": [list(pair) for pair in niches.bounds],
        "axes": list(facts.behavior_names),
        "unit": facts.unit,
        "objectiveName": facts.objective_name,
        "start": None if facts.start is None else list(facts.start),
        "states": chain.states,
        "niches": chain.n_niches,
        "estimator": chain.estimator,
        "longJump": LONG_JUMP,
        "visits": packed(counts.visits, np.uint32),
        "children": packed(counts.births, np.uint32),
    }


def _cells(archive: Archive) -> dict[str, Any]:
    """Where niches are: columns and rows of a grid, or corners of every Voronoi cell."""
    niches = archive.niches
    found: dict[str, Any] = {"shape": None, "cornerStart": None, "corners": None}
    if isinstance(niches, GridNiches):
        return {**found, "shape": list(niches.shape), "centers": packed(niches.centers, np.float64)}
    cells = voronoi_cells(niches)
    start = np.concatenate([[0], np.cumsum([len(cell) for cell in cells])])
    return {
        **found,
        "cornerStart": packed(start, np.uint32),
        "corners": packed(np.concatenate(cells), np.float32),
        "centers": packed(niches.centers, np.float64),
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
    return {"elites": packed(found, np.float64), "replacement": archive.config.replacement}


def check_drawable(archive: Archive) -> None:
    """Refuse archives that no page can show, before a chain is estimated.

    Raises
    ------
    NichechainError
        If behavior has not two axes, or there are more than 4,000 states.
    """
    axes = len(archive.meta.facts.behavior_names)
    if axes != 2:
        raise NichechainError(f"behavior has {axes} axes, but the page is a map over 2")
    states = archive.niches.states
    if states > _STATES:
        raise NichechainError(f"the chain has {states} states, but a page holds at most {_STATES}")


def draws_of(chain: NicheChain) -> int:
    """Posterior draws behind a page, where nobody says how many; one where T is given."""
    if chain.posterior is None:
        return 1
    return _FEW_DRAWS if chain.states > MOST_EXACT else DRAWS


def _scores(chain: NicheChain, question: Question, on_done: Callable[[int], None] | None) -> dict[str, Any]:
    """Mean and 90 % interval over the draws at every stop of the sliders: (3, U, l, niches)."""
    simulated = chain.posterior is not None and chain.states > MOST_EXACT
    sizes = sorted({*(_LINEAGES_OF_MANY if simulated else _LINEAGES), question.lineages})
    table = evolvability_table(
        chain, LONGEST, sizes, draws=question.draws, seed=question.seed, on_done=on_done
    )
    scale, steps = in_steps(table)
    return {
        "l": question.l,
        "lineages": question.lineages,
        "draws": question.draws if chain.posterior is not None else 0,
        "simulated": simulated,
        "sizes": sizes,
        "scoreScale": packed(scale, np.float32),
        "scores": packed(steps, np.uint16),
    }


def _films(archive: Archive, folder: Path) -> dict[str, str]:
    """Pictures and films of elites, by the number of the niche, as addresses that hold them."""
    if not folder.is_dir():
        raise NichechainError(f"films is {folder}, but must be a folder of what nichechain watch made")
    labels = {archive.niches.label(niche): niche for niche in range(len(archive.niches))}
    found, size = {}, 0
    for path in sorted(folder.iterdir()):
        kind = _FILMS.get(path.suffix.lower())
        if kind is None:
            continue
        if path.stem not in labels:
            raise NichechainError(
                f"{path} is named after no niche: give a name such as {next(iter(labels))}.gif"
            )
        size += path.stat().st_size
        if size > _MOST_FILM_BYTES:
            raise NichechainError(
                f"{folder} has films of over {_MOST_FILM_BYTES / 1e6:.0f} MB, but a page takes no more"
            )
        found[str(labels[path.stem])] = f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
    return found
