"""Fetch episodes: natively where possible, else by stepping the environment; the same bits."""

from __future__ import annotations

import contextlib
import copy
import io
import logging
import warnings
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.domains.engine.motions import Motions
from nichechain.domains.memory import CACHE_MEMORY
from nichechain.domains.policies.controllers import MLP, Controller

if TYPE_CHECKING:
    import mujoco

_log = logging.getLogger(__name__)

# Warnings after which a state no longer follows from the last by the laws of the model.
_FATAL_WARNINGS = ("CONTACTFULL", "CNSTRFULL", "BADQPOS", "BADQVEL", "BADQACC")


@dataclass(frozen=True)
class Rollout:
    """What a policy saw and did.

    Parameters
    ----------
    observations : (steps + 1, inputs) float64 array
        From the reset to the state after the last action.
    actions : (steps, 4) float32 array
    failure : str
        Why the physics cannot be trusted; empty where it can.
    known : int
        Steps whose physics was known from earlier episodes, so that it was not computed.
    """

    observations: NDArray[np.float64]
    actions: NDArray[np.float32]
    failure: str
    known: int = 0


@dataclass(frozen=True)
class Disturbance:
    """What noise does to one episode; nothing, where it is left out.

    Parameters
    ----------
    observation : (steps, inputs) float64 array, optional
        Added to what the policy sees.
    action : (steps, 4) float32 array, optional
        Added to what the policy does.
    shift : (2,) float64 array, optional
        Moves the block before the episode, metres.
    """

    observation: NDArray[np.float64] | None = None
    action: NDArray[np.float32] | None = None
    shift: NDArray[np.float64] | None = None


UNDISTURBED = Disturbance()


class FetchEpisodes(Protocol):
    """Runs episodes from one reset state."""

    inputs: int
    goal: NDArray[np.float64]

    def run(
        self,
        controller: Controller,
        genotype: NDArray[np.float32],
        steps: int,
        disturbance: Disturbance = UNDISTURBED,
    ) -> Rollout:
        """One episode; safe to call from several threads."""
        ...


def fetch_episodes(
    env_id: str, seed: int, controller: Controller, cache_memory: int = CACHE_MEMORY
) -> FetchEpisodes:
    """The fastest way this machine has to run episodes of a Fetch environment.

    Parameters
    ----------
    env_id : str
        A Fetch environment of gymnasium-robotics.
    seed : int
        Seed of the environment's reset.
    controller : Controller
        What will run: only an :class:`MLP` runs natively.
    cache_memory : int
        Bytes for the cache of motions of native episodes; 0 for none.
    """
    if not isinstance(controller, MLP):
        return SteppedFetch(env_id, seed)
    try:
        return NativeFetch(env_id, seed, cache_memory)
    except (ImportError, OSError, AttributeError, RuntimeError) as error:
        warnings.warn(
            f"episodes are stepped through Gymnasium, which is slower: {error}", RuntimeWarning, stacklevel=2
        )
        return SteppedFetch(env_id, seed)


class SteppedFetch:
    """Episodes through ``env.step``: the reference, and the fallback.

    Parameters
    ----------
    env_id : str
    seed : int
        Seed of the environment's reset.
    """

    def __init__(self, env_id: str, seed: int) -> None:
        self._env_id = env_id
        self._seed = seed
        self._idle = [_make(env_id)]
        first, _ = self._idle[0].reset(seed=seed)
        self.inputs = int(first["observation"].size)
        self.goal = np.array(first["desired_goal"])

    def run(
        self,
        controller: Controller,
        genotype: NDArray[np.float32],
        steps: int,
        disturbance: Disturbance = UNDISTURBED,
    ) -> Rollout:
        """One episode; every thread has an environment of its own."""
        policy = controller.policy(genotype)
        # list.pop and list.append are atomic, so the list is a pool without a lock.
        env = self._idle.pop() if self._idle else _make(self._env_id)
        observation, _ = env.reset(seed=self._seed)
        if disturbance.shift is not None:
            observation = _shifted(env.unwrapped, disturbance.shift)
        observations = [observation["observation"]]
        actions = np.empty((steps, controller.outputs), np.float32)
        for t in range(steps):
            seen = observations[-1]
            if disturbance.observation is not None:
                seen = seen + disturbance.observation[t]
            actions[t] = policy(seen[None])[0]
            if disturbance.action is not None:
                actions[t] += disturbance.action[t]
            observation, *_ = env.step(actions[t])
            observations.append(observation["observation"])
        failure = physics_failure(env.unwrapped.data)
        self._idle.append(env)
        return Rollout(np.array(observations), actions, failure)


class NativeFetch:
    """Episodes as one compiled call each, without the GIL (see :mod:`nichechain.domains.engine.episode`).

    Parameters
    ----------
    env_id : str
    seed : int
        Seed of the environment's reset.
    cache_memory : int
        Bytes for the cache of motions (see :mod:`nichechain.engine.motions`); 0 for none.

    Raises
    ------
    NativeUnavailableError
        If this machine lacks what the engine needs.
    """

    def __init__(self, env_id: str, seed: int, cache_memory: int = CACHE_MEMORY) -> None:
        import mujoco

        from nichechain.domains.engine import episode, libraries

        if not _is_compiled(episode):
            _log.warning("compiling the engine for Fetch episodes, once; it takes about 20 seconds")
        self._run = episode.run
        self._functions = libraries.load().as_array()
        env = _make(env_id)
        observation, _ = env.reset(seed=seed)
        self.inputs = int(observation["observation"].size)
        self.goal = np.array(observation["desired_goal"])
        unwrapped = env.unwrapped
        self._model: mujoco.MjModel = unwrapped.model
        self._start = copy.copy(unwrapped.data)
        self._blocked = bool(unwrapped.block_gripper)
        self._substeps = int(unwrapped.n_substeps)
        self._dt = float(unwrapped.dt)
        self._ids, self._actuator_qpos = _addresses(self._model, unwrapped._model_names.joint_names)
        self._idle: list[mujoco.MjData] = []
        # The parts that the next step reads and does not set itself.
        self._parts = int(mujoco.mjtState.mjSTATE_FULLPHYSICS | mujoco.mjtState.mjSTATE_WARMSTART)
        self._state = mujoco.mj_stateSize(self._model, self._parts) + episode.POSE
        self.motions: Motions | None = None
        if cache_memory:
            with contextlib.suppress(MemoryError):
                self.motions = Motions(
                    cache_memory, observation["observation"], self._state, blocked=self._blocked
                )

    def run(
        self,
        controller: Controller,
        genotype: NDArray[np.float32],
        steps: int,
        disturbance: Disturbance = UNDISTURBED,
    ) -> Rollout:
        """One episode; every thread has an mjData of its own."""
        assert isinstance(controller, MLP)
        import mujoco

        # What noise there was is not in the tree.
        motions = self.motions if disturbance is UNDISTURBED else None
        policy = controller.parameters(genotype), np.array(controller.sizes), controller.activations
        observations = np.empty((steps + 1, self.inputs))
        actions = np.empty((steps, controller.outputs), np.float32)
        codes = np.empty(steps, np.int64)
        snapshot = np.empty(self._state)
        states = np.empty((0 if motions is None else steps, self._state))
        known = 0
        if motions is not None:
            known = motions.walk(policy, observations, actions, codes, snapshot)
        if steps and known == steps:
            # Nothing is kept of an episode with warnings.
            return Rollout(observations, actions, "", known)

        start = self._start if disturbance.shift is None else self._displaced(disturbance.shift)
        # list.pop and list.append are atomic, so the list is a pool without a lock.
        data = self._idle.pop() if self._idle else mujoco.MjData(self._model)
        self._run(
            self._functions,
            self._model._address,
            data._address,
            start._address,
            (
                data.qpos,
                data.qvel,
                data.ctrl,
                data.mocap_pos,
                data.mocap_quat,
                data.xpos,
                data.xquat,
                data.site_xpos,
                data.site_xmat,
            ),
            self._ids,
            self._actuator_qpos,
            self._blocked,
            self._substeps,
            self._dt,
            *policy,
            np.empty((0, self.inputs)) if disturbance.observation is None else disturbance.observation,
            np.empty((0, controller.outputs), np.float32)
            if disturbance.action is None
            else disturbance.action,
            known,
            snapshot,
            self._parts,
            observations,
            actions,
            codes,
            states,
        )
        if motions is not None and not data.warning.number.any():
            motions.insert(known, observations, codes, states)
        failure = physics_failure(data)
        self._idle.append(data)
        return Rollout(observations, actions, failure, known)

    def _displaced(self, shift: NDArray[np.float64]) -> mujoco.MjData:
        """The reset state with the block moved, as the environment's reset would place it."""
        import mujoco

        start = copy.copy(self._start)
        address = int(self._model.joint("object0:joint").qposadr[0])
        start.qpos[address : address + 2] += shift
        mujoco.mj_forward(self._model, start)
        return start


def _is_compiled(episode: ModuleType) -> bool:
    """Whether numba has kept machine code of the episode that is newer than its source."""
    folder = episode.run.stats.cache_path
    kept = [] if folder is None else Path(folder).glob("episode.run-*.nbi")
    source = Path(str(episode.__file__)).stat().st_mtime
    return any(index.stat().st_mtime >= source for index in kept)


def _make(env_id: str) -> Any:
    """The environment, without the checks and limits that its steps do not need."""
    import gymnasium

    # On import it prints a notice about environments of another family.
    with contextlib.redirect_stderr(io.StringIO()):
        import gymnasium_robotics

    gymnasium.register_envs(gymnasium_robotics)
    return gymnasium.make(env_id, disable_env_checker=True)


def _shifted(env: Any, shift: NDArray[np.float64]) -> Any:
    """Move the block of an environment that was just reset; what is observed then."""
    place = env._utils.get_joint_qpos(env.model, env.data, "object0:joint")
    place[:2] += shift
    env._utils.set_joint_qpos(env.model, env.data, "object0:joint", place)
    env._mujoco.mj_forward(env.model, env.data)
    return env._get_obs()


def _addresses(
    model: mujoco.MjModel, joint_names: tuple[str, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The arguments ``ids`` and ``actuator_qpos`` of :func:`nichechain.domains.engine.episode.run`."""
    import mujoco

    def site(name: str) -> int:
        return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name))

    fingers = [model.joint(name).id for name in joint_names if name.startswith("robot")][-2:]
    welds = np.flatnonzero(model.eq_type == mujoco.mjtEq.mjEQ_WELD)
    if model.nmocap != 1 or len(welds) != 1:
        raise RuntimeError("the native engine knows models with one mocap body and one weld")
    first, second = model.eq_obj1id[welds[0]], model.eq_obj2id[welds[0]]
    welded = second if model.body_mocapid[first] != -1 else first
    ids = [
        site("robot0:grip"),
        site("object0"),
        *(model.jnt_dofadr[joint] for joint in fingers),
        *(model.jnt_qposadr[joint] for joint in fingers),
        welded,
    ]
    targets = [
        -1 if bias == 0 else model.jnt_qposadr[joint]
        for bias, joint in zip(model.actuator_biastype, model.actuator_trnid[:, 0], strict=True)
    ]
    return np.array(ids, np.int64), np.array(targets, np.int64)


def physics_failure(data: mujoco.MjData) -> str:
    """Names of MuJoCo's warnings in this episode that make its result meaningless."""
    counts = data.warning.number
    if not counts.any():
        return ""
    import mujoco

    names = [
        name for name in _FATAL_WARNINGS if counts[int(getattr(mujoco.mjtWarning, f"mjWARN_{name}"))] > 0
    ]
    return f"unstable physics ({', '.join(names)})" if names else ""
