"""What a genotype does, to be looked at: as pictures by a renderer, or as points that move.

A domain that can be watched has one method more, that of :class:`Watchable`; no other is asked for it.
"""

from __future__ import annotations

import contextlib
import functools
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_floats
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Domain, Wrapper

Floats = NDArray[np.float64]

# Renderers of MuJoCo that need no screen, the faster first.
_BACKENDS = ("egl", "osmesa")
_PROBE = """
import mujoco
renderer = mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16)
renderer.render()
"""
_PATIENCE = 60.0


@dataclass(frozen=True)
class Film:
    """Pictures of an episode.

    Parameters
    ----------
    frames : (T, height, width, 3) uint8 array
        From the start to the end.
    rate : float
        Frames per second.
    """

    frames: NDArray[np.uint8]
    rate: float


@dataclass(frozen=True)
class Motion:
    """Places of an episode in the plane that a map of behavior shows.

    Parameters
    ----------
    tracks : mapping of str to (T, 2) array
        Where some things are, by their names; what behavior is read off comes last.
    limbs : (T, K, 2) array, optional
        Points that a line connects, such as the joints of an arm.
    rate : float
        Moments per second.
    """

    tracks: Mapping[str, Floats]
    limbs: Floats | None
    rate: float

    def __len__(self) -> int:
        return len(next(iter(self.tracks.values())))


@runtime_checkable
class Watchable(Protocol):
    """A domain whose genotypes can be looked at."""

    def watch(self, genotype: ArrayLike, *, drawn: bool = False) -> Film | Motion:
        """What one genotype (genotype_length,) does.

        Parameters
        ----------
        genotype : (genotype_length,) array
        drawn : bool
            Whether to give places, even where pictures could be had.

        Raises
        ------
        NichechainError
            If there is nothing to be seen, or no renderer.
        """
        ...


def watch(domain: Domain, genotype: ArrayLike, *, drawn: bool = False) -> Film | Motion:
    """What a genotype does in a domain, whatever is wrapped around it.

    Raises
    ------
    NichechainError
        If the domain cannot be watched, or has nothing to show.
    """
    while isinstance(domain, Wrapper):
        domain = domain.domain
    if not isinstance(domain, Watchable):
        raise NichechainError(
            f"{domain.name} cannot be watched: its domain has no method watch, "
            "see nichechain.domains.watching.Watchable"
        )
    row = as_floats("genotype", genotype)
    if row.shape != (domain.genotype_length,):
        raise NichechainError(f"genotype has shape {row.shape}, but must be ({domain.genotype_length},)")
    if not np.isfinite(row).all():
        raise NichechainError("genotype is not finite, so there is no episode to watch")
    return domain.watch(row, drawn=drawn)


@functools.cache
def offscreen_backend() -> str | None:
    """The value of MUJOCO_GL with which MuJoCo draws without a screen here; None if there is none.

    A renderer that is missing may end the process that asks for it, so each is tried in one of its own.
    """
    given = os.environ.get("MUJOCO_GL")
    for backend in (given,) if given else _BACKENDS:
        environment = {**os.environ, "MUJOCO_GL": backend}
        environment.pop("PYOPENGL_PLATFORM", None)
        try:
            tried = subprocess.run(  # noqa: S603  # our own words
                [sys.executable, "-c", _PROBE], env=environment, capture_output=True, timeout=_PATIENCE
            )
        except (OSError, subprocess.TimeoutExpired):
            continue
        if tried.returncode == 0:
            return backend
    return None


@contextlib.contextmanager
def offscreen() -> Iterator[None]:
    """MuJoCo draws without a screen within this.

    Raises
    ------
    NichechainError
        If it cannot.
    """
    backend = offscreen_backend()
    if backend is None:
        raise NichechainError(
            "MuJoCo has no renderer here that needs no screen: install EGL or OSMesa "
            "(Debian: libegl1 or libosmesa6), or ask for a drawing"
        )
    before = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = backend
    try:
        yield
    finally:
        if before is None:
            del os.environ["MUJOCO_GL"]
        else:
            os.environ["MUJOCO_GL"] = before
