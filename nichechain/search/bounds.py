"""Bounds that behaviors do not fit: the commonest mistake of a first build, said while it can be mended."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_LOOKED_AT = 1000
_TOO_MANY = 0.5
_HELD = 0.99


def bounds_holding(behavior: Floats, share: float = _HELD) -> tuple[tuple[float, float], ...]:
    """Bounds along each axis that hold at least this share of behaviors (N, B), which are finite."""
    margin = (1.0 - share) / 2.0 / behavior.shape[1]
    low = np.quantile(behavior, margin, axis=0, method="lower")
    high = np.quantile(behavior, 1.0 - margin, axis=0, method="higher")
    return tuple((float(a), float(b)) for a, b in zip(low, high, strict=True))


def outside_note(behavior: Floats, outside: int) -> str | None:
    """A sentence where too many behaviors (N, B) lie outside: where they fell, and what would hold them."""
    if not len(behavior) or outside <= _TOO_MANY * len(behavior):
        return None
    spans = ", ".join(f"{low:.3g} to {high:.3g}" for low, high in bounds_holding(behavior))
    return (
        f"{outside} of {len(behavior)} births fell outside the bounds; "
        f"bounds of {spans} would hold {_HELD:.0%} of them"
    )


class FirstLook:
    """Looks at the first thousand births, and says once what is wrong with their bounds."""

    def __init__(self, state: int, births: int = 0) -> None:
        self._state = state
        self._births = births
        self._behavior: list[Floats] = []
        self._outside = 0

    def tell(self, behavior: Floats, niche: NDArray[np.integer], *, last: bool) -> str | None:
        """What some more births show; a sentence at the thousandth, or at the last if there are fewer."""
        if self._births >= _LOOKED_AT:
            return None
        self._births += len(behavior)
        fine = np.isfinite(behavior).all(axis=1)
        self._behavior.append(behavior[fine])
        self._outside += int((niche == self._state).sum())
        if self._births < _LOOKED_AT and not last:
            return None
        self._births = _LOOKED_AT
        return outside_note(np.concatenate(self._behavior), self._outside)
