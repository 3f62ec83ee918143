"""What commands write: text and tables on the terminal, JSON, and figures in files."""

from __future__ import annotations

import io
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure
    from rich.console import Console
    from rich.table import Table

    from nichechain.search.savings import Savings

PICTURES = (".png", ".svg", ".pdf")


def console() -> Console:
    """Standard output, with colours only where it is a terminal that wants them."""
    from nichechain.cli.marks import MarkedConsole

    return MarkedConsole(highlight=False, soft_wrap=not sys.stdout.isatty())


def table(*columns: str, title: str | None = None) -> Table:
    """An empty table; columns after the first are right-aligned."""
    from rich import box
    from rich.table import Table

    made = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    for number, column in enumerate(columns):
        made.add_column(column, justify="right" if number else "left")
    return made


def facts(rows: dict[str, str]) -> Table:
    """Names and values, one pair a line."""
    from rich.table import Table

    made = Table.grid(padding=(0, 2))
    made.add_column(style="dim")
    made.add_column(overflow="fold")
    for name, value in rows.items():
        made.add_row(name, value)
    return made


def physics(savings: Savings) -> dict[str, str]:
    """The line on physics that was not computed, where a domain kept count."""
    if not savings.steps:
        return {}
    share = savings.known / savings.steps
    return {"physics spared": f"{share:.0%} of {savings.steps} steps, known from earlier episodes"}


def records(frame: pd.DataFrame, digits: int = 10) -> Any:
    """Rows as JSON can hold them, to so many digits; NaN is null."""
    return json.loads(frame.to_json(orient="records", double_precision=digits))


def check_out(out: Path, endings: tuple[str, ...] = PICTURES) -> None:
    """Refuse a file that could not be written, before anything is computed for it.

    Raises
    ------
    NichechainError
        If it has another ending, is a folder, or lies where nothing can be written.
    """
    if endings and out.suffix.lower() not in endings:
        raise NichechainError(f"--out is {str(out)!r}, but must end in one of {', '.join(endings)}")
    if not out.parent.is_dir():
        raise NichechainError(f"--out is {str(out)!r}, but there is no folder {out.parent}")
    if out.is_dir():
        raise NichechainError(f"--out is {str(out)!r}, but that is a folder, not a file")
    if not os.access(out.parent, os.W_OK):
        raise NichechainError(f"--out is {str(out)!r}, but nothing can be written to {out.parent}")


def new_figure(width: float, height: float, **options: Any) -> Figure:
    """An empty figure, of inches; made directly, not through pyplot, it needs no display."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), **options)


def save_figure(figure: Figure, out: Path, dpi: int = 150) -> None:
    """Write a figure, which appears whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    out : Path
        Its ending says how it is written.
    dpi : int
        Resolution, of a ``.png``.
    """
    from nichechain.core.files import replace_file

    replace_file(out, figure_bytes(figure, out.suffix, dpi))


def figure_bytes(figure: Figure, ending: str, dpi: int) -> bytes:
    """What a file of this ending holds."""
    content = io.BytesIO()
    # A layout of its own keeps to the size asked for.
    trimmed: dict[str, Any] = (
        {} if figure.get_layout_engine() else {"bbox_inches": "tight", "pad_inches": 0.15}
    )
    figure.savefig(content, format=ending[1:].lower(), dpi=dpi, **trimmed)
    return content.getvalue()
