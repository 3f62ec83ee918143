"""Which slices of a genotype belong to the layers of a controller."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from nichechain.core.errors import NichechainError
from nichechain.domains.base import Domain
from nichechain.domains.wrapper import Wrapper


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
