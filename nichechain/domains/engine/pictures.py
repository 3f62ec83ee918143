"""Pictures of a Fetch episode by MuJoCo's own renderer."""

from __future__ import annotations

import contextlib
import io

import numpy as np
from numpy.typing import NDArray

from nichechain.domains.watching import offscreen

SIDE = 360
"""Width and height, pixels."""

# Nearer than the environment's own, and from higher up, so that the table top is seen.
_CAMERA = {"distance": 1.9, "azimuth": 132.0, "elevation": -28.0, "lookat": np.array([1.3, 0.75, 0.48])}


def fetch_pictures(env_id: str, seed: int, actions: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The environment from its reset through some actions (T, 4): (T + 1, SIDE, SIDE, 3).

    Raises
    ------
    NichechainError
        If MuJoCo has no renderer that needs no screen.
    """
    import gymnasium

    # On import it prints a notice about environments of another family.
    with contextlib.redirect_stderr(io.StringIO()):
        import gymnasium_robotics

        gymnasium.register_envs(gymnasium_robotics)
    with offscreen():
        env = gymnasium.make(
            env_id,
            disable_env_checker=True,
            render_mode="rgb_array",
            width=SIDE,
            height=SIDE,
            default_camera_config=_CAMERA,
        )
        env.reset(seed=seed)
        frames = [env.render()]
        for action in actions:
            env.step(action)
            frames.append(env.render())
        env.close()
    return np.stack([np.asarray(frame, np.uint8) for frame in frames])
