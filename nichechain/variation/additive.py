"""Mutation that adds noise to every weight, and the sets that it may be bounded to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, cast, get_args, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import (
    StepBound,
    as_tuple,
    check_choice,
    check_positive,
    check_text,
    check_whole,
    shown,
)
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Domain, Wrapper
from nichechain.variation.noise import IndependentNoise, MutationNoise, truncated

Floats = NDArray[np.float64]
# Of floats of any precision: that of float32 in a search, of others in a test.
Genotype = NDArray[Any]

BOUND_KINDS: tuple[str, ...] = get_args(StepBound)
"""How steps may be bounded: ``per-coordinate`` or ``rescaled``."""
# Shortens a step a little below the bound, so that rounding does not bring it back to it.
_BELOW = 1.0 - 1e-12


class Mutation(Protocol):
    """A mutation operator."""

    def __call__(self, parent: Genotype, rng: np.random.Generator) -> Genotype:
        """One child of a parent (P,), of the same shape and type."""
        ...


@dataclass(frozen=True)
class Bound:
    """The set N(θ) that children of θ belong to.

    Parameters
    ----------
    kind : {"per-coordinate", "rescaled"}
        ``per-coordinate``: the cube of |θᵢ - θ'ᵢ| ≤ c, every coordinate of the noise conditioned on
        it (truncated sampling). ``rescaled``: the open ball |θ - θ'| < c; a longer step is
        shortened to the length c and keeps its direction.
    size : float
        c, positive, in units of a weight whatever the scale of the noise.

    Notes
    -----
    The paper ("Local sensitivity") proposes truncation, "or otherwise enforcing genotypic
    proximity given by |θ - θ'| < c". Rescaling is not truncation: the noise is not conditioned on
    the ball, and what would have left it gathers just inside its surface. Sampling again until a
    step falls inside, which would be, is hopeless for the paper's operator: of 200 standard Cauchy
    steps in 1,952 dimensions the shortest has a norm of about 500. With such noise a rescaled
    step is a random direction of length c, most of it along the few largest coordinates.
    """

    kind: StepBound
    size: float

    def __post_init__(self) -> None:
        check_choice("kind of step bound", self.kind, BOUND_KINDS)
        check_positive(step_bound=self.size)


@dataclass(frozen=True)
class AdditiveMutation:
    """Adds noise to every weight.

    Parameters
    ----------
    noise : MutationNoise
        ``noise(rng, n)`` gives n float64 values at scale 1.
    scale : float
        Factor on the noise, positive.
    bound : Bound, optional
        By default a child can be anywhere the noise reaches.
    layers : tuple of int
        Weights of each layer, in the order of the genotype; with ``layer_scales``.
    layer_scales : tuple of float
        Factor on the scale in each layer, positive.

    Raises
    ------
    NichechainError
        If a scale is not positive, the layers do not match their scales, or noise with dependent
        coordinates is bounded per coordinate.

    Notes
    -----
    The sum is made in float64 and rounded once to the parent's precision. A bounded step is rounded
    towards the parent where rounding would carry it out of N(θ), so children as they are stored
    never leave the set.
    """

    noise: MutationNoise
    scale: float = 1.0
    bound: Bound | None = None
    layers: tuple[int, ...] = ()
    layer_scales: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_positive(scale=self.scale)
        object.__setattr__(self, "layers", as_tuple("layers", self.layers))
        object.__setattr__(self, "layer_scales", as_tuple("layer_scales", self.layer_scales))
        for weights in self.layers:
            check_whole(weights_of_a_layer=weights)
        for scale in self.layer_scales:
            check_positive(layer_scale=scale)
        if len(self.layers) != len(self.layer_scales):
            raise NichechainError(
                f"layer scales are {_listed(self.layer_scales)}, but there are {len(self.layers)} layers "
                f"({_listed(self.layers)} weights): one scale per layer"
            )
        check_bound(self.noise, self.bound)

    def __call__(self, parent: Genotype, rng: np.random.Generator) -> Genotype:
        """One child of a parent (P,), of the same shape and type."""
        return add_noise(parent, rng, self.noise, self._scales(parent.size), self.bound)

    def _scales(self, size: int) -> float | Floats:
        if not self.layers:
            return self.scale
        if sum(self.layers) != size:
            raise NichechainError(
                f"the layers have {_listed(self.layers)} weights, {sum(self.layers)} together, "
                f"but the genotype has {size}"
            )
        return self.scale * np.repeat(self.layer_scales, self.layers)


def check_bound(noise: MutationNoise, bound: Bound | None) -> None:
    """Check that noise can be bounded so.

    Raises
    ------
    NichechainError
        If it cannot.
    """
    if bound is not None and bound.kind == "per-coordinate" and not isinstance(noise, IndependentNoise):
        raise NichechainError(
            "uniform-ball cannot be bounded per coordinate, since its coordinates depend on each "
            "other: it is bounded by its scale already, or by a rescaled step"
        )


def add_noise(
    parent: Genotype,
    rng: np.random.Generator,
    noise: MutationNoise,
    scale: float | Floats,
    bound: Bound | None,
) -> Genotype:
    """One child of a parent.

    Parameters
    ----------
    parent : (P,) float array
    rng : numpy.random.Generator
    noise : MutationNoise
    scale : float or (P,) array
        Factor on the noise.
    bound : Bound, optional

    Returns
    -------
    (P,) array of the parent's type
    """
    if bound is None:
        return (parent + scale * noise(rng, parent.size)).astype(parent.dtype)
    if bound.kind == "per-coordinate":
        assert isinstance(noise, IndependentNoise)
        limit = np.full(parent.size, bound.size)
        step = np.clip(scale * truncated(noise, rng, limit / scale), -limit, limit)
        return _rounded(parent, step, limit)
    step = scale * noise(rng, parent.size)
    child = (parent + step).astype(parent.dtype)
    if np.linalg.norm(child.astype(np.float64) - parent) < bound.size:
        return child
    step *= min(1.0, bound.size * _BELOW / float(np.linalg.norm(step)))
    # No coordinate grows by rounding, so neither does the length.
    return _rounded(parent, step, np.abs(step))


def _rounded(parent: Genotype, step: Floats, limit: Floats) -> Genotype:
    """Parent + step in the parent's precision, no coordinate further from it than the limit."""
    child = (parent + step).astype(parent.dtype)
    beyond = np.abs(child.astype(np.float64) - parent) > limit
    # Rounding to the nearest is off by half a unit in the last place, so one unit back is enough.
    child[beyond] = np.nextafter(child[beyond], parent[beyond])
    return child


def _listed(values: tuple[float, ...]) -> str:
    return ", ".join(f"{value:g}" for value in values) or "none"


@runtime_checkable
class Layered(Protocol):
    """A domain or controller whose genotype is made of layers."""

    @property
    def layers(self) -> tuple[int, ...]:
        """Evolved parameters of each layer, in the order of the genotype."""
        ...


def layers_of(domain: Domain) -> tuple[int, ...]:
    """Evolved parameters of each layer of a domain's controller.

    A domain tells its layers by a property ``layers``, or by a ``network`` that has one, such as
    :class:`nichechain.domains.policies.controllers.MLP`.

    Raises
    ------
    NichechainError
        If it has no layers, or they do not make up its genotype.
    """
    told: object = domain
    while isinstance(told, Wrapper):
        told = told.domain
    if not isinstance(told, Layered):
        told = getattr(told, "network", None)
    if not isinstance(told, Layered):
        raise NichechainError(f"{domain.name} has no layers, so it takes one scale and no layer scales")
    layers = tuple(int(size) for size in told.layers)
    if sum(layers) != domain.genotype_length:
        raise NichechainError(
            f"the layers of {domain.name} have {sum(layers)} parameters together, "
            f"but its genotypes have {domain.genotype_length}"
        )
    return layers


def parse_step_bound(text: str, name: str = "step_bound") -> tuple[StepBound, float]:
    """``"per-coordinate:2"`` as ``("per-coordinate", 2.0)``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    check_text(**{name: text})
    kind, _, size = text.partition(":")
    try:
        bound = Bound(cast(StepBound, kind), float(size))
    except (ValueError, NichechainError):
        raise NichechainError(
            f"{name} is {shown(text)}, but must be per-coordinate:SIZE or rescaled:SIZE with a positive "
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
    check_text(**{name: text})
    try:
        scales = tuple(float(part) for part in text.split(","))
    except ValueError:
        scales = ()
    if not scales or not all(0 < scale < float("inf") for scale in scales):
        raise NichechainError(
            f"{name} is {shown(text)}, but must be positive numbers, one per layer, such as 1,0.5,0.5"
        )
    return scales
