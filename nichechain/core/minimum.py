"""The least value of a function of one variable, without the fifth of a second that scipy.optimize loads."""

from __future__ import annotations

from collections.abc import Callable

_GOLDEN = 0.3819660112501051
_TOLERANCE = 1e-6
_MOST_STEPS = 100


def minimum(value: Callable[[float], float], low: float, high: float) -> float:
    """Where a function with one valley between two bounds is least, to about 1e-6.

    Parameters
    ----------
    value : callable
    low, high : float

    Returns
    -------
    float

    Notes
    -----
    Brent (1973): the vertex of the parabola through the three best points so far, as long as these steps
    shrink, and otherwise a golden section of the larger part.
    """
    best = second = third = low + _GOLDEN * (high - low)
    least = next_least = third_least = value(best)
    step = before = 0.0
    for _ in range(_MOST_STEPS):
        middle = 0.5 * (low + high)
        if abs(best - middle) + 0.5 * (high - low) <= 2.0 * _TOLERANCE:
            break
        to_second, to_third = best - second, best - third
        a, b = to_second * (least - third_least), to_third * (least - next_least)
        across = 2.0 * (b - a)
        last, before = before, step
        # Without three different points there is no parabola.
        step = (to_second * a - to_third * b) / across if across else 0.0
        if not (0.0 < abs(step) < 0.5 * abs(last) and low < best + step < high):
            before = (low if best >= middle else high) - best
            step = _GOLDEN * before
        elif min(best + step - low, high - best - step) < 2.0 * _TOLERANCE:
            step = _TOLERANCE if best < middle else -_TOLERANCE
        # Closer than that, values differ by rounding alone.
        if abs(step) < _TOLERANCE:
            step = _TOLERANCE if step > 0 else -_TOLERANCE
        tried = best + step
        found = value(tried)
        if found <= least:
            low, high = (best, high) if tried >= best else (low, best)
            third, third_least = second, next_least
            second, next_least = best, least
            best, least = tried, found
            continue
        low, high = (tried, high) if tried < best else (low, tried)
        if found <= next_least or second == best:
            third, third_least = second, next_least
            second, next_least = tried, found
        elif found <= third_least or third in (best, second):
            third, third_least = tried, found
    return best
