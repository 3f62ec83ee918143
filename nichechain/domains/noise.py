"""Noise in a domain: what an evaluation draws is a function of its genotype, so φ stays pure.

The behavior of a genotype is then its mean over some repeats; their spread is kept, and is what
noise sensitivity is made of.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_tuple, check_at_least, check_numbers, check_positive, check_text, shown
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Domain, Evaluation, Wrapper, check_genotypes

Floats = NDArray[np.float64]
Seeds = NDArray[np.int64]


@dataclass(frozen=True)
class Noise:
    """Standard deviations of normal noise, 0 for none.

    Parameters
    ----------
    observation : float
        Of what a policy sees, in the units of each observation.
    action : float
        Of what is done: a policy's action before it is clipped, an arm's joint (rad), a gene.
    initial : float
        Of where an episode begins; the domain says what moves.

    Raises
    ------
    NichechainError
        If one is negative or not finite.
    """

    observation: float = 0.0
    action: float = 0.0
    initial: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            check_numbers(**{field.name: value})
            if not (math.isfinite(value) and value >= 0):
                raise NichechainError(f"noise of {field.name} is {value}, but must be a number from 0")

    @classmethod
    def parse(cls, text: str) -> Noise:
        """Noise from text such as ``action:0.1,initial:0.02``.

        Raises
        ------
        NichechainError
            If it is not of this form.
        """
        check_text(noise=text)
        names = [field.name for field in fields(cls)]
        values: dict[str, float] = {}
        for part in text.split(","):
            name, _, value = part.strip().partition(":")
            try:
                values[name] = float(value)
            except ValueError:
                name = ""
            if name not in names:
                raise NichechainError(
                    f"noise is {shown(text)}, "
                    f"but must be like action:0.1,initial:0.02 with {', '.join(names)}"
                )
        return cls(**values)

    def only(self, *names: str, domain: str) -> None:
        """Refuse noise that a domain has no place for.

        Raises
        ------
        NichechainError
            If there is noise other than that of these names.
        """
        for field in fields(self):
            if getattr(self, field.name) and field.name not in names:
                raise NichechainError(
                    f"noise of {field.name} is {getattr(self, field.name)}, "
                    f"but {domain} has only noise of {', '.join(names)}"
                )


@runtime_checkable
class Perturbable(Protocol):
    """A domain that noise can act on; see :class:`Noisy`."""

    def evaluate_noisy(self, genotypes: ArrayLike, noise: Noise, seeds: ArrayLike) -> Evaluation:
        """Behavior of each of N genotypes, each under noise drawn with its seed (N,)."""
        ...


def evaluation_seeds(seed: int, genotypes: ArrayLike, repeats: int) -> Seeds:
    """Seeds of repeated evaluations, a function of the genotype, so that they stay pure.

    Parameters
    ----------
    seed : int
        Seed of the domain.
    genotypes : (N, P) array
        Rounded to float32 before anything else.
    repeats : int

    Returns
    -------
    (N, repeats) int64 array
        Not negative. The first k repeats of n are those of k.

    Notes
    -----
    Each is cut from the SHA-256 of the seed, the number of the repeat and the genotype's bytes:
    equal genotypes share their noise, others are independent.
    """
    rows = np.ascontiguousarray(genotypes, np.float32)
    seeds = np.empty((len(rows), repeats), np.int64)
    for i, row in enumerate(rows):
        # Little-endian bytes on every machine.
        content = hashlib.sha256(row.astype("<f4").tobytes()).digest()
        for repeat in range(repeats):
            digest = hashlib.sha256(b"%d/%d/" % (seed, repeat) + content).digest()
            # 63 bits, for a seed must not be negative.
            seeds[i, repeat] = int.from_bytes(digest[:8], "little") >> 1
    return seeds


def check_seeds(seeds: ArrayLike, rows: NDArray[np.float32]) -> Seeds:
    """One seed for each genotype, as int64.

    Raises
    ------
    NichechainError
        If the number does not fit, or one is negative.
    """
    given = np.asarray(seeds, np.int64)
    if given.shape != (len(rows),) or (given < 0).any():
        raise NichechainError(
            f"seeds have shape {given.shape}, but must be ({len(rows)},), one for each genotype, from 0 on"
        )
    return given


def check_repeats(seeds: ArrayLike, rows: NDArray[np.float32]) -> Seeds:
    """Seeds of one or more repeats for each genotype, (N, R) int64.

    Raises
    ------
    NichechainError
        If the shape does not fit, or one is negative.
    """
    given = np.asarray(seeds, np.int64)
    if given.ndim != 2 or given.shape[0] != len(rows) or not given.shape[1] or (given < 0).any():
        raise NichechainError(
            f"seeds have shape {given.shape}, but must be ({len(rows)}, R) with R at least 1, from 0 on"
        )
    return given


def average(repeats: Sequence[Evaluation]) -> Evaluation:
    """Mean of repeated evaluations of the same genotypes, with the spread of their behaviors.

    Parameters
    ----------
    repeats : sequence of Evaluation
        R of them, each of the same N genotypes.

    Returns
    -------
    Evaluation
        Behavior and objective are means. ``spread`` (N, B) is the standard deviation of behavior
        over repeats, with R − 1 in the denominator; NaN for one repeat. A row fails if one of its
        repeats does.
    """
    count = len(repeats)
    # A mean has more digits than what it is the mean of.
    repeats = [replace(part, behavior=part.behavior.astype(np.float64)) for part in repeats]
    failed = np.logical_or.reduce([part.failed for part in repeats])
    # Python's sum adds one repeat after another, so that a row's bits do not depend on the batch.
    mean = np.asarray(sum(part.behavior for part in repeats) / count)
    objective = np.asarray(sum(part.objective for part in repeats) / count)
    squares = np.asarray(sum((part.behavior - mean) ** 2 for part in repeats))
    spread = np.sqrt(squares / (count - 1)) if count > 1 else np.full_like(mean, np.nan)
    for values in (mean, spread, objective):
        values[failed] = np.nan
    told = zip(*(part.reasons for part in repeats), strict=True)
    reasons = tuple(next((reason for reason in row if reason), "") for row in told)
    return Evaluation(mean, objective, failed, reasons, spread)


def noise_sensitivity(evaluation: Evaluation) -> Floats:
    """How far repeats of an evaluation scatter: √(Σ over axes of the variance of behavior).

    Parameters
    ----------
    evaluation : Evaluation
        Of a :class:`Noisy` domain, or of any that repeats.

    Returns
    -------
    (N,) array
        In units of behavior; NaN where the evaluation failed.

    Raises
    ------
    NichechainError
        If the evaluation has no spread.

    Notes
    -----
    The paper proposes sensitivity to environment noise as a descriptor ("Further work").
    """
    if evaluation.spread is None:
        raise NichechainError("this evaluation has no spread: its domain does not repeat evaluations")
    scatter: Floats = np.sqrt(np.square(evaluation.spread).sum(axis=1))
    return scatter


class Noisy(Wrapper):
    """A domain under noise: behavior is the mean over repeats.

    ``evaluate`` is pure all the same: the noise of a genotype is drawn with seeds that are a
    function of the domain's seed, the number of the repeat and the genotype
    (:func:`evaluation_seeds`). To see what other noise does, give ``seeds``.

    Parameters
    ----------
    domain : Domain
        One that is :class:`Perturbable`, as all of nichechain's are.
    noise : Noise
    repeats : int
        Evaluations of each genotype, at least 1.

    Raises
    ------
    NichechainError
        If noise cannot act on the domain, or there are no repeats.
    """

    def __init__(self, domain: Domain, noise: Noise, *, repeats: int = 5) -> None:
        if not isinstance(domain, Perturbable):
            raise NichechainError(f"noise cannot act on {domain.name}: it has no method evaluate_noisy")
        check_at_least(1, repeats=repeats)
        super().__init__(domain)
        self._perturbable: Perturbable = domain
        self.noise = noise
        self.repeats = int(repeats)

    def __repr__(self) -> str:
        return f"Noisy({self.domain!r}, {self.noise!r}, repeats={self.repeats})"

    def evaluate(self, genotypes: ArrayLike, *, seeds: ArrayLike | None = None) -> Evaluation:
        """Mean behavior and spread of each of N genotypes.

        Parameters
        ----------
        genotypes : (N, P) array
        seeds : (N, R) array of non-negative int, optional
            What the noise of each repeat is drawn with; by default a function of the genotype.

        Raises
        ------
        NichechainError
            If a shape does not fit, or the domain has no such noise.
        """
        rows = check_genotypes(genotypes, self.genotype_length)
        given = evaluation_seeds(self.seed, rows, self.repeats)
        if seeds is not None:
            given = check_repeats(seeds, rows)
        return average([self._perturbable.evaluate_noisy(rows, self.noise, column) for column in given.T])


class WithSensitivity(Wrapper):
    """Noise sensitivity as an axis of behavior: the paper's (meta-)descriptor ("Further work").

    Parameters
    ----------
    domain : Domain
        One whose evaluations have a spread, such as :class:`Noisy` with two repeats or more.
    axes : sequence of str
        Axes of behavior in their order: names of the domain's, and ``sensitivity``.
    most : float, optional
        Upper bound of the axis of sensitivity; by default a quarter of the shortest extent of the
        domain's bounds, beyond which a genotype has no place that it goes to.

    Raises
    ------
    NichechainError
        If the domain does not repeat its evaluations, an axis is unknown or named twice,
        sensitivity is not among them, or ``most`` is not positive.
    """

    SENSITIVITY = "sensitivity"

    def __init__(self, domain: Domain, axes: Sequence[str], most: float | None = None) -> None:
        super().__init__(domain)
        if getattr(domain, "repeats", 1) < 2:
            raise NichechainError(f"sensitivity needs two repeats or more, but {domain!r} makes one")
        axes = as_tuple("axes", axes)
        for axis in axes:
            check_text(**{"one of axes": axis})
        known = (*domain.behavior_names, self.SENSITIVITY)
        if self.SENSITIVITY not in axes or len(set(axes)) < len(axes) or not set(axes) <= set(known):
            raise NichechainError(
                f"axes are {', '.join(axes)}, but must be {self.SENSITIVITY} and some of "
                f"{', '.join(domain.behavior_names)}, each once"
            )
        extents = [high - low for low, high in domain.bounds]
        if most is not None:
            check_positive(most=most)
        self.most = min(extents) / 4 if most is None else float(most)
        self._columns = [known.index(axis) for axis in axes]
        self._axes = tuple(axes)

    def __repr__(self) -> str:
        return f"WithSensitivity({self.domain!r}, {self._axes!r}, most={self.most:g})"

    @property
    def behavior_names(self) -> tuple[str, ...]:
        """The axes, sensitivity among them."""
        return self._axes

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """The domain's, and from 0 to the most for sensitivity."""
        all_bounds = (*self.domain.bounds, (0.0, self.most))
        return tuple(all_bounds[column] for column in self._columns)

    @property
    def start(self) -> Floats | None:
        """Nothing: how sensitive doing nothing is, is not known."""
        return None

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Behavior of each of N genotypes, with its sensitivity."""
        inner = self.domain.evaluate(genotypes)
        behavior = np.column_stack([inner.behavior, noise_sensitivity(inner)])[:, self._columns]
        return Evaluation(behavior, inner.objective, inner.failed, inner.reasons)
