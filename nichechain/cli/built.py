"""What ``nichechain build`` tells of what it made, and what to do next."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from nichechain.cli import output
from nichechain.core.text import some
from nichechain.search.config import BuildConfig, parse_selection

if TYPE_CHECKING:
    from rich.console import Console

# Beyond so many niches, only those of the most births are scored; beyond few, with few draws.
_MANY_NICHES = 1000
_SCORED = 200
_FEW_NICHES, _FEW_DRAWS = 500, 20
# Where a first look would take about so many seconds, another command is named instead. What a pair of
# niches takes in the fit of T, and a cubed number of niches in a draw.
_FIRST_LOOK = 2.0
_PAIR, _CUBE = 1.2e-5, 2.7e-10
# Births that a niche must have to be ranked.
_RANKED = 20


def _parents(config: BuildConfig) -> dict[str, str]:
    """From when on the chain steers, which needs births to learn from."""
    if {name for name, _ in parse_selection(config.selection)} <= {"uniform", "curiosity"}:
        return {}
    first = config.initial + config.batch
    return {"parents": f"by {config.selection}; uniformly up to birth {first}, with no child to learn from"}


def report(folder: Path, shown: Console) -> None:
    """A short account of a finished build, and what to do next."""
    import numpy as np
    import pandas as pd

    from nichechain.archive.archive import load
    from nichechain.evolvability.niches import answer_for_niches
    from nichechain.evolvability.question import DRAWS, Question
    from nichechain.search import savings

    archive = load(folder)
    counts = archive.counts
    n = len(archive.niches)
    # A first look, which should keep nobody waiting: only the niches that it may show are scored.
    births_of = counts.births[:n]
    most = np.argsort(-births_of, kind="stable")[: _SCORED if n > _MANY_NICHES else n]
    roots = np.sort(most[births_of[most] >= _RANKED])
    question = Question(draws=DRAWS if n <= _FEW_NICHES else _FEW_DRAWS)
    seconds = _PAIR * counts.matrix.nnz + (question.draws * _CUBE * n**3 if n <= _MANY_NICHES else 0.0)
    ranking = pd.DataFrame()
    if roots.size and seconds <= _FIRST_LOOK:
        chain = archive.chain()
        scores = answer_for_niches(chain, question, roots=roots)
        ranking = scores.ranking(chain, min_births=_RANKED).dropna().head(5)
    failed = archive.meta.births - int(counts.visits.sum())
    births = archive.meta.births
    rows = {
        "niches filled": f"{archive.filled} of {n}",
        "births": f"{births}, {counts.births_outside} of them outside the grid"
        + (f", {failed} failed" if failed else ""),
        "rows of T observed": f"{counts.rows_observed} of {n}",
        **_parents(archive.meta.config),
        **output.physics(savings.read(folder)),
        "archive": str(folder),
    }
    shown.print()
    shown.print(output.facts(rows))
    if len(ranking):
        top = output.table("niche", "niches reached", "90 % interval", "births behind its row")
        for row in ranking.itertuples():
            top.add_row(row.index, f"{row.value:.1f}", f"{row.low:.1f} to {row.high:.1f}", str(row.births))
        shown.print(
            f"\n[bold]Top niches by l-evolvability:[/] how many niches {some(scores.lineages, 'lineage')} of "
            f"{some(scores.l, 'generation')} reach"
        )
        shown.print(top)
    elif roots.size:
        shown.print(f"\n{roots.size} niches have {_RANKED} births behind their row: evolvability ranks them.")
    else:
        shown.print(f"\nNo niche has {_RANKED} births behind its row yet: too few to rank.")
    shown.print("Next:")
    best = f" --niche {ranking['index'].iloc[0]}" if len(ranking) else "" if roots.size else " --min-births 1"
    path = shlex.quote(str(folder))
    for line in (
        f"nichechain evolvability {path}{best}",
        f"nichechain plot {path} reachability --out reachability.png",
        f"nichechain info {path}",
    ):
        shown.print(f"  {line}")


def report_all(folders: Sequence[Path], shown: Console) -> None:
    """A short account of several finished builds, one a line."""
    from nichechain.archive.archive import load

    table = output.table("archive", "niches filled", "births", "outside")
    for archive in map(load, folders):
        births = archive.meta.births
        filled = f"{archive.filled} of {len(archive.niches)}"
        table.add_row(str(archive.folder), filled, str(births), str(archive.counts.births_outside))
    shown.print()
    shown.print(table)
    begin = str(folders[0]).rpartition("-seed")[0]
    pattern, merged = shlex.quote(f"{begin}-seed*"), shlex.quote(begin)
    every = " ".join(shlex.quote(str(folder)) for folder in folders)
    shown.print("Next:")
    shown.print(f"  nichechain compare {pattern} 'OTHERS-seed*'")
    shown.print(f"  nichechain merge {every} --out {merged}")
