"""How fast Fetch episodes are, beside the other ways to run them.

    python benchmarks/rollout.py [--episodes 48] [--repeats 5] [--scale 1.0]

Prints medians over repeats of ratios of wall time. The two times of a ratio are taken one right
after the other, on the same policies:
- the native engine against the loop over ``env.step`` that a user of Gymnasium would write, in
  one process and in as many as the engine has threads;
- against EnvPool's C++ environments with the same number of threads, if EnvPool is installed
  (its episodes start elsewhere, the policies are the same);
- bare ``mj_step`` on the controls that the policies gave, against the engine: the share of the
  time that is physics, above 1 where the engine spares MuJoCo collision tests;
- the engine on two threads against twice itself on one.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import functools
import importlib.util
import io
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import gymnasium
import mujoco
import numpy as np
import torch
from numpy.typing import NDArray

from nichechain.domains.fetch import FetchPickAndPlace
from nichechain.domains.policies.controllers import MLP
from nichechain.execution import Threads, available_cpus

Genotypes = NDArray[np.float32]
ENV_ID = FetchPickAndPlace.env_id
STEPS = FetchPickAndPlace.steps
POLICY = MLP((25, 32, 32, 4))


def main() -> None:
    """Measure all, then print them beside what is aimed at."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=48)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--scale", type=float, default=1.0, help="of the Cauchy noise on the policies")
    options = parser.parse_args()
    genotypes = POLICY.sample(options.episodes, 1)
    noise = np.random.default_rng(0).standard_cauchy(genotypes.shape)
    genotypes += (options.scale * noise).astype(np.float32)
    domain = FetchPickAndPlace()
    measure = functools.partial(median_ratio, repeats=options.repeats)

    print(f"{options.episodes} episodes, median of {options.repeats} ratios; target in brackets")
    with Threads(1) as one, Threads(2) as two:
        singly = functools.partial(one.evaluate, domain, genotypes)
        doubly = functools.partial(two.evaluate, domain, genotypes)
        doubly()  # compiles the engine and makes both threads' states
        # On another machine some of these cannot be met: two threads need two processors.
        print(f"processors: {available_cpus()}")

        with Loops(1) as loop, Loops(2) as loops:
            show("Gymnasium loop / ours, 1 thread", measure(loop.task(genotypes), singly), ">= 1.5")
            show("Gymnasium loop / ours, 2 threads", measure(loop.task(genotypes), doubly), ">= 2.7")
            show("  the same, the loop in 2 processes", measure(loops.task(genotypes), doubly), "")
        if importlib.util.find_spec("envpool") is None:
            print("EnvPool is not installed (pip install envpool), so it is left out.")
        else:
            for threads, ours in ((1, singly), (2, doubly)):
                ratio = measure(envpool_task(genotypes, threads), ours)
                show(f"EnvPool / ours, {threads} thread(s)", ratio, ">= 0.98; 1.15 with culling")
        physics = measure(physics_task(domain, genotypes), singly)
        show("bare mj_step / ours, 1 thread", physics, ">= 0.93 before culling; 1.2 with it")
        show("efficiency of 2 threads", measure(singly, doubly) / 2, ">= 0.93")


def median_ratio(theirs: Callable[[], object], ours: Callable[[], object], *, repeats: int) -> float:
    """Median of (time of the first) / (time of the second), after one round that is not timed."""
    theirs()
    ours()
    return statistics.median(seconds(theirs) / seconds(ours) for _ in range(repeats))


def seconds(task: Callable[[], object]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    task()
    return time.perf_counter() - start


def show(name: str, ratio: float, target: str) -> None:
    """One line of the table."""
    print(f"{name:40s}{ratio:6.2f}   [{target}]" if target else f"{name:40s}{ratio:6.2f}", flush=True)


class Loops:
    """The Gymnasium loop in processes that keep their environment."""

    def __init__(self, processes: int) -> None:
        self._processes = processes
        # A forked copy of a process with threads may hang.
        self._pool = ProcessPoolExecutor(processes, mp_context=get_context("spawn"))

    def task(self, genotypes: Genotypes) -> Callable[[], object]:
        """One episode per genotype."""
        parts = np.array_split(genotypes, self._processes)
        return lambda: list(self._pool.map(loop_episodes, parts))

    def __enter__(self) -> Loops:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown()


@functools.cache
def environment() -> gymnasium.Env:
    """One environment for all episodes of a process."""
    # On import it prints a notice about environments of another family.
    with contextlib.redirect_stderr(io.StringIO()):
        import gymnasium_robotics

    torch.set_num_threads(1)
    gymnasium.register_envs(gymnasium_robotics)
    return gymnasium.make(ENV_ID)


def loop_episodes(genotypes: Genotypes) -> list[NDArray[np.float64]]:
    """Where the block ends up, from the loop that everyone writes."""
    env = environment()
    blocks = []
    for genotype in genotypes:
        policy = POLICY.module(genotype)
        observation, _ = env.reset(seed=0)
        for _ in range(STEPS):
            with torch.no_grad():
                action = policy(torch.as_tensor(observation["observation"], dtype=torch.float32))
            observation, *_ = env.step(action.numpy())
        blocks.append(observation["achieved_goal"][:2])
    return blocks


def envpool_task(genotypes: Genotypes, threads: int) -> Callable[[], object]:
    """One EnvPool environment per policy, stepped together; all policies in one product per layer."""
    import envpool

    count = len(genotypes)
    envs = envpool.make(ENV_ID, env_type="gymnasium", num_envs=count, num_threads=threads, seed=0)
    ends = np.cumsum([0] + [a * b for a, b in zip(POLICY.sizes, POLICY.sizes[1:], strict=False)])
    layers = [
        genotypes[:, start:end].reshape(count, b, a)
        for start, end, a, b in zip(ends, ends[1:], POLICY.sizes, POLICY.sizes[1:], strict=False)
    ]

    def run() -> None:
        observations, _ = envs.reset()
        for _ in range(STEPS):
            units = observations["observation"].astype(np.float32)[:, :, None]
            for weights in layers[:-1]:
                units = np.maximum(weights @ units, 0)
            observations, *_ = envs.step(np.tanh(layers[-1] @ units)[:, :, 0].astype(np.float64))

    return run


def physics_task(domain: FetchPickAndPlace, genotypes: Genotypes) -> Callable[[], object]:
    """Nothing but ``mj_step``, on the controls of one episode per genotype."""
    env = environment().unwrapped
    env.reset(seed=domain.seed)
    start = copy.copy(env.data)
    controls = []
    for genotype in genotypes:
        env.reset(seed=domain.seed)
        for action in domain.episode(genotype).actions:
            env.step(action)
            controls.append([a.copy() for a in (env.data.ctrl, env.data.mocap_pos, env.data.mocap_quat)])
    data = mujoco.MjData(env.model)

    def run() -> None:
        for i, (ctrl, position, orientation) in enumerate(controls):
            if i % STEPS == 0:
                mujoco.mj_copyData(data, env.model, start)
            data.ctrl, data.mocap_pos, data.mocap_quat = ctrl, position, orientation
            mujoco.mj_step(env.model, data, env.n_substeps)

    run()
    if not np.array_equal(data.qpos, env.data.qpos):
        raise RuntimeError("the replayed controls do not lead where the episode went")
    return run


if __name__ == "__main__":
    main()
