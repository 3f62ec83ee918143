"""Domains: behavior functions from genotypes to behaviors."""

from __future__ import annotations

from collections.abc import Callable

from nichechain.domains.arm import PlanarArm
from nichechain.domains.base import Domain, Evaluation
from nichechain.domains.fetch import FetchPickAndPlace
from nichechain.errors import NichechainError

__all__ = ["Domain", "Evaluation", "FetchPickAndPlace", "PlanarArm", "make"]

_DOMAINS: dict[str, Callable[..., Domain]] = {
    FetchPickAndPlace.name: FetchPickAndPlace,
    PlanarArm.name: PlanarArm,
}


def make(name: str, *, seed: int = 0) -> Domain:
    """The domain of that name, as the command line knows it.

    Raises
    ------
    NichechainError
        If there is none.
    """
    if name not in _DOMAINS:
        raise NichechainError(f"domain is {name!r}, but must be one of {', '.join(sorted(_DOMAINS))}")
    return _DOMAINS[name](seed=seed)
