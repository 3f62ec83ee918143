"""The report of searches that are compared: tables, figure, Markdown, HTML and JSON."""

from __future__ import annotations

import io
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from nichechain.core.machine import library_versions
from nichechain.core.parquet import parquet_bytes
from nichechain.core.text import rounded
from nichechain.studies.analysis import plain
from nichechain.studies.document import (
    Bullets,
    Code,
    Document,
    Heading,
    Paragraph,
    Picture,
    Table,
    write_files,
)
from nichechain.studies.searches.comparing import Mean, Worth, compare_selections
from nichechain.studies.searches.study import REFERENCE, SelectionStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORDS, STATISTICS, FIGURE = "records.parquet", "statistics.json", "figure.png"
MARKDOWN, PAGE = "report.md", "report.html"
FILES = (RECORDS, STATISTICS, FIGURE, MARKDOWN, PAGE)
"""What :func:`write_selection_report` writes."""

_FORMAT = 1


def write_selection_report(
    folder: str | Path, study: SelectionStudy, records: pa.Table, *, command: str
) -> tuple[Worth, ...]:
    """Compare the finished searches of a study and write the report, each file atomically.

    Parameters
    ----------
    folder : path
        Where :data:`FILES` go; it is made if need be.
    study : SelectionStudy
    records : pyarrow.Table
        Of :func:`read_searches`.
    command : str
        What made the searches, for the reader to repeat.

    Raises
    ------
    NichechainError
        If no search of uniform parents is finished, or the folder cannot be written to.
    """
    worths = compare_selections(study, records)
    picture = _drawn(_figure(study, worths, records))
    document = compose(study, worths, command)
    statistics = plain(
        {
            "format": _FORMAT,
            "study": study.to_json(),
            "command": command,
            "versions": library_versions(),
            "selections": [asdict(worth) for worth in worths],
        }
    )
    files = {
        RECORDS: parquet_bytes(records),
        FIGURE: picture,
        MARKDOWN: document.markdown().encode(),
        PAGE: document.html({FIGURE: picture}).encode(),
        STATISTICS: (json.dumps(statistics, indent=1, ensure_ascii=False) + "\n").encode(),
    }
    write_files(folder, files)
    return worths


def compose(study: SelectionStudy, worths: tuple[Worth, ...], command: str) -> Document:
    """The report as a document."""
    config = study.config
    cells = " × ".join(map(str, config.shape))
    blocks: list[Any] = [
        Paragraph(
            f"Searches of {config.evaluations} births over {config.domain}, {cells} niches, "
            f"{config.mutation} mutation of scale {config.scale:g}, that differ in how parents are selected. "
            f"Searches of one number share their seed and their first {config.initial} births."
        ),
        Bullets(tuple(sentence(worth) for worth in worths if worth.selection != REFERENCE)),
        Picture(FIGURE, "Niches filled against births: means over searches, and 95 % bands."),
        worth_table(worths),
        Paragraph(
            "Births needed are those for the coverage that the worse of a pair of searches ends with, as a "
            "ratio to those that uniform parents needed: a geometric mean over pairs of one seed, with a "
            "t-interval of the logarithms; p is that of Wilcoxon's signed-rank test. QD score: best "
            "objectives of all filled niches, each above the least of them in any search. Offspring's "
            f"niches: how many niches {study.offspring} fresh offspring of an elite land in, the mean over "
            f"{study.elites} elites of the end."
        ),
        Heading("Are the curious elites the evolvable ones?"),
        Paragraph(
            "The paper asks how curiosity and evolvability are related. This is Spearman's rank correlation "
            "of both over the elites that had at least three children. 5-evolvability is that of their "
            "niches by the chain of the births so far."
        ),
        _curiosity_table(worths),
        Heading("To repeat"),
        Code(command),
    ]
    return Document(f"Selections of parents over {config.domain}", blocks)


def sentence(worth: Worth) -> str:
    """What came of a selection, in words."""
    ratio, runs = worth.births_ratio, worth.runs
    if not runs:
        return f"{worth.selection}: no search is finished yet."
    shown = f"{ratio.value:.2f} of the births"
    if math.isnan(ratio.interval.low):
        return f"{worth.selection} needed {shown} that uniform parents needed, in {runs} pair of searches."
    span = f"95 % interval {ratio.interval.low:.2f} to {ratio.interval.high:.2f}"
    verdict = (
        "fewer than"
        if ratio.interval.high < 1
        else "more than"
        if ratio.interval.low > 1
        else "not told apart from"
    )
    return (
        f"{worth.selection} needed {shown} that uniform parents needed ({span}, {runs} pairs of searches): "
        f"{verdict} uniform."
    )


def worth_table(worths: tuple[Worth, ...]) -> Table:
    """How the selections did, a row each."""
    rows = tuple(
        (
            worth.selection,
            str(worth.runs),
            shown(worth.births_ratio, ".2f") if worth.selection != REFERENCE else "1",
            "" if math.isnan(worth.p) else f"{worth.p:.2g}",
            shown(worth.filled, ".0f"),
            shown(worth.quality),
            shown(worth.offspring_niches, ".2f"),
        )
        for worth in worths
    )
    headings = (
        "selection",
        "searches",
        "births needed",
        "p",
        "niches filled",
        "QD score",
        "offspring's niches",
    )
    return Table("Means over searches with 95 % intervals.", headings, rows)


def _curiosity_table(worths: tuple[Worth, ...]) -> Table:
    shares = sorted({share for worth in worths for share, _ in worth.curiosity})
    rows = []
    for worth in worths:
        found = dict(worth.curiosity)
        rows.append((worth.selection, *(shown(found[s], ".2f") if s in found else "" for s in shares)))
    headings = ("selection", *(f"after {share:.0%} of the births" for share in shares))
    return Table("Rank correlation of curiosity and 5-evolvability.", headings, tuple(rows))


def shown(mean: Mean, form: str | None = None) -> str:
    """A mean and its interval in some format, by default with three digits; nothing where there is none."""

    def text(value: float) -> str:
        return rounded(value) if form is None else f"{value:{form}}"

    if math.isnan(mean.value):
        return ""
    low, high = mean.interval.low, mean.interval.high
    return text(mean.value) + ("" if math.isnan(low) else f" ({text(low)} to {text(high)})")


def _figure(study: SelectionStudy, worths: tuple[Worth, ...], records: pa.Table) -> Figure:
    from matplotlib.figure import Figure

    from nichechain.plots.searches import plot_filled

    figure = Figure(figsize=(7.0, 4.4), layout="constrained")
    there = [worth.selection for worth in worths if worth.runs]
    ax = plot_filled(records.to_pandas(use_threads=False), figure.add_subplot(), selections=there)
    ax.set_title(f"{study.config.domain}, scale {study.config.scale:g}", loc="left", fontsize="medium")
    return figure


def _drawn(figure: Figure) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=130)
    return content.getvalue()
