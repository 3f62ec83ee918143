"""Texts of others, made safe to show."""

from __future__ import annotations

from typing import Any


def printable(text: str) -> str:
    """The text with escapes in place of what does not print.

    A terminal obeys some of that: whoever forges an archive could write over what stands on it.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


def printable_values(values: Any) -> Any:
    """The same of every text in a JSON value, keys included."""
    match values:
        case str():
            return printable(values)
        case list():
            return [printable_values(value) for value in values]
        case dict():
            return {printable(name): printable_values(value) for name, value in values.items()}
        case _:
            return values


def rounded(value: float) -> str:
    """A number with three digits that count, and no power of ten where it is large: ``8,120``."""
    shown = f"{value:.3g}"
    return f"{float(shown):,.0f}" if "e+" in shown else shown


def some(number: int, one: str, more: str | None = None) -> str:
    """A number of things: ``1 niche``, ``2 niches``.

    Parameters
    ----------
    number : int
    one : str
        What one of them is called.
    more : str, optional
        What several are called; by default with an s.
    """
    return f"{number} {one if number == 1 else more or f'{one}s'}"
