"""Niches out of text; errors use the name that the caller gives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nichechain.core.checks import check_text, shown
from nichechain.core.errors import NichechainError
from nichechain.niches.base import OUTSIDE, Niche


def parse_shape(text: str, name: str = "shape") -> tuple[int, ...]:
    """``"20x20"`` as ``(20, 20)``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    check_text(**{name: text})
    try:
        shape = tuple(int(part) for part in text.lower().split("x"))
    except ValueError:
        shape = ()
    if not shape or min(shape) < 1:
        raise NichechainError(
            f"{name} is {shown(text)}, but must be cells per axis such as 20x20, each at least 1"
        )
    return shape


def parse_bounds(text: str, name: str = "bounds") -> tuple[tuple[float, float], ...]:
    """``"1.05,1.55,0.4,1.1"`` as ``((1.05, 1.55), (0.4, 1.1))``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    check_text(**{name: text})
    try:
        values: Sequence[float] = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    pairs = tuple(zip(values[::2], values[1::2], strict=False))
    finite = all(np.isfinite(values))
    if not values or len(values) % 2 or not finite or any(low >= high for low, high in pairs):
        raise NichechainError(
            f"{name} is {shown(text)}, "
            "but must be X0,X1,Y0,Y1 with X0 < X1 and Y0 < Y1, such as 1.05,1.55,0.4,1.1"
        )
    return pairs


def parse_niche(text: str, name: str = "niche") -> Niche:
    """``"7,11"`` as ``(7, 11)``, ``"151"`` as ``151``, ``"outside"`` as itself.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    check_text(**{name: text})
    if text == OUTSIDE:
        return OUTSIDE
    try:
        index = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise NichechainError(
            f"{name} is {shown(text)}, "
            "but must be a grid index such as 7,11, a number such as 151, or outside"
        ) from None
    return index if len(index) > 1 else index[0]


def parse_niches(text: str, name: str = "niches") -> int:
    """``"cvt:400"`` as 400.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    check_text(**{name: text})
    kind, _, number = text.partition(":")
    if kind != "cvt" or not number.isdecimal() or int(number) < 1:
        raise NichechainError(
            f"{name} is {shown(text)}, but must be cvt and a number of niches such as cvt:400"
        )
    return int(number)
