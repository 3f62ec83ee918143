"""Bounds and scales of mutation out of text; errors use the name that the caller gives."""

from __future__ import annotations

from typing import cast

from nichechain.core.checks import StepBound
from nichechain.core.errors import NichechainError
from nichechain.variation.additive import Bound


def parse_step_bound(text: str, name: str = "step_bound") -> tuple[StepBound, float]:
    """``"per-coordinate:2"`` as ``("per-coordinate", 2.0)``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    kind, _, size = text.partition(":")
    try:
        bound = Bound(cast(StepBound, kind), float(size))
    except (ValueError, NichechainError):
        raise NichechainError(
            f"{name} is {text!r}, but must be per-coordinate:SIZE or rescaled:SIZE with a positive "
            "size, such as per-coordinate:2"
        ) from None
    return bound.kind, bound.size


def parse_layer_scales(text: str, name: str = "layer_scales") -> tuple[float, ...]:
    """``"1,0.5,0.5"`` as ``(1.0, 0.5, 0.5)``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    try:
        scales = tuple(float(part) for part in text.split(","))
    except ValueError:
        scales = ()
    if not scales or not all(0 < scale < float("inf") for scale in scales):
        raise NichechainError(
            f"{name} is {text!r}, but must be positive numbers, one per layer, such as 1,0.5,0.5"
        )
    return scales
