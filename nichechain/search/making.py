"""What a configuration asks for: its domain, its niches, its mutation operator."""

from __future__ import annotations

import numpy as np

from nichechain import domains, variation
from nichechain.core.errors import NichechainError
from nichechain.domains import Domain
from nichechain.niches import CVTNiches, GridNiches, Niches
from nichechain.niches.base import Floats
from nichechain.search.config import BuildConfig
from nichechain.variation import AdditiveMutation, Bound, Mutation, SelfAdaptiveDomain, SelfAdaptiveMutation
from nichechain.variation.additive import layers_of


def make_domain(config: BuildConfig) -> Domain:
    """The domain of a build.

    Raises
    ------
    NichechainError
        If there is none of its name here, or it has no such options.
    """
    return domains.make(config.domain, seed=config.domain_seed, **config.domain_options)


def check_niches(config: BuildConfig) -> None:
    """Refuse what :func:`make_niches` would refuse, without making a tessellation.

    Raises
    ------
    NichechainError
        If the configuration's values do not fit together.
    """
    if config.niches == "grid":
        make_niches(config)
    else:
        middle = [[(low + high) / 2.0 for low, high in config.bounds]]
        CVTNiches(np.array(middle), config.bounds, config.outside)


def make_niches(config: BuildConfig, centroids: Floats | None = None) -> Niches:
    """The niches that a configuration asks for.

    Parameters
    ----------
    config : BuildConfig
    centroids : (n, B) array, optional
        Those of a tessellation that was made before; by default they are made from its seed.

    Raises
    ------
    NichechainError
        If the configuration's values, or the centroids, do not fit together.
    """
    if config.niches == "grid":
        return GridNiches(config.shape, config.bounds, config.outside, config.epsilon)
    if centroids is None:
        return CVTNiches.tessellated(
            config.shape[0], config.bounds, seed=config.niches_seed, outside=config.outside
        )
    if len(centroids) != config.shape[0]:
        raise NichechainError(f"there are {len(centroids)} centroids, but must be {config.shape[0]}")
    return CVTNiches(centroids, config.bounds, config.outside)


def make_mutation(config: BuildConfig, domain: Domain) -> tuple[Domain, Mutation]:
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
    layers = layers_of(domain) if config.layer_scales else ()
    bound = None if config.step_bound is None else Bound(*config.step_bound)
    plain = variation.make(config.mutation, config.scale, df=config.df, bound=bound)
    mutate = AdditiveMutation(plain.noise, plain.scale, bound, layers, config.layer_scales)
    if not config.self_adaptive:
        return domain, mutate
    steps = tuple(config.scale * factor for factor in config.layer_scales or (1.0,))
    return (
        SelfAdaptiveDomain(domain, steps),
        SelfAdaptiveMutation(plain.noise, layers or (domain.genotype_length,), bound),
    )
