"""The mutation that a build's configuration asks for, and the domain that it works on."""

from __future__ import annotations

from typing import cast

from nichechain.config import BuildConfig, StepBound
from nichechain.domains.base import Domain
from nichechain.errors import NichechainError
from nichechain.variation.additive import AdditiveMutation, Bound, Mutation
from nichechain.variation.layers import layers_of
from nichechain.variation.self_adaptive import SelfAdaptiveDomain, SelfAdaptiveMutation


def configured(config: BuildConfig, domain: Domain) -> tuple[Domain, Mutation]:
    """Domain and mutation operator of a search.

    Parameters
    ----------
    config : BuildConfig
    domain : Domain
        What the weights are for.

    Returns
    -------
    Domain
        The same, or where mutation is self-adaptive one whose genotypes carry step sizes as well.
    Mutation

    Raises
    ------
    NichechainError
        If there is no such operator, or it does not fit the domain.
    """
    from nichechain.variation import make

    layers = layers_of(domain) if config.layer_scales else ()
    bound = None if config.step_bound is None else Bound(*config.step_bound)
    plain = make(config.mutation, config.scale, df=config.df, bound=bound)
    mutate = AdditiveMutation(plain.noise, plain.scale, bound, layers, config.layer_scales)
    if not config.self_adaptive:
        return domain, mutate
    steps = tuple(config.scale * factor for factor in config.layer_scales or (1.0,))
    return (
        SelfAdaptiveDomain(domain, steps),
        SelfAdaptiveMutation(plain.noise, layers or (domain.genotype_length,), bound),
    )


def parse_step_bound(text: str) -> tuple[StepBound, float]:
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
            f"--step-bound is {text!r}, but must be per-coordinate:SIZE or rescaled:SIZE with a positive "
            "size, such as per-coordinate:2"
        ) from None
    return bound.kind, bound.size


def parse_layer_scales(text: str) -> tuple[float, ...]:
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
            f"--layer-scales is {text!r}, but must be positive numbers, one per layer, such as 1,0.5,0.5"
        )
    return scales
