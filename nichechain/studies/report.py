"""The report of a study: its numbers beside the paper's, as tables, figures, Markdown, HTML and JSON."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from nichechain.core.intervals import LEVEL
from nichechain.core.machine import library_versions, machine
from nichechain.core.parquet import parquet_bytes
from nichechain.studies import findings
from nichechain.studies.analysis import Analysis, analyse, plain, varied
from nichechain.studies.document import write_files
from nichechain.studies.statistics import RESAMPLES
from nichechain.studies.study import Study
from nichechain.studies.wording import compose, title

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORDS, STATISTICS, FIGURE, VECTOR = "records.parquet", "statistics.json", "figure.png", "figure.svg"
MARKDOWN, PAGE = "report.md", "report.html"
FILES = (RECORDS, STATISTICS, FIGURE, VECTOR, MARKDOWN, PAGE)
"""What :func:`write_report` writes."""

_FORMAT = 1
_LIBRARIES = ("scipy", "scikit-posthocs", "statsmodels", "pandas", "matplotlib", "pyarrow")


def write_report(
    folder: str | Path,
    study: Study,
    records: pa.Table,
    *,
    command: str = "",
    unit: str = "",
    resamples: int = RESAMPLES,
) -> Analysis:
    """Analyse the finished runs of a study and write the report, each file atomically.

    Parameters
    ----------
    folder : path
        Where :data:`FILES` go; it is made if need be.
    study : Study
    records : pyarrow.Table
        Of :func:`nichechain.studies.read_records`.
    command : str
        What made the runs, for the reader to repeat.
    unit : str
        Unit of behavior.
    resamples : int
        Of each bootstrap.

    Returns
    -------
    Analysis

    Raises
    ------
    NichechainError
        If no run is finished, the records are not the study's, or the folder cannot be written.

    Notes
    -----
    The same records, study and versions give the same bytes: there is no time of day in them.
    """
    analysis = analyse(study, records, resamples=resamples)
    versions = versions_used()
    figure = _figure(analysis, records, unit)
    picture = _drawn(figure, "png")
    document = compose(analysis, command=command, unit=unit, figure=FIGURE, versions=versions)
    statistics = to_json(analysis, command=command, versions=versions, resamples=resamples)
    files = {
        RECORDS: parquet_bytes(records),
        FIGURE: picture,
        VECTOR: _drawn(figure, "svg"),
        MARKDOWN: document.markdown().encode(),
        PAGE: document.html({FIGURE: picture}).encode(),
        STATISTICS: (json.dumps(statistics, indent=1, ensure_ascii=False) + "\n").encode(),
    }
    write_files(folder, files)
    return analysis


def versions_used() -> dict[str, str]:
    """Versions of the libraries that walks and statistics rest on."""
    from importlib.metadata import version

    return library_versions() | {name: version(name) for name in _LIBRARIES}


def to_json(analysis: Analysis, *, command: str, versions: dict[str, str], resamples: int) -> dict[str, Any]:
    """All numbers of an analysis as plain values for JSON; what is undefined is None."""
    study = analysis.study
    values: dict[str, Any] = plain(
        {
            "format": _FORMAT,
            "study": study.to_json(),
            "command": command,
            "versions": versions,
            "machine": machine(),
            "runs": {"planned": study.runs, "finished": analysis.finished, "share": _share(analysis)},
            "evaluations": {"planned": study.evaluations, "finished": analysis.evaluations},
            "offspring": {"evaluated": analysis.offspring, "failed": analysis.failed},
            "stalls": analysis.stalls,
            "intervals": {"level": LEVEL, "resamples": resamples, "seed": study.seed},
            "summaries": [asdict(summary) for summary in analysis.summaries],
            "tests": [asdict(asked) for asked in analysis.asked],
            "dissimila": None if analysis.dissimila is None else asdict(analysis.dissimila),
            "findings": [asdict(finding) for finding in findings.find(analysis)],
        }
    )
    return values


def _share(analysis: Analysis) -> float:
    planned = analysis.study.runs * len(analysis.study.conditions)
    return sum(analysis.finished.values()) / planned


def _figure(analysis: Analysis, records: pa.Table, unit: str) -> Figure:
    from nichechain.plots.walks import draw_study

    study = analysis.study
    return draw_study(
        records.to_pandas(use_threads=False),
        step=analysis.last,
        conditions=[label for label, n in analysis.finished.items() if n],
        ordered=study.kind == "pressure" or varied(study) is not None,
        main=analysis.main,
        unit=unit,
        title=title(analysis),
    )


def _drawn(figure: Figure, kind: str) -> bytes:
    import matplotlib as mpl

    content = io.BytesIO()
    # An identifier and a date would differ each time.
    with mpl.rc_context({"svg.hashsalt": "nichechain"}):
        figure.savefig(content, format=kind, dpi=130, metadata={"Date": None} if kind == "svg" else {})
    return content.getvalue()
