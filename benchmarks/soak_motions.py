"""Whether the cache of motions stays in its memory, and right, over a million rollouts.

    python benchmarks/soak_motions.py [--rollouts 1000000] [--memory 64MB] [--threads 2]

The physics is made up, so that a rollout takes microseconds: a state is a hash of the actions so far.
Nodes are as large as those of Pick and Place, episodes as long, and policies come again as often as a
rank to the power of -1. Every observation of every rollout is compared with the hash. Prints, for each
tenth, processor time per rollout, memory, states held, and the share of steps that were known.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from soak import memory

from nichechain.domains.engine.motions import Motions, code_of
from nichechain.domains.engine.policy import forward
from nichechain.domains.memory import parse_memory

STEPS, INPUTS, STATE, OUTPUTS = 50, 25, 72, 4
SIZES, ACTIVATIONS = np.array([INPUTS, OUTPUTS]), np.array([0])
POLICIES = 100_000
_PIECE = 500
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)


@numba.njit(nogil=True)
def observe(state: Any, out: Any) -> None:
    """What is seen in a state: the bits of its hash, as -1 and 1."""
    for k in range(out.size):
        state = (state ^ (state >> np.uint64(29))) * _MULTIPLIER + np.uint64(k + 1)
        out[k] = 1.0 if state >> np.uint64(63) else -1.0


@numba.njit(nogil=True)
def finish(weights: Any, known: Any, seen: Any, done: Any, codes: Any, snapshot: Any, states: Any) -> Any:
    """Simulate an episode from step ``known`` on; how many of the numbers that were known are wrong."""
    hidden = np.empty((2, INPUTS), np.float32)
    expected = np.empty(INPUTS)
    state = np.uint64(1)
    wrong = 0
    for t in range(codes.size + 1):
        observe(state, expected)
        if t <= known and t:
            wrong += np.sum(expected != seen[t])
        if t == known and t and t < codes.size:
            wrong += snapshot[0] != np.float64(state >> np.uint64(12))
        seen[t] = expected
        if t == codes.size:
            break
        forward(weights, SIZES, ACTIVATIONS, hidden, seen[t], done[t])
        codes[t] = code_of(done[t], False)
        state = (state ^ np.uint64(codes[t] + 2)) * _MULTIPLIER
        states[t, :] = np.float64(state >> np.uint64(12))
    return wrong


def policy(number: int) -> NDArray[np.float32]:
    """Weights with which every action is -1 or 1."""
    rng = np.random.default_rng(number)
    # Few of the weights differ from those of most others, so that episodes begin alike.
    weights = np.zeros((OUTPUTS, INPUTS), np.float32)
    weights[np.arange(OUTPUTS), rng.integers(3, size=OUTPUTS)] = 4.0
    weights[rng.integers(OUTPUTS), 3 + rng.integers(INPUTS - 3)] = 8.0
    return np.concatenate([weights.ravel(), np.zeros(OUTPUTS, np.float32)])


def rollouts(tree: Motions, seed: int) -> tuple[int, int]:
    """So many rollouts; how many of their steps were known, and how many numbers were wrong."""
    rng = np.random.default_rng(seed)
    seen, done = np.empty((STEPS + 1, INPUTS)), np.empty((STEPS, OUTPUTS), np.float32)
    codes, snapshot, states = np.empty(STEPS, np.int64), np.empty(STATE), np.empty((STEPS, STATE))
    steps = wrong = 0
    for number in (POLICIES ** rng.random(_PIECE)).astype(int).tolist():
        weights = policy(number)
        known = tree.walk((weights, SIZES, ACTIVATIONS), seen, done, codes, snapshot)
        wrong += int(finish(weights, known, seen, done, codes, snapshot, states))
        tree.insert(known, seen, codes, states)
        steps += known
    return steps, wrong


def main() -> None:
    """Roll out, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rollouts", type=int, default=1_000_000)
    parser.add_argument("--memory", default="64MB")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    first = np.empty(INPUTS)
    observe(np.uint64(1), first)
    tree = Motions(parse_memory(options.memory), first, STATE, blocked=False)
    rollouts(tree, 0)
    tenth = options.rollouts // 10
    print("tenth   µs of processor per rollout   memory (MB)   cache (MB)    states   steps known")
    total = 0
    with ThreadPoolExecutor(options.threads) as pool:
        for number in range(10):
            began = time.process_time()
            seeds = range(number * tenth, (number + 1) * tenth, _PIECE)
            found = np.array(list(pool.map(lambda seed: rollouts(tree, seed), seeds)))
            each = 1e6 * (time.process_time() - began) / (len(seeds) * _PIECE)
            known, wrong = found.sum(axis=0)
            total += int(wrong)
            share = known / (len(seeds) * _PIECE * STEPS)
            held = (memory()[0], tree.memory / 1e6, len(tree))
            print("{:5d}   {:27.1f}   {:11.0f}   {:10.1f}   {:7d}   {:10.1%}".format(
                number + 1, each, *held, share
            ), flush=True)  # fmt: skip
    print(f"{total} of the numbers that were known are wrong")


if __name__ == "__main__":
    main()
