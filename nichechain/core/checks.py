"""Arguments that are not what they must be, refused where they come in: one sentence, not a traceback."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping
from numbers import Integral, Rational, Real
from typing import TYPE_CHECKING, Literal, TypeAlias, TypeVar

from nichechain.core.errors import NichechainError

DomainOption: TypeAlias = str | int | float | bool
"""What a domain can be told besides its seed."""
Part = TypeVar("Part")
StepBound = Literal["per-coordinate", "rescaled"]
"""How steps of mutation may be bounded."""
EPSILON = 1e-6
"""What pyribs adds to a scaled coordinate of a grid before it rounds down, unless told otherwise."""

if TYPE_CHECKING:
    # A configuration is checked without NumPy, which takes its time to import.
    import numpy as np
    from numpy.typing import ArrayLike, NDArray


_MOST_SHOWN = 80

# 256 GiB of them: what is beyond is a mistyped number.
_MOST_GENES = 2**36


def shown(value: object) -> str:
    """A value as a sentence can have it: on one line, and not all of a large one."""
    text = " ".join(repr(value).split())
    return text if len(text) <= _MOST_SHOWN else f"{text[: _MOST_SHOWN - 3]}..."


def _is_whole(value: object) -> bool:
    """Whether it is a whole number; NumPy has spans of time among its integers."""
    if not isinstance(value, Integral):
        return False
    try:
        operator.index(value)
    except TypeError:
        return False
    return True


def check_whole(**values: object) -> None:
    """Refuse what is no whole number.

    Parameters
    ----------
    **values
        By the names that the caller knows them by; their range is the caller's to check.

    Raises
    ------
    NichechainError
        If a value is of another type: a float is refused even where its value is whole.
    """
    for name, value in values.items():
        if not _is_whole(value):
            raise NichechainError(f"{name} is {shown(value)}, but must be a whole number")


def check_numbers(**values: object) -> None:
    """Refuse what is no number. NaN is one: whether it is allowed is the caller's to check.

    Raises
    ------
    NichechainError
        If a value is neither a float nor a whole number.
    """
    for name, value in values.items():
        # Of fractions, those that NumPy can calculate with.
        if not isinstance(value, Real) or (isinstance(value, Rational) and not _is_whole(value)):
            raise NichechainError(f"{name} is {shown(value)}, but must be a number")


def check_at_least(least: int, **values: object) -> None:
    """Refuse what is no whole number, or too small a one.

    Parameters
    ----------
    least : int
    **values
        By the names that the caller knows them by.

    Raises
    ------
    NichechainError
        If a value is no whole number, or below the least.
    """
    check_whole(**values)
    for name, value in values.items():
        if value < least:  # type: ignore[operator]
            allowed = f"be at least {least}" if least else "not be negative"
            raise NichechainError(f"{name} is {value}, but must {allowed}")


def check_fits(**values: int) -> None:
    """Refuse whole numbers that 64 bits do not hold, which NumPy cannot calculate with.

    Raises
    ------
    NichechainError
        If a value is one.
    """
    for name, value in values.items():
        if not -(2**63) <= value < 2**63:
            raise NichechainError(f"{name} is {shown(value)}, but must be between -2**63 and 2**63 - 1")


def check_sample(n: int, length: int) -> int:
    """How many genotypes of some length are asked for, as a plain number.

    Raises
    ------
    NichechainError
        If it is no whole number, negative, or more than any memory holds.
    """
    check_at_least(0, n=n)
    most = _MOST_GENES // max(1, length)
    if n > most:
        raise NichechainError(f"n is {n}, but must be at most {most} genotypes of {length} genes")
    return int(n)


def check_lineages(offspring: int, **values: object) -> None:
    """Refuse more lineages than there are offspring to begin them.

    Parameters
    ----------
    offspring : int
        How many there are of a genotype.
    **values
        Numbers of lineages by the names that the caller knows them by. None stands for a default, and passes.

    Raises
    ------
    NichechainError
        If a value is no whole number, below 1, or above the number of offspring.
    """
    for name, value in values.items():
        if value is not None:
            check_at_least(1, **{name: value})
            if value > offspring:  # type: ignore[operator]
                raise NichechainError(
                    f"{name} is {value}, but must be at most {offspring}: each begins with a child of its own"
                )


def check_positive(**values: object) -> None:
    """Refuse what is no finite number above 0.

    Raises
    ------
    NichechainError
        If a value is none.
    """
    check_numbers(**values)
    for name, value in values.items():
        if not 0 < value < math.inf:  # type: ignore[operator]
            raise NichechainError(f"{name} is {value}, but must be a positive number")


def check_share(**values: object) -> None:
    """Refuse what is no share of something, of which there is some: above 0 and at most 1.

    Raises
    ------
    NichechainError
        If a value is none.
    """
    check_numbers(**values)
    for name, value in values.items():
        if not 0 < value <= 1:  # type: ignore[operator]
            raise NichechainError(f"{name} is {value}, but must be above 0 and at most 1")


def check_choice(name: str, value: object, allowed: Iterable[str]) -> None:
    """Refuse what is none of some words.

    Raises
    ------
    NichechainError
        If it is none; the message names those that are allowed.
    """
    words = tuple(allowed)
    if not isinstance(value, str) or value not in words:
        raise NichechainError(f"{name} is {shown(value)}, but must be one of {', '.join(words)}")


def check_text(**values: object) -> None:
    """Refuse what is no text.

    Raises
    ------
    NichechainError
        If a value is of another type.
    """
    for name, value in values.items():
        if not isinstance(value, str):
            raise NichechainError(f"{name} is {shown(value)}, but must be a text")


def as_tuple(name: str, values: Iterable[Part]) -> tuple[Part, ...]:
    """What a parameter lists, one by one; what is in it is the caller's to check.

    Raises
    ------
    NichechainError
        If it is no list of anything.
    """
    try:
        return tuple(values)
    except TypeError:
        raise NichechainError(f"{name} is {shown(values)}, but must be a sequence") from None


def check_seed(seed: object) -> None:
    """Refuse what cannot seed a generator.

    Raises
    ------
    NichechainError
        If it is no whole number, or a negative one.
    """
    # First what is nearly always so: every child has a generator.
    if type(seed) is not int or seed < 0:
        check_at_least(0, seed=seed)


def rng_of(seed: int | np.random.Generator) -> np.random.Generator:
    """The generator itself, or the one of a seed.

    Raises
    ------
    NichechainError
        If the seed is negative or no whole number.
    """
    import numpy as np

    if isinstance(seed, np.random.Generator):
        return seed
    check_seed(seed)
    return np.random.default_rng(seed)


def as_floats(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Values as a float64 array of any shape.

    Raises
    ------
    NichechainError
        If they are no numbers, or rows of unequal length.
    """
    import numpy as np

    try:
        given = np.asarray(values)
        if given.dtype.kind == "c":
            # NumPy would drop the imaginary parts with a warning.
            raise TypeError
        return given.astype(np.float64, copy=False)
    except (OverflowError, TypeError, ValueError):
        raise NichechainError(f"{name} has values that are no numbers, or rows of unequal length") from None


def as_whole(name: str, values: ArrayLike) -> NDArray[np.int64]:
    """Values as an int64 array of any shape.

    Raises
    ------
    NichechainError
        If they are not whole numbers, which a cast would silently cut, or rows of unequal length.
    """
    import numpy as np

    try:
        given = np.asarray(values)
        if given.dtype.kind == "c":
            raise TypeError
        with np.errstate(invalid="ignore"):
            whole = given.astype(np.int64)
    except (TypeError, ValueError, OverflowError):
        raise NichechainError(
            f"{name} has values that are no whole numbers, or rows of unequal length"
        ) from None
    if given.dtype.kind == "u" and (given > np.iinfo(np.int64).max).any():
        raise NichechainError(f"{name} has the value {given.max()}, but must be below 2**63")
    if given.dtype.kind not in "iub" and not np.array_equal(given.astype(np.float64), whole):
        odd = given.ravel()[given.astype(np.float64).ravel() != whole.ravel()]
        raise NichechainError(f"{name} has the value {odd[0]}, but must have whole numbers")
    return whole


def as_shape(shape: object) -> tuple[int, ...]:
    """Cells along each axis of a grid, as whole numbers.

    Raises
    ------
    NichechainError
        If it is no sequence of them.
    """
    try:
        return tuple(operator.index(cells) for cells in shape)  # type: ignore[attr-defined]
    except TypeError:
        raise NichechainError(
            f"shape is {shown(shape)}, but must be whole numbers such as (20, 20)"
        ) from None


def as_bounds(bounds: object) -> tuple[tuple[float, float], ...]:
    """Lower and upper bound of each axis of behavior, as floats.

    Raises
    ------
    NichechainError
        If it is no sequence of pairs of numbers.
    """
    try:
        return tuple((float(low), float(high)) for low, high in bounds)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise NichechainError(
            f"bounds are {shown(bounds)}, "
            "but must be a pair of numbers for each axis, such as ((0, 1), (0, 1))"
        ) from None


def plain_options(options: Mapping[str, DomainOption]) -> dict[str, DomainOption]:
    """Options in the order of their names, so that equal ones are written alike."""
    if not isinstance(options, Mapping):
        raise NichechainError(f"domain_options is {shown(options)}, but must map names to values")
    for name, value in options.items():
        fits = isinstance(value, (str, int)) or (isinstance(value, float) and math.isfinite(value))
        if not isinstance(name, str) or not fits:
            raise NichechainError(
                f"domain option {name!r} is {shown(value)}, "
                "but must be a text, a finite number, or true or false"
            )
    return {name: options[name] for name in sorted(options)}
