"""A Gymnasium environment that is photographed at every step."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError
from nichechain.domains.watching import offscreen

# What environments that do not say show in a second.
_RATE = 30.0


class Filmed:
    """An environment as an episode uses it; ``frames`` are its pictures from the reset on."""

    def __init__(self, env: Any) -> None:
        self._env = env
        self.unwrapped = env.unwrapped
        self.rate = float(env.metadata.get("render_fps") or _RATE)
        self.frames: list[NDArray[np.uint8]] = []

    def reset(self, **options: Any) -> Any:
        """Begin."""
        answer = self._env.reset(**options)
        self._take()
        return answer

    def step(self, action: Any) -> Any:
        """Act."""
        answer = self._env.step(action)
        self._take()
        return answer

    def _take(self) -> None:
        picture = self._env.render()
        if not (isinstance(picture, np.ndarray) and picture.ndim == 3 and picture.shape[2] == 3):
            raise NichechainError(f"{self._env.spec.id} renders no pictures, so it cannot be watched")
        self.frames.append(picture.astype(np.uint8))


@contextlib.contextmanager
def makes_pictures(env_id: str, env: Any) -> Iterator[None]:
    """Within this an environment may render; what it lacks for that is said in one sentence.

    Parameters
    ----------
    env_id : str
    env : gymnasium.Env or None
        One that is made already, to be asked how it renders.
    """
    import gymnasium

    if env is not None and "rgb_array" not in env.metadata.get("render_modes", ()):
        raise NichechainError(f"{env_id} has no render_mode rgb_array, so it cannot be watched")
    physics = env is not None and hasattr(getattr(env.unwrapped, "data", None), "qpos")
    try:
        with offscreen() if physics else contextlib.nullcontext():
            yield
    except (gymnasium.error.DependencyNotInstalled, ImportError) as error:
        raise NichechainError(f"{env_id} cannot render here: {error}") from error
