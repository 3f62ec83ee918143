"""Domains by name: nichechain's own, those that other packages bring, and any Gymnasium environment.

Another package adds a domain with an entry point in the group ``nichechain.domains``: its name is
the domain's, and it points to something that is called with ``seed`` and the domain's options.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from nichechain.core.checks import DomainOption, check_text, shown
from nichechain.core.errors import NichechainError
from nichechain.core.suggestions import did_you_mean
from nichechain.domains.arm import PlanarArm
from nichechain.domains.base import Domain
from nichechain.domains.fetch import FetchPickAndPlace, FetchPush, FetchReach, FetchSlide
from nichechain.domains.gym import PREFIX, GymDomain
from nichechain.domains.noise import Noise, Noisy, WithSensitivity
from nichechain.domains.toy import CosinusMap, LinearMap

GROUP = "nichechain.domains"
COMMON_OPTIONS = ("noise", "repeats", "axes", "most_sensitivity")
"""Options that every domain understands, see :func:`make`."""

_BUILT_IN: dict[str, Callable[..., Domain]] = {
    kind.name: kind
    for kind in (
        FetchPickAndPlace,
        FetchPush,
        FetchSlide,
        FetchReach,
        PlanarArm,
        CosinusMap,
        LinearMap,
    )
}


def names() -> tuple[str, ...]:
    """Names of all domains here, sorted; Gymnasium environments, ``gym:ENV_ID``, come on top."""
    return tuple(sorted({*_BUILT_IN, *_entry_points()}))


def make(name: str, *, seed: int = 0, **options: DomainOption) -> Domain:
    """The domain of that name, as the command line knows it.

    Parameters
    ----------
    name : str
        One of :func:`names`, or ``gym:`` and the id of a Gymnasium environment. A name of
        nichechain's own means nichechain's own, whatever is installed.
    seed : int
        Seed of what the domain holds fixed, and of noise.
    **options
        The domain's own, such as ``joints`` of the arm, and for every domain:

        - ``noise``, such as ``"action:0.1,initial:0.02"``: see :class:`Noise`.
        - ``repeats``: evaluations of each genotype, whose mean is its behavior; 5 where there is
          noise.
        - ``axes``, such as ``"x,sensitivity"``: axes of behavior, with sensitivity to noise as one
          of them, and ``most_sensitivity``, its upper bound: see :class:`WithSensitivity`.

    Raises
    ------
    NichechainError
        If there is no such domain, or it has no such option.

    Notes
    -----
    Only the entry point that is asked for is imported.
    """
    factory = _factory(name)
    given: dict[str, Any] = dict(options)
    noise, repeats = given.pop("noise", None), given.pop("repeats", None)
    axes, most = given.pop("axes", None), given.pop("most_sensitivity", None)
    if name.startswith(PREFIX) and noise is None and repeats is not None:
        given["repeats"] = repeats
    _check(name, factory, given)
    try:
        domain = factory(seed=seed, **given)
        if noise is not None:
            domain = Noisy(domain, Noise.parse(str(noise)), repeats=int(5 if repeats is None else repeats))
        elif repeats is not None and "repeats" not in given:
            raise NichechainError(f"repeats is {repeats}, but {name} has nothing random without noise")
        if axes is not None:
            words = [word.strip() for word in str(axes).split(",")]
            domain = WithSensitivity(domain, words, None if most is None else float(most))
    except (TypeError, ValueError) as error:
        if isinstance(error, NichechainError):
            raise
        raise NichechainError(f"options {given} do not fit {name}: {error}") from error
    return domain


def is_proven(name: str) -> bool:
    """Whether it is one of nichechain's own domains, whose tests prove that they are pure."""
    return name in _BUILT_IN


def _entry_points() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}


def _nearby(name: str) -> Iterator[str]:
    """Names that another spelling may have meant."""
    yield from names()
    start, colon, env_id = name.partition(":")
    if colon and start.lower() + colon == PREFIX:
        yield PREFIX + env_id


def _factory(name: str) -> Callable[..., Domain]:
    check_text(domain=name)
    if name in _BUILT_IN:
        return _BUILT_IN[name]
    if name.startswith(PREFIX):
        env_id = name.removeprefix(PREFIX)
        return lambda **options: GymDomain.of_options(env_id, **options)
    points = _entry_points()
    if name not in points:
        raise NichechainError(
            f"domain is {shown(name)}, but must be one of {', '.join(names())}, or {PREFIX}ENV_ID"
            f"{did_you_mean(name, _nearby(name))}"
        )
    try:
        factory: Callable[..., Domain] = points[name].load()
    except Exception as error:
        raise NichechainError(
            f"domain {name} cannot be imported from {points[name].value}: {error}"
        ) from error
    return factory


def _check(name: str, factory: Callable[..., Domain], options: dict[str, Any]) -> None:
    """Refuse options that are not there, with those that are."""
    parameters = inspect.signature(factory).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return
    # How much memory there is is no property of the domain, and changes nothing of it.
    known = [parameter for parameter in parameters if parameter not in ("seed", "cache_memory")]
    for option in options:
        if option not in known:
            raise NichechainError(
                f"{name} has no option {option!r}: it has {', '.join([*known, *COMMON_OPTIONS])}"
            )
