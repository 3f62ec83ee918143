"""Ways to make a first genotype; which start with high evolvability, the paper leaves open."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_sample, rng_of, shown
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Domain
from nichechain.domains.policies.controllers import MLP

if TYPE_CHECKING:
    import torch

Float32s = NDArray[np.float32]

NETWORK_SCHEMES = ("xavier-normal", "xavier-uniform", "kaiming-normal", "kaiming-uniform", "orthogonal")
"""Schemes of ``torch.nn.init`` for a domain whose genotypes are the weights of a fully connected network."""

SCALED_SCHEMES = ("domain", "normal", "uniform")
"""Schemes for any domain, each followed by a factor such as ``normal:0.1``."""


def initialise(domain: Domain, scheme: str, n: int, *, seed: int | np.random.Generator) -> Float32s:
    """First genotypes.

    Parameters
    ----------
    domain : Domain
    scheme : str
        ``domain``: as the domain does it (for Fetch, the paper's Xavier normal); ``domain:S``: that
        times S. ``normal:S``, ``uniform:S``: every weight from N(0, S²) or U(−S, S). One of
        :data:`NETWORK_SCHEMES`: weights by that scheme of ``torch.nn.init``, gain 1, biases 0.
        ``elites:PATH``: elites of that archive, drawn with replacement.
    n : int
    seed : int or numpy.random.Generator

    Returns
    -------
    (n, genotype_length) float32 array
        The first k of n are those that n = k gives.

    Raises
    ------
    NichechainError
        If there is no such scheme, or the domain's genotypes are no network's weights.
    """
    factor = check_scheme(scheme)
    n = check_sample(n, domain.genotype_length)
    rng = rng_of(seed)
    shape = (n, domain.genotype_length)
    kind, _, rest = scheme.partition(":")
    if kind == "elites":
        from nichechain.archive.archive import load

        elites = load(rest).elites.genotype
        if elites.shape[1] != shape[1]:
            raise NichechainError(
                f"elites of {rest} have {elites.shape[1]} parameters, but {domain.name} has {shape[1]}"
            )
        if not len(elites):
            raise NichechainError(f"{rest} has no elites, so no walk can begin with one")
        return elites[rng.integers(len(elites), size=n)]
    if kind == "domain":
        sample = domain.sample(n, seed=rng)
        return sample if factor == 1 else (factor * sample.astype(np.float64)).astype(np.float32)
    if kind == "normal":
        return (factor * rng.standard_normal(shape)).astype(np.float32)
    if kind == "uniform":
        return rng.uniform(-factor, factor, shape).astype(np.float32)
    network = getattr(domain, "network", None)
    if not isinstance(network, MLP):
        raise NichechainError(
            f"initialisation is {shown(scheme)}, but {domain.name} has no fully connected network: "
            f"it must be one of {', '.join(SCALED_SCHEMES)}"
        )
    return _network_weights(network, kind, n, rng)


def check_scheme(scheme: str) -> float:
    """The factor of a scheme, 1 where it has none.

    Raises
    ------
    NichechainError
        If there is no such scheme or the factor is not positive.
    """
    kind, colon, text = str(scheme).partition(":")
    if (kind in NETWORK_SCHEMES and not colon) or (kind == "elites" and text):
        return 1.0
    if kind in SCALED_SCHEMES:
        try:
            factor = float(text) if colon else 1.0
        except ValueError:
            factor = 0.0
        if 0 < factor < np.inf:
            return factor
    raise NichechainError(
        f"initialisation is {shown(scheme)}, but must be one of {', '.join(NETWORK_SCHEMES)}; domain, normal "
        "or uniform with a positive factor such as normal:0.1; or elites:PATH"
    )


def _network_weights(network: MLP, scheme: str, n: int, rng: np.random.Generator) -> Float32s:
    import torch
    from torch.nn import init

    fill: dict[str, Callable[..., Any]] = {
        "xavier-normal": init.xavier_normal_,
        "xavier-uniform": init.xavier_uniform_,
        "kaiming-normal": lambda weight, generator: init.kaiming_normal_(
            weight, nonlinearity="relu", generator=generator
        ),
        "kaiming-uniform": lambda weight, generator: init.kaiming_uniform_(
            weight, nonlinearity="relu", generator=generator
        ),
        "orthogonal": init.orthogonal_,
    }
    generator = torch.Generator().manual_seed(int(rng.integers(2**63)))
    genotypes = np.zeros((n, network.genotype_length), np.float32)
    for row in genotypes:
        start = 0
        for inputs, outputs in zip(network.sizes, network.sizes[1:], strict=False):
            weight: torch.Tensor = torch.empty(outputs, inputs)
            fill[scheme](weight, generator=generator)
            row[start : start + inputs * outputs] = weight.numpy().ravel()
            start += inputs * outputs + (outputs if network.evolve_biases else 0)
    return genotypes
