"""MuJoCo Warp on the Fetch model: episodes a second, and how far blocks end from where the CPU puts them.

    python benchmarks/gpu/replay.py [--device cuda:0] [--worlds 1024,2048,4096,8192,16384] [--limit 200]

Reads fetch.mjb.xz and reference.npz beside this file (see reference.py), replays the recorded
actions open loop, and writes gpu.json to --out after every part. A part that fails prints its
traceback, and the next one begins. No part begins after the time limit.
"""

import argparse
import functools
import json
import lzma
import os
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path

import mujoco
import numpy as np
from fetch_model import KINDS, change

HERE = Path(__file__).parent
parser = argparse.ArgumentParser()
parser.add_argument("--device", default="cuda:0")
parser.add_argument("--worlds", default="1024,2048,4096,8192,16384")
parser.add_argument("--limit", type=float, default=200.0, help="seconds, all parts together")
parser.add_argument("--steps", type=int, default=50, help="control steps of an episode; fewer only for tests")
parser.add_argument("--substeps", type=int, default=20)
parser.add_argument("--rollouts", type=int, default=2, help="measured ones, after a short warm-up")
parser.add_argument("--nconmax", type=int, default=0, help="contacts a world, on average; 0: by the CPU's")
parser.add_argument("--njmax", type=int, default=0, help="constraints a world; 0: by the CPU's")
parser.add_argument("--workers", type=int, default=12, help="threads that compile kernels; 0: as they come")
parser.add_argument("--mjx", action="store_true", help="only the part of MJX, in this process")
parser.add_argument("--no-mjx", action="store_true")
parser.add_argument("--out", default=".")
arguments = parser.parse_args()
STARTED = time.time()
DEADLINE = STARTED + arguments.limit
OUT = Path(arguments.out)
FILE = OUT / ("mjx.json" if arguments.mjx else "gpu.json")
STEPS, SUBSTEPS = arguments.steps, arguments.substeps
WHOLE = STEPS == 50 and SUBSTEPS == 20
with np.load(HERE / "reference.npz") as file:
    REFERENCE = dict(file)
SITE, WELDED = int(REFERENCE["site"]), int(REFERENCE["welded"])
# The slowest rollouts are cut short here, and their time is extrapolated.
LATEST = DEADLINE + 30
report = {"versions": {"mujoco": mujoco.__version__}}


def say(*words):
    """Print, with the time since the start."""
    print(f"[{time.time() - STARTED:6.1f} s]", *words, flush=True)


def keep():
    """Write what there is so far."""
    OUT.mkdir(parents=True, exist_ok=True)
    FILE.write_text(json.dumps(report, indent=1))


def part(name, function, *args):
    """Run one part, unless time is up; a failure is kept and told, no more."""
    if time.time() > DEADLINE:
        report[name] = {"skipped": "no time was left"}
        say(name, "skipped: no time was left")
    else:
        say(name, "begins")
        try:
            report[name] = function(*args)
            say(name, json.dumps(report[name])[:700])
        except BaseException as error:
            traceback.print_exc(file=sys.stdout)
            report[name] = {"error": f"{type(error).__name__}: {error}"[:2000]}
            say(name, "failed:", report[name]["error"][:300])
            if isinstance(error, KeyboardInterrupt):
                raise
    keep()


# --- the model in the two forms that MuJoCo Warp takes ---


def model(kind):
    """The model as it was stored."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fetch.mjb"
        file.write_bytes(lzma.decompress((HERE / "fetch.mjb.xz").read_bytes()))
        loaded = mujoco.MjModel.from_binary_path(str(file))
    change(loaded, kind)
    return loaded


def start(loaded):
    """The state that episodes begin in."""
    data = mujoco.MjData(loaded)
    part_of_state = mujoco.mjtState.mjSTATE_INTEGRATION
    mujoco.mj_setState(loaded, data, REFERENCE["start"], part_of_state)
    mujoco.mj_forward(loaded, data)
    mujoco.mj_setState(loaded, data, REFERENCE["start"], part_of_state)
    return data


# --- how far two sets of final places are apart ---


def niches(places):
    """Niche of the 20 by 20 grid; 400 is outside, 401 is no number."""
    low, high = REFERENCE["bounds"].T
    finite = np.isfinite(places).all(1)
    cells = np.floor((np.where(finite[:, None], places, 0)[:, :2] - low) / (high - low) * 20).astype(int)
    inside = ((cells >= 0) & (cells < 20)).all(1)
    return np.where(finite, np.where(inside, cells[:, 0] * 20 + cells[:, 1], 400), 401)


def histogram(cells):
    """Share of episodes in each niche, outside and failed."""
    return np.bincount(cells, minlength=402) / len(cells)


def chance(one, other, draws=200):
    """Total variation of two histograms of one law: half the episodes of each, exchanged at random."""
    rng = np.random.default_rng(0)
    swap = rng.random((draws, len(one))) < 0.5
    return np.array(
        [
            0.5 * np.abs(histogram(np.where(s, one, other)) - histogram(np.where(s, other, one))).sum()
            for s in swap
        ]
    )


def quantiles(values):
    """How far blocks end apart."""
    return {
        str(q): float(np.quantile(values, q)) for q in (0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 1) if len(values)
    }


def compare(places, other):
    """Distances of paired final places, and what they do to niches."""
    distance = np.linalg.norm(places - other, axis=1)
    # What falls off the table is far apart in height within a moment; behavior is x and y.
    flat = np.linalg.norm((places - other)[:, :2], axis=1)
    finite = np.isfinite(distance)
    moved = finite & (np.linalg.norm(other - REFERENCE["start_place"], axis=1) > 0.01)
    one, two = niches(places), niches(other)
    swapped = chance(one, two)
    edges = 10.0 ** np.arange(-9, 1)
    return {
        "episodes": len(places),
        "not finite": int((~finite).sum()),
        "moved over 1 cm": int(moved.sum()),
        "distance m, quantiles": quantiles(distance[finite]),
        "of those moved": quantiles(distance[moved]),
        "distance in x and y m, quantiles": quantiles(flat[finite]),
        "in x and y, of those moved": quantiles(flat[moved]),
        "distance under 1e-9..1 m": [int((distance < e).sum()) for e in edges],
        "same niche": float((one == two).mean()),
        "same niche, of those moved": float((one == two)[moved].mean()) if moved.any() else None,
        "niches": [len(np.unique(one)), len(np.unique(two))],
        "total variation of niches": float(0.5 * np.abs(histogram(one) - histogram(two)).sum()),
        "total variation if pairs are swapped at random, mean and 95 %": [
            float(swapped.mean()),
            float(np.quantile(swapped, 0.95)),
        ],
        "outside": [int((one == 400).sum()), int((two == 400).sum())],
    }


def compare_all(places):
    """With the CPU's final places of the true model and of the model in each form."""
    n = len(places)
    found = {"cpu": compare(places, REFERENCE["final"][:n])}
    for name in KINDS:
        if f"cpu {name}" in REFERENCE:
            found[f"cpu {name}"] = compare(places, REFERENCE[f"cpu {name}"][:n])
    return found


def yardsticks():
    """The CPU against itself: disturbed a little, rounded to float32, or with the changed model."""
    final = REFERENCE["final"]
    found = {
        name: compare(REFERENCE[name], final)
        for name in ("cpu 1e-7", "cpu float32", *(f"cpu {kind}" for kind in KINDS))
        if name in REFERENCE
    }
    rng = np.random.default_rng(1)
    order = rng.permutation(len(final))
    halves = niches(final[order[: len(final) // 2]]), niches(final[order[len(final) // 2 :]])
    found["total variation of two halves of the CPU's"] = float(
        0.5 * np.abs(histogram(halves[0]) - histogram(halves[1])).sum()
    )
    return found


# --- MuJoCo Warp ---


def compile_kernels(device, step):
    """Compile what a step launches, side by side; one after the other takes minutes.

    The step is gone through once with launches that only note which module they would need.
    """
    from concurrent.futures import ThreadPoolExecutor

    import warp as wp
    from warp._src.context import _resolve_launch_block_dim

    wanted = {}

    def note(kernel, dim=1, *_, block_dim=None, **__):
        if np.prod(dim) and not kernel.is_generic:
            wanted[kernel.module, _resolve_launch_block_dim(device, block_dim)] = kernel.module.name

    real = wp.launch, wp.launch_tiled, wp.capture_while, wp.capture_if
    wp.launch = wp.launch_tiled = note
    wp.capture_while = lambda condition, while_body, stream=None, **kwargs: while_body(**kwargs)  # noqa: ARG005
    wp.capture_if = lambda condition, on_true=None, on_false=None, stream=None, **kwargs: (  # noqa: ARG005
        on_true and on_true(**kwargs)
    )
    try:
        step()
    finally:
        wp.launch, wp.launch_tiled, wp.capture_while, wp.capture_if = real
    begun = time.time()
    took = {}

    def load(module, block_dim):
        here = time.time()
        module.load(device, block_dim)
        took[f"{module.name.split('.')[-1][:40]} {block_dim}"] = round(time.time() - here, 1)

    with ThreadPoolExecutor(arguments.workers) as pool:
        for future in [pool.submit(load, *key) for key in wanted]:
            future.result()
    slowest = sorted(took.items(), key=lambda item: -item[1])[:8]
    say(f"{len(wanted)} modules compiled in {time.time() - begun:.1f} s; the slowest {slowest}")
    return {"modules": len(wanted), "seconds": time.time() - begun, "one after the other": sum(took.values())}


@functools.cache
def warp_device():
    """The device, with kernels compiled for it."""
    import warp as wp

    # Machine code at once: PTX of a newer toolkit is not for an older driver.
    wp.config.cuda_output = "cubin"
    wp.init()
    return wp.get_device(arguments.device)


@functools.cache
def kernels():
    """What the environment does before its substeps, and what fills up in them."""
    import warp as wp

    @wp.kernel
    def act(
        t: int,
        welded: int,
        actions: wp.array2d(dtype=wp.vec4),
        targets: wp.array(dtype=int),
        qpos: wp.array2d(dtype=float),
        xpos: wp.array2d(dtype=wp.vec3),
        xquat: wp.array2d(dtype=wp.quat),
        mocap_pos: wp.array2d(dtype=wp.vec3),
        mocap_quat: wp.array2d(dtype=wp.quat),
        ctrl: wp.array2d(dtype=float),
    ):
        w = wp.tid()
        a = actions[w % actions.shape[0], t]
        mocap_pos[w, 0] = xpos[w, welded] + 0.05 * wp.vec3(a[0], a[1], a[2])
        q = xquat[w, welded]
        mocap_quat[w, 0] = wp.quat(q[0] + 1.0, q[1], q[2] + 1.0, q[3])
        for k in range(targets.shape[0]):
            if targets[k] < 0:
                ctrl[w, k] = a[3]
            else:
                ctrl[w, k] = qpos[w, targets[k]] + a[3]

    @wp.kernel
    def watch(
        nefc: wp.array(dtype=int),
        nacon: wp.array(dtype=int),
        ncollision: wp.array(dtype=int),
        most: wp.array(dtype=int),
    ):
        w = wp.tid()
        wp.atomic_max(most, 0, nefc[w])
        if w == 0:
            wp.atomic_max(most, 1, nacon[0])
            wp.atomic_max(most, 2, ncollision[0])

    return act, watch


def warp_rollouts(kind, worlds, save):
    """Rollouts of so many worlds: episodes a second, and where blocks end."""
    import mujoco_warp as mjw
    import warp as wp

    device = warp_device()
    on_gpu = device.is_cuda
    loaded = model(kind)
    data = start(loaded)
    most = REFERENCE["contacts"].max(), REFERENCE["constraints"].max()
    nconmax = arguments.nconmax or int(-(-2 * most[0] // 16) * 16)
    njmax = arguments.njmax or int(-(-1.5 * most[1] // 16) * 16)
    found = {"worlds": worlds, "model": kind, "nconmax": nconmax, "njmax": njmax}
    begun = time.time()
    free = device.free_memory if on_gpu else 0

    act, watch = kernels()
    with wp.ScopedDevice(device):
        m = mjw.put_model(loaded)
        # Overflows are read from the flags; printing them from every world would drown all else.
        m.opt.warn_overflow = False
        d = mjw.put_data(loaded, data, nworld=worlds, nconmax=nconmax, njmax=njmax)
        actions = wp.array(REFERENCE["actions"], dtype=wp.vec4)
        targets = wp.array(REFERENCE["targets"].astype(np.int32), dtype=int)
        seen = wp.zeros(3, dtype=int)
        names = ("qpos", "qvel", "ctrl", "qacc_warmstart", "mocap_pos", "mocap_quat", "xpos", "xquat", "time")
        first = {name: wp.clone(getattr(d, name)) for name in names}
        difference = np.abs(d.xpos.numpy()[0] - data.xpos).max(), np.abs(d.qpos.numpy()[-1] - data.qpos).max()
        found["start, largest difference of xpos and qpos"] = [float(x) for x in difference]
        found["graph"] = False
        step = lambda: mjw.step(m, d)  # noqa: E731
        if arguments.workers:
            try:
                found["compilation"] = compile_kernels(device, step)
            except Exception:
                traceback.print_exc(file=sys.stdout)
        step()
        wp.synchronize()
        found["first step s, with compilation"] = time.time() - begun
        say(worlds, kind, "first step", found["first step s, with compilation"])
        if on_gpu:
            try:
                with wp.ScopedCapture() as capture:
                    mjw.step(m, d)
                graph = capture.graph
                step = lambda: wp.capture_launch(graph)  # noqa: E731
                found["graph"] = True
            except Exception:
                traceback.print_exc(file=sys.stdout)

        def rollout(steps):
            """Run an episode, or its beginning; the seconds it takes, and the steps that were done."""
            for name, value in first.items():
                wp.copy(getattr(d, name), value)
            wp.synchronize()
            begun = time.time()
            for t in range(steps):
                wp.launch(
                    act,
                    dim=worlds,
                    inputs=[t, WELDED, actions, targets, d.qpos, d.xpos, d.xquat],
                    outputs=[d.mocap_pos, d.mocap_quat, d.ctrl],
                )
                for _ in range(SUBSTEPS):
                    step()
                wp.launch(watch, dim=worlds, inputs=[d.nefc, d.nacon, d.ncollision], outputs=[seen])
                if t % 5 == 4 or t + 1 == steps:
                    wp.synchronize()
                    if time.time() > LATEST:
                        break
            return time.time() - begun, t + 1

        rollout(min(STEPS, 2))
        d.overflow.zero_()
        places, seconds, whole = [], [], True
        for i in range(arguments.rollouts):
            if i and time.time() + seconds[-1] > LATEST:
                break
            took, steps = rollout(STEPS)
            whole = steps == STEPS
            seconds.append(took * STEPS / steps)
            say(worlds, kind, f"{steps} steps in {took:.3f} s, {worlds / seconds[-1]:.1f} episodes/s")
            places.append(d.site_xpos.numpy()[:, SITE].astype(float))
        overflow = d.overflow.numpy()
        flags = {f.name: int((overflow & f.value != 0).sum()) for f in _overflow_types()}
        found |= {
            "rollouts s": seconds,
            "episodes/s": worlds / float(np.median(seconds)),
            "memory bytes": free - device.free_memory if on_gpu else 0,
            "memory pool high bytes": wp.get_mempool_used_mem_high(device) if on_gpu else 0,
            "worlds with overflow": {name: n for name, n in flags.items() if n},
            "most constraints of a world": int(seen.numpy()[0]),
            "most contacts a world, on average": float(seen.numpy()[1] / worlds),
            "most pairs a world after the broad phase, on average": float(seen.numpy()[2] / worlds),
            "worlds not finite": int((~np.isfinite(places[-1]).all(1)).sum()),
        }
    if save:
        np.savez_compressed(OUT / f"places_{kind.replace(' ', '_')}.npz", places=np.array(places, np.float32))
    n = min(worlds, len(REFERENCE["final"]))
    found["whole episodes"] = WHOLE and whole
    if whole:
        found["drift"] = compare_all(places[-1][:n])
        if len(places) > 1:
            found["against the rollout before"] = compare(places[-1][:n], places[-2][:n])
        if worlds >= 2 * n:
            found["against copies in the same batch"] = compare(places[-1][n : 2 * n], places[-1][:n])
    return found


def _overflow_types():
    from mujoco_warp._src.types import OverflowType

    return list(OverflowType)


def machine():
    """What it runs on."""
    import mujoco_warp
    import warp as wp

    device = warp_device()
    return {
        "warp": wp.__version__,
        "mujoco_warp": mujoco_warp.__version__,
        "device": device.name,
        "memory": device.total_memory if device.is_cuda else None,
    }


# --- MJX, on JAX ---


def mjx_rollouts(worlds):
    """Rollouts by MJX, in a process of their own."""
    import jax
    import jax.numpy as jnp
    from mujoco import mjx

    loaded = model("margin 0")
    found = {"worlds": worlds, "jax": jax.__version__, "device": str(jax.devices()[0])}
    m = mjx.put_model(loaded, impl="jax")
    d = mjx.put_data(loaded, start(loaded), impl="jax")
    targets = REFERENCE["targets"]
    relative = jnp.array(targets >= 0, jnp.float32)
    places = jnp.array(np.maximum(targets, 0))

    def control(d, action):
        d = d.replace(
            mocap_pos=d.mocap_pos.at[0].set(d.xpos[WELDED] + 0.05 * action[:3]),
            mocap_quat=d.mocap_quat.at[0].set(d.xquat[WELDED] + jnp.array([1.0, 0.0, 1.0, 0.0])),
            ctrl=relative * d.qpos[places] + action[3],
        )
        return jax.lax.fori_loop(0, SUBSTEPS, lambda _, d: mjx.step(m, d), d), None

    @jax.jit
    def rollout(actions):
        return jax.vmap(lambda a: jax.lax.scan(control, d, a)[0].site_xpos[SITE])(actions)

    actions = jnp.array(np.resize(REFERENCE["actions"], (worlds, 50, 4))[:, :STEPS])
    begun = time.time()
    compiled = rollout.lower(actions).compile()
    found["compilation s"] = time.time() - begun
    say("mjx compiled", found["compilation s"])
    seconds = []
    for _ in range(2):
        begun = time.time()
        ended = np.asarray(compiled(actions).block_until_ready(), float)
        seconds.append(time.time() - begun)
        say(f"mjx rollout {seconds[-1]:.2f} s")
        if time.time() > DEADLINE:
            break
    found |= {"rollouts s": seconds, "episodes/s": worlds / seconds[-1]}
    stats = jax.devices()[0].memory_stats() or {}
    found["memory bytes"] = stats.get("peak_bytes_in_use")
    found["drift"] = compare_all(ended[: len(REFERENCE["final"])])
    return found


def mjx_apart():
    """In a process of its own, since its compilation cannot be interrupted otherwise."""
    left = max(5.0, DEADLINE - time.time())
    command = [sys.executable, "-W", "ignore", __file__, "--mjx", "--limit", f"{left:.0f}", "--out", str(OUT)]
    command += [
        "--steps",
        str(STEPS),
        "--substeps",
        str(SUBSTEPS),
        "--worlds",
        arguments.worlds.split(",")[0],
    ]
    environment = os.environ | {"XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
    try:
        subprocess.run(command, env=environment, timeout=left, check=False)
    except subprocess.TimeoutExpired:
        say(f"mjx was not ready after {left:.0f} s")
    file = OUT / "mjx.json"
    told = json.loads(file.read_text()) if file.exists() else {}
    return told.get("mjx", {"error": f"not ready after {left:.0f} s"})


sizes = [int(n) for n in arguments.worlds.split(",")]
if arguments.mjx:
    part("mjx", mjx_rollouts, sizes[0])
else:
    part("yardsticks", yardsticks)
    part("machine", machine)
    for kind in KINDS[:2]:
        part(f"warp {sizes[0]}, {kind}", warp_rollouts, kind, sizes[0], True)
    for size in sizes[1:]:
        part(f"warp {size}, {KINDS[0]}", warp_rollouts, KINDS[0], size, False)
    for size in sizes[-1:0:-2]:
        part(f"warp {size}, one contact", warp_rollouts, "one contact", size, False)
    if not arguments.no_mjx:
        part("mjx", mjx_apart)
say("done")
