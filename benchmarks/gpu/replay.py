"""MuJoCo Warp on the Fetch model: episodes a second, and how far blocks end from where the CPU puts them.

    python benchmarks/gpu/replay.py [--device cuda:0] [--worlds 1024,4096,16384,2048,8192] [--limit 200]

Reads fetch.mjb.xz and reference.npz beside this file (see reference.py), replays the recorded
actions open loop, and writes gpu.json to --out after every part. A part that fails prints its
traceback, and the next one begins. No part begins after the time limit.
"""

import argparse
import gc
import json
import lzma
import sys
import tempfile
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
from distance import REFERENCE, compare, compare_all, yardsticks
from fetch_model import KINDS, change
from mujoco_warp._src.types import OverflowType
from warp._src.context import _resolve_launch_block_dim

HERE = Path(__file__).parent
SITE, WELDED = int(REFERENCE["site"]), int(REFERENCE["welded"])
STARTED = time.time()
report = {"versions": {"mujoco": mujoco.__version__}}


def read_arguments():
    """What was asked for on the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--worlds", default="1024,4096,16384,2048,8192", help="in this order")
    parser.add_argument("--limit", type=float, default=200.0, help="seconds, all parts together")
    parser.add_argument(
        "--steps", type=int, default=50, help="control steps of an episode; fewer only for tests"
    )
    parser.add_argument("--substeps", type=int, default=20)
    parser.add_argument("--rollouts", type=int, default=2, help="measured ones, after a short warm-up")
    parser.add_argument("--nconmax", type=int, default=0, help="contacts a world, on average; 0: by the CPU")
    parser.add_argument("--njmax", type=int, default=0, help="constraints a world; 0: by the CPU")
    parser.add_argument("--workers", type=int, default=16, help="threads that compile kernels")
    parser.add_argument("--out", default=".")
    return parser.parse_args()


def say(*words):
    """Print, with the time since the start."""
    print(f"[{time.time() - STARTED:6.1f} s]", *words, flush=True)


def part(arguments, name, function, *args):
    """Run one part, unless time is up; a failure is kept and told, no more."""
    if time.time() > STARTED + arguments.limit:
        report[name] = {"skipped": "no time was left"}
        say(name, "skipped: no time was left")
    else:
        say(name, "begins")
        try:
            report[name] = function(*args)
        except Exception as error:
            traceback.print_exc(file=sys.stdout)
            report[name] = {"error": f"{type(error).__name__}: {error}"[:2000]}
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "gpu.json").write_text(json.dumps(report, indent=1))


def model(kind):
    """The stored model, in one of the forms that MuJoCo Warp takes."""
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


def modules_of(device, step):
    """The modules that a step launches, with their block sizes; none is launched.

    The step is gone through once with launches that only note which module they would need.
    """
    wanted = {}

    def note(kernel, dim=1, *_, block_dim=None, **__):
        if np.prod(dim) and not kernel.is_generic:
            wanted[kernel.module, _resolve_launch_block_dim(device, block_dim)] = kernel.module.name

    def note_branch(_condition, while_body=None, on_true=None, **kwargs):
        (while_body or on_true)(**kwargs)

    real = wp.launch, wp.launch_tiled, wp.capture_while, wp.capture_if
    wp.launch = wp.launch_tiled = note
    wp.capture_while = wp.capture_if = note_branch
    try:
        step()
    finally:
        wp.launch, wp.launch_tiled, wp.capture_while, wp.capture_if = real
    return list(wanted)


def compile_kernels(device, step, workers):
    """Compile what a step launches, side by side; one after the other takes minutes."""
    wanted = modules_of(device, step)
    begun = time.time()
    took = {}

    def load(module, block_dim):
        here = time.time()
        module.load(device, block_dim)
        took[f"{module.name.split('.')[-1][:40]} {block_dim}"] = round(time.time() - here, 1)

    with ThreadPoolExecutor(workers) as pool:
        for future in [pool.submit(load, *key) for key in wanted]:
            future.result()
    slowest = sorted(took.items(), key=lambda item: -item[1])[:8]
    say(f"{len(wanted)} modules ready in {time.time() - begun:.1f} s; the slowest {slowest}")
    return {"modules": len(wanted), "seconds": time.time() - begun, "one after the other": sum(took.values())}


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
    """What the environment does with an action before its substeps."""
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
    """The most constraints, contacts and candidate pairs so far."""
    w = wp.tid()
    wp.atomic_max(most, 0, nefc[w])
    if w == 0:
        wp.atomic_max(most, 1, nacon[0])
        wp.atomic_max(most, 2, ncollision[0])


class Worlds:
    """So many copies of the start, on the device, and what steps all of them."""

    def __init__(self, device, loaded, data, worlds, nconmax, njmax):
        self.worlds = worlds
        with wp.ScopedDevice(device):
            self.model = mjw.put_model(loaded)
            # Overflows are read from the flags; printing them from every world would drown all else.
            self.model.opt.warn_overflow = False
            self.data = mjw.put_data(loaded, data, nworld=worlds, nconmax=nconmax, njmax=njmax)
            self.actions = wp.array(REFERENCE["actions"], dtype=wp.vec4)
            self.targets = wp.array(REFERENCE["targets"].astype(np.int32), dtype=int)
            self.seen = wp.zeros(3, dtype=int)
        names = ("qpos", "qvel", "ctrl", "qacc_warmstart", "mocap_pos", "mocap_quat", "xpos", "xquat", "time")
        self.first = {name: wp.clone(getattr(self.data, name)) for name in names}
        self.graph = None

    def step(self):
        """One substep, by the graph once there is one."""
        if self.graph is None:
            mjw.step(self.model, self.data)
        else:
            wp.capture_launch(self.graph)

    def capture(self):
        """Make a graph of a step, so that launches cost nothing."""
        with wp.ScopedCapture() as capture:
            mjw.step(self.model, self.data)
        self.graph = capture.graph

    def rollout(self, steps, substeps, latest):
        """Run an episode, or its beginning; the seconds it takes, and the steps that were done."""
        d = self.data
        for name, value in self.first.items():
            wp.copy(getattr(d, name), value)
        wp.synchronize()
        begun = time.time()
        for t in range(steps):
            wp.launch(
                act,
                dim=self.worlds,
                inputs=[t, WELDED, self.actions, self.targets, d.qpos, d.xpos, d.xquat],
                outputs=[d.mocap_pos, d.mocap_quat, d.ctrl],
            )
            for _ in range(substeps):
                self.step()
            wp.launch(watch, dim=self.worlds, inputs=[d.nefc, d.nacon, d.ncollision], outputs=[self.seen])
            if t % 5 == 4 or t + 1 == steps:
                wp.synchronize()
                if time.time() > latest:
                    break
        return time.time() - begun, t + 1

    def places(self):
        """Where the blocks are."""
        return self.data.site_xpos.numpy()[:, SITE].astype(float)


def sizes_of_buffers(arguments):
    """Room for contacts and constraints of a world: twice and one and a half times the CPU's most."""
    contacts, constraints = REFERENCE["contacts"].max(), REFERENCE["constraints"].max()
    nconmax = arguments.nconmax or int(-(-2 * contacts // 16) * 16)
    njmax = arguments.njmax or int(-(-1.5 * constraints // 16) * 16)
    return nconmax, njmax


def rollouts(arguments, device, kind, worlds, save):
    """Rollouts of so many worlds: episodes a second, and where blocks end."""
    # The slowest rollouts are cut short here, and their time is extrapolated.
    latest = STARTED + arguments.limit + 30
    on_gpu = device.is_cuda
    loaded = model(kind)
    data = start(loaded)
    nconmax, njmax = sizes_of_buffers(arguments)
    found = {"worlds": worlds, "model": kind, "nconmax": nconmax, "njmax": njmax}
    gc.collect()
    begun = time.time()
    before = wp.get_mempool_used_mem_current(device) if on_gpu else 0
    free = device.free_memory if on_gpu else 0
    with wp.ScopedDevice(device):
        many = Worlds(device, loaded, data, worlds, nconmax, njmax)
        d = many.data
        difference = np.abs(d.xpos.numpy()[0] - data.xpos).max(), np.abs(d.qpos.numpy()[-1] - data.qpos).max()
        found["start, largest difference of xpos and qpos"] = [float(x) for x in difference]
        found["compilation"] = compile_kernels(device, many.step, arguments.workers)
        many.step()
        wp.synchronize()
        found["first step s, with compilation"] = time.time() - begun
        say(worlds, kind, "first step", found["first step s, with compilation"])
        if on_gpu:
            try:
                many.capture()
            except Exception:
                traceback.print_exc(file=sys.stdout)
        found["graph"] = many.graph is not None
        many.rollout(min(arguments.steps, 2), arguments.substeps, latest)
        d.overflow.zero_()
        places, seconds, whole = [], [], True
        for i in range(arguments.rollouts):
            if i and time.time() + seconds[-1] > latest:
                break
            took, steps = many.rollout(arguments.steps, arguments.substeps, latest)
            whole = steps == arguments.steps
            seconds.append(took * arguments.steps / steps)
            say(worlds, kind, f"{steps} steps in {took:.3f} s, {worlds / seconds[-1]:.1f} episodes/s")
            places.append(many.places())
        overflow = d.overflow.numpy()
        flags = {f.name: int((overflow & f.value != 0).sum()) for f in OverflowType}
        seen = many.seen.numpy()
        found |= {
            "rollouts s": seconds,
            "episodes/s": worlds / float(np.median(seconds)),
            "memory bytes": free - device.free_memory if on_gpu else 0,
            "of that arrays": wp.get_mempool_used_mem_current(device) - before if on_gpu else 0,
            "worlds with overflow": {name: n for name, n in flags.items() if n},
            "most constraints of a world": int(seen[0]),
            "most contacts a world, on average": float(seen[1] / worlds),
            "most pairs a world after the broad phase, on average": float(seen[2] / worlds),
            "worlds not finite": int((~np.isfinite(places[-1]).all(1)).sum()),
            "whole episodes": whole and arguments.steps == 50 and arguments.substeps == 20,
        }
    if save:
        file = Path(arguments.out) / f"places_{kind.replace(' ', '_')}.npz"
        np.savez_compressed(file, places=np.array(places, np.float32))
    if whole:
        found |= drift(places)
    return found


def drift(places):
    """The last rollout against the CPU's, the rollout before, and its own copies in the batch."""
    n = min(len(places[-1]), len(REFERENCE["final"]))
    found = {"drift": compare_all(places[-1][:n])}
    if len(places) > 1:
        found["against the rollout before"] = compare(places[-1][:n], places[-2][:n])
    if len(places[-1]) >= 2 * n:
        found["against copies in the same batch"] = compare(places[-1][n : 2 * n], places[-1][:n])
    return found


def machine(device):
    """What it runs on."""
    return {
        "warp": wp.__version__,
        "mujoco_warp": mjw.__version__,
        "device": device.name,
        "memory": device.total_memory if device.is_cuda else None,
    }


def main():
    """All parts, the most telling first."""
    arguments = read_arguments()
    # Machine code at once: PTX of a newer toolkit is not for an older driver.
    wp.config.cuda_output = "cubin"
    wp.init()
    device = wp.get_device(arguments.device)
    part(arguments, "machine", machine, device)
    sizes = [int(n) for n in arguments.worlds.split(",")]
    for size in sizes:
        for kind in ("one contact", KINDS[0]):
            first = size == sizes[0]
            part(arguments, f"warp {size}, {kind}", rollouts, arguments, device, kind, size, first)
    part(arguments, "yardsticks", yardsticks)
    say("done")


if __name__ == "__main__":
    main()
