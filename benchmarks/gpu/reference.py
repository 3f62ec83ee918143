"""What the GPU is compared with: children of the shipped archive's elites, as the CPU runs them.

    python benchmarks/gpu/reference.py [--episodes 1024]

Writes fetch.mjb.xz and reference.npz beside this file.
"""

import argparse
import copy
import lzma
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import numpy as np
from fetch_model import KINDS, change

import nichechain
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.engine.fetch import _addresses, _make

HERE = Path(__file__).parent
STEPS, SUBSTEPS = 50, 20
parser = argparse.ArgumentParser()
parser.add_argument("--episodes", type=int, default=1024)
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--kinds", default="margin 0,1e-7,float32,grown,one contact")
parser.add_argument("--add", action="store_true", help="only these kinds, to the file that is there")
parser.add_argument("--out", default=str(HERE / "reference.npz"))
arguments = parser.parse_args()
N = arguments.episodes
started = time.time()


def say(*words):
    """Print, with the time since the start."""
    print(f"[{time.time() - started:6.1f} s]", *words, flush=True)


# --- the children, and what nichechain's engine does with them ---
archive = nichechain.load("fetch-pick-and-place")
domain = archive.domain
niches = np.asarray(archive.elites.niche)
if arguments.add:
    saved = dict(np.load(arguments.out))
    final, actions, failed = saved["final"], saved["actions"], saved["failed"]
    engine_seconds = float(saved["engine_seconds"])
    N = len(final)
else:
    genotypes = []
    for i in range(N):
        rng = keyed(13, Purpose.OFFSPRING, i)
        parent = archive.elite(int(niches[rng.integers(len(niches))]))
        genotypes.append(archive.mutate(np.asarray(parent.genotype), rng))
    say(f"{N} children of {len(niches)} elites")

    def engine(i):
        """One child by the engine: where its block ends, its actions, and whether it failed."""
        rollout = domain.episode(genotypes[i])
        return rollout.observations[-1, 3:6], np.clip(rollout.actions, -1, 1), rollout.failure

    with ThreadPoolExecutor(arguments.threads) as pool:
        begun, cpu = time.time(), time.process_time()
        results = list(pool.map(engine, range(N)))
        engine_seconds = time.process_time() - cpu
    final = np.array([r[0] for r in results])
    actions = np.array([r[1] for r in results], np.float32)
    failed = np.array([bool(r[2]) for r in results])
    say(f"engine: {engine_seconds / N * 1e3:.1f} ms of processor an episode; {failed.sum()} failed")

# --- the model and the state after the reset ---
env = _make(domain.env_id)
env.reset(seed=domain.seed)
model, start = env.unwrapped.model, copy.copy(env.unwrapped.data)
assert env.unwrapped.n_substeps == SUBSTEPS
ids, targets = _addresses(model, env.unwrapped._model_names.joint_names)
site, welded = int(ids[1]), int(ids[6])
whole = HERE / "fetch.mjb"
mujoco.mj_saveModel(model, str(whole))
(HERE / "fetch.mjb.xz").write_bytes(lzma.compress(whole.read_bytes(), preset=9))
whole.unlink()
say(
    f"mjb.xz {(HERE / 'fetch.mjb.xz').stat().st_size / 1e6:.1f} MB; nq {model.nq} nv {model.nv} nu {model.nu}"
    f" ngeom {model.ngeom} nmesh {model.nmesh} neq {model.neq}; margins {np.unique(model.geom_margin)}"
    f" gaps {np.unique(model.geom_gap)}; cone {model.opt.cone} solver {model.opt.solver}"
    f" integrator {model.opt.integrator} iterations {model.opt.iterations} flags"
    f" {model.opt.disableflags} {model.opt.enableflags}"
)
# mj_copyData keeps everything, so the copy of the reset's data is the true start.
flat = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
mujoco.mj_getState(model, start, flat, mujoco.mjtState.mjSTATE_INTEGRATION)


def replay(kind, most=None):
    """Final places of the block if the recorded actions are replayed open loop on the CPU."""
    played = copy.copy(model)
    if kind in KINDS:
        change(played, kind)
    rounds = kind == "float32"

    def episode(i):
        data = mujoco.MjData(played)
        mujoco.mj_copyData(data, model, start)
        if kind == "1e-7":
            data.qpos += keyed(13, Purpose.OFFSPRING, 10**6 + i).normal(0, 1e-7, model.nq)
            mujoco.mj_forward(played, data)
        contacts = constraints = 0
        for action in actions[i]:
            step = action[:3] * np.float32(0.05)
            data.mocap_pos[0] = data.xpos[welded] + step.astype(np.float64)
            data.mocap_quat[0] = data.xquat[welded] + (1.0, 0.0, 1.0, 0.0)
            grip = np.float64(action[3])
            for k, target in enumerate(targets):
                data.ctrl[k] = grip if target < 0 else data.qpos[target] + grip
            if most is None and not rounds:
                mujoco.mj_step(played, data, nstep=SUBSTEPS)
                continue
            for _ in range(SUBSTEPS):
                mujoco.mj_step(played, data)
                contacts, constraints = max(contacts, data.ncon), max(constraints, data.nefc)
                if rounds:
                    data.qpos[:] = data.qpos.astype(np.float32)
                    data.qvel[:] = data.qvel.astype(np.float32)
                    data.qacc_warmstart[:] = data.qacc_warmstart.astype(np.float32)
        if most is not None:
            most[i] = contacts, constraints
        return data.site_xpos[site].copy()

    with ThreadPoolExecutor(arguments.threads) as pool:
        cpu = time.process_time()
        places = np.array(list(pool.map(episode, range(N))))
    moved = np.linalg.norm(places - final, axis=1)
    say(
        f"replay {kind!r}: {(time.process_time() - cpu) / N * 1e3:.1f} ms of processor an episode;"
        f" largest distance from the engine's {np.nanmax(moved):.3g} m,"
        f" quartiles {np.nanquantile(moved, [0.25, 0.5, 0.75, 0.9])}"
    )
    return places


saved = {
    "actions": actions,
    "final": final,
    "failed": failed,
    "start": flat,
    "qpos": start.qpos,
    "qvel": start.qvel,
    "mocap_pos": start.mocap_pos,
    "mocap_quat": start.mocap_quat,
    "ctrl": start.ctrl,
    "warmstart": start.qacc_warmstart,
    "site": site,
    "welded": welded,
    "targets": targets,
    "start_place": start.site_xpos[site],
    "bounds": np.array(domain.bounds),
    "engine_seconds": engine_seconds,
}
counts = np.zeros((N, 2), int)
if arguments.add:
    saved = dict(np.load(arguments.out))
else:
    exact = replay("exact", counts)
    equal = (exact == final).all(1)
    say(
        f"the replay has the engine's bits in {equal.sum()} of {N} episodes;"
        f" at most {counts[:, 0].max()} contacts, {counts[:, 1].max()} constraints"
    )
    saved |= {"replayed_equal": equal, "contacts": counts[:, 0], "constraints": counts[:, 1]}
    np.savez_compressed(arguments.out, **saved)
for kind in arguments.kinds.split(","):
    saved["cpu " + kind] = replay(kind)
    np.savez_compressed(arguments.out, **saved)
say(f"{Path(arguments.out).stat().st_size / 1e6:.2f} MB")
