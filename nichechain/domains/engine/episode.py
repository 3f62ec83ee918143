"""One closed-loop Fetch episode as a single call without the GIL.

A transcription of ``MujocoFetchEnv`` of gymnasium-robotics (``_set_action``, ``mj_step``,
``_step_callback``, ``generate_mujoco_observations``), operation by operation: the observations
and final positions have its bits. After ``mj_step`` the site positions are one substep older
than the velocities, and the environment mixes the two; so do we.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from nichechain.core.compiled import compiled
from nichechain.domains.engine._call import call
from nichechain.domains.engine.motions import code_of
from nichechain.domains.engine.policy import forward

# Positions in Functions.as_array.
_STEP, _FORWARD, _COPY, _JAC_SITE, _GET_STATE, _SET_STATE = range(6)
_ARCTAN2, _ARCTAN2_DATA, _MATMUL, _MATMUL_DATA = range(6, 10)
# Position and orientation of the welded body end a snapshot.
POSE = 7
# mat2euler of gymnasium-robotics treats a smaller cosine as gimbal lock.
_GIMBAL = np.finfo(np.float64).eps * 4.0


@compiled
def _arctan2(c: Any, y: Any, x: Any, work: Any) -> Any:
    """``np.arctan2(y, x)`` by NumPy's own loop; ``work`` is int64 memory of at least 8 words."""
    values = work[8:11].view(np.float64)
    values[0], values[1] = y, x
    for i in range(3):
        work[i] = values.ctypes.data + 8 * i
        work[4 + i] = 8
    work[3] = 1
    base = work.ctypes.data
    call(c[_ARCTAN2], (base, base + 24, base + 32, c[_ARCTAN2_DATA]))
    return values[2]


@compiled
def _matvec(c: Any, matrix: Any, vector: Any, out: Any, work: Any) -> None:
    """``out[:] = matrix @ vector`` by NumPy's own loop, called as ``ndarray @ ndarray`` calls it."""
    rows, columns = matrix.shape
    work[0] = matrix.ctypes.data
    work[1] = vector.ctypes.data
    work[2] = out.ctypes.data
    # Loop length, then the core dimensions m, n, p of (m, n), (n, p) -> (m, p).
    work[3], work[4], work[5], work[6] = 1, rows, columns, 1
    # Steps between loops, then those of each operand's core axes. For a vector NumPy drops the
    # axis of length p from the signature and passes 0 for its step.
    work[7], work[8], work[9] = 0, 0, 0
    work[10], work[11] = 8 * columns, 8
    work[12], work[13] = 8, 0
    work[14], work[15] = 8, 0
    base = work.ctypes.data
    call(c[_MATMUL], (base, base + 24, base + 56, c[_MATMUL_DATA]))


@compiled
def _euler(c: Any, m: Any, out: Any, work: Any) -> None:
    """``rotations.mat2euler`` of gymnasium-robotics for one matrix, flat in C order."""
    cy = math.sqrt(m[8] * m[8] + m[5] * m[5])
    if cy > _GIMBAL:
        out[2] = -_arctan2(c, m[1], m[0], work)
        out[1] = -_arctan2(c, -m[2], cy, work)
        out[0] = -_arctan2(c, m[5], m[8], work)
    else:
        out[2] = -_arctan2(c, -m[3], m[4], work)
        out[1] = -_arctan2(c, -m[2], cy, work)
        out[0] = 0.0


@compiled
def _observe(
    c: Any, model: Any, data: Any, state: Any, ids: Any, dt: Any, jac: Any, work: Any, out: Any
) -> None:
    """``_get_obs()["observation"]``: 25 numbers with an object, 10 without."""
    qpos, qvel, _, _, _, _, _, site_xpos, site_xmat = state
    grip_site, object_site = ids[0], ids[1]
    right, left = ids[2], ids[3]
    grip = site_xpos[grip_site]
    velocity = np.empty(3)
    call(c[_JAC_SITE], (model, data, jac.ctypes.data, np.int64(0), grip_site))
    _matvec(c, jac, qvel, velocity, work)
    for k in range(3):
        velocity[k] *= dt
    if object_site < 0:
        out[0:3] = grip
        out[3], out[4] = qpos[ids[4]], qpos[ids[5]]
        out[5:8] = velocity
        out[8], out[9] = qvel[right] * dt, qvel[left] * dt
        return
    block = site_xpos[object_site]
    out[0:3] = grip
    out[3:6] = block
    for k in range(3):
        out[6 + k] = block[k] - grip[k]
    out[9], out[10] = qpos[ids[4]], qpos[ids[5]]
    _euler(c, site_xmat[object_site], out[11:14], work)
    call(c[_JAC_SITE], (model, data, jac.ctypes.data, np.int64(0), object_site))
    _matvec(c, jac, qvel, out[14:17], work)
    for k in range(3):
        out[14 + k] = out[14 + k] * dt - velocity[k]
    call(c[_JAC_SITE], (model, data, np.int64(0), jac.ctypes.data, object_site))
    _matvec(c, jac, qvel, out[17:20], work)
    for k in range(3):
        out[17 + k] *= dt
    out[20:23] = velocity
    out[23], out[24] = qvel[right] * dt, qvel[left] * dt


@compiled
def _clip(value: Any) -> Any:
    """``np.clip`` to [-1, 1], as the environment's step does with an action; NaN stays."""
    if value > np.float32(1.0):
        return np.float32(1.0)
    if value < np.float32(-1.0):
        return np.float32(-1.0)
    return value


@compiled
def _act(state: Any, action: Any, actuator_qpos: Any, ids: Any, blocked: Any) -> None:
    """``_set_action``: a displacement of the mocap body, and targets for the fingers."""
    qpos, _, ctrl, mocap_pos, mocap_quat, xpos, xquat, _, _ = state
    welded = ids[6]
    for k in range(3):
        # float32 times a Python float stays float32 in NumPy.
        step = _clip(action[k]) * np.float32(0.05)
        mocap_pos[0, k] = xpos[welded, k] + np.float64(step)
    for k in range(4):
        mocap_quat[0, k] = xquat[welded, k] + (1.0 if k % 2 == 0 else 0.0)
    grip = 0.0 if blocked else np.float64(_clip(action[3]))
    for i in range(actuator_qpos.size):
        ctrl[i] = grip if actuator_qpos[i] < 0 else qpos[actuator_qpos[i]] + grip


@compiled
def _restore(c: Any, model: Any, data: Any, state: Any, ids: Any, parts: Any, snapshot: Any) -> None:
    """What the next action and the steps after it read, as it was when the snapshot was taken."""
    xpos, xquat = state[5][ids[6]], state[6][ids[6]]
    call(c[_SET_STATE], (model, data, snapshot.ctypes.data, parts))
    pose = snapshot[snapshot.size - POSE :]
    xpos[:], xquat[:] = pose[:3], pose[3:]


@compiled
def _snapshot(c: Any, model: Any, data: Any, state: Any, ids: Any, parts: Any, out: Any) -> None:
    """The reverse of :func:`_restore`."""
    call(c[_GET_STATE], (model, data, out.ctypes.data, parts))
    pose = out[out.size - POSE :]
    pose[:3], pose[3:] = state[5][ids[6]], state[6][ids[6]]


@compiled
def run(
    c: Any,
    model: Any,
    data: Any,
    start: Any,
    state: Any,
    ids: Any,
    actuator_qpos: Any,
    blocked: Any,
    substeps: Any,
    dt: Any,
    parameters: Any,
    sizes: Any,
    activations: Any,
    observation_noise: Any,
    action_noise: Any,
    known: Any,
    snapshot: Any,
    parts: Any,
    observations: Any,
    actions: Any,
    codes: Any,
    states: Any,
) -> None:
    """Run one episode from the state ``start``, or the rest of it, writing what was seen and done.

    Parameters
    ----------
    c : (10,) int64
        ``Functions.as_array()``.
    model, data, start : int
        Addresses of the mjModel, of the mjData to use and of the mjData to start from.
    state : tuple of arrays
        Views of ``data``: qpos, qvel, ctrl, mocap_pos, mocap_quat, xpos, xquat, site_xpos,
        site_xmat.
    ids : (7,) int64
        Sites of the grip and of the object (-1: none), degrees of freedom of the last two robot
        joints, their positions in qpos, the body welded to the mocap body.
    actuator_qpos : (actuators,) int64
        Position in qpos that an actuator's target is relative to; -1 for torque.
    blocked : bool
        Whether the fingers are held shut.
    substeps : int
        Physics steps per action.
    dt : float
        Seconds per action.
    parameters, sizes, activations
        The policy, see :func:`nichechain.domains.engine.policy.forward`.
    observation_noise : (steps, inputs) float64
        Added to what the policy sees; (0, inputs) for none.
    action_noise : (steps, outputs) float32
        Added to what the policy does; (0, outputs) for none.
    known : int
        Steps that are known already: their rows of ``observations`` and ``actions`` are there.
    snapshot : (state,) float64
        Where to go on from, if any are: the parts of the state, then the welded body's position and
        orientation.
    parts : int
        Which parts of MuJoCo's state a snapshot holds, a sum of ``mjtState``.
    observations : (steps + 1, inputs) float64
        Written; the last row is what the environment returns after the last step.
    actions : (steps, outputs) float32
        Written.
    codes : (steps,) int64
        Written: :func:`nichechain.engine.motions.code_of` every action, and -1 from the first on
        that has none.
    states : (steps, state) float64
        Written: snapshots after the actions with a code; (0, state) for none.
    """
    call(c[_COPY], (data, model, start))
    jac = np.empty((3, state[1].size))
    work = np.empty(16, np.int64)
    hidden = np.empty((2, sizes.max()), np.float32)
    seen = np.empty(observations.shape[1])
    if known:
        _restore(c, model, data, state, ids, parts, snapshot)
    else:
        _observe(c, model, data, state, ids, dt, jac, work, observations[0])
    recorded = states.shape[0] > 0
    for t in range(known, actions.shape[0]):
        if observation_noise.shape[0]:
            for j in range(seen.size):
                seen[j] = observations[t, j] + observation_noise[t, j]
            forward(parameters, sizes, activations, hidden, seen, actions[t])
        else:
            forward(parameters, sizes, activations, hidden, observations[t], actions[t])
        if action_noise.shape[0]:
            for j in range(actions.shape[1]):
                actions[t, j] += action_noise[t, j]
        _act(state, actions[t], actuator_qpos, ids, blocked)
        for _ in range(substeps):
            call(c[_STEP], (model, data))
        if blocked:
            state[0][ids[4]] = 0.0
            state[0][ids[5]] = 0.0
            call(c[_FORWARD], (model, data))
        _observe(c, model, data, state, ids, dt, jac, work, observations[t + 1])
        codes[t] = code_of(actions[t], blocked) if recorded else -1
        recorded = codes[t] >= 0
        if recorded:
            _snapshot(c, model, data, state, ids, parts, states[t])
