"""A console that obeys this package's own marks: brackets of a folder or of a stranger's archive are text."""

from __future__ import annotations

import re
from typing import Any

from rich.console import Console
from rich.errors import MarkupError
from rich.text import Text

_MARKS = frozenset(
    f"[{style}]" for style in ("/", "bold", "dim", "red", "yellow", "bold red", "bold yellow", "bold green")
)
# What Rich reads as a mark, and the backslashes before it.
_ANY = re.compile(r"(\\*)(\[[a-z#/@][^[]*?\])")


class MarkedConsole(Console):
    """As Rich's, but only what is in this package's own texts gives them a style."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, emoji=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """A text with its styles; one whose marks do not fit each other has none."""
        try:
            return super().render_str(_ANY.sub(_escaped, text), **options)
        except MarkupError:
            return super().render_str(text, **{**options, "markup": False})


def _escaped(found: re.Match[str]) -> str:
    slashes, mark = found.groups()
    return found[0] if mark in _MARKS and not slashes else f"{2 * slashes}\\{mark}"
