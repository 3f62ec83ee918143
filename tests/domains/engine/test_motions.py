"""The cache of motions: the same bits whatever it holds, and never more memory than it may take."""

from __future__ import annotations

import logging
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from nichechain.domains import FetchPickAndPlace
from nichechain.domains.engine import motions as module
from nichechain.domains.engine.fetch import Disturbance, NativeFetch
from nichechain.domains.engine.motions import Motions, code_of
from nichechain.domains.noise import Noise
from nichechain.domains.policies.controllers import MLP

TASKS = ("FetchPickAndPlace-v4", "FetchPush-v4", "FetchSlide-v4", "FetchReach-v4")
SCALES = (0.0, 0.1, 1.0, 10.0)
STEPS = 50
INPUTS, STATE = 6, 3


def policies(inputs: int, n: int, seed: int) -> NDArray[np.float32]:
    """Genotypes at every mutation scale; half of them are children of others."""
    mlp = MLP((inputs, 32, 32, 4))
    rng = np.random.default_rng(seed)
    genotypes = mlp.sample(n, seed)
    scales = np.resize(SCALES, n)[:, None]
    genotypes += (scales * rng.standard_cauchy(genotypes.shape)).astype(np.float32)
    for i in range(n // 2, n):
        # A child with few other weights often begins as its parent does.
        genotypes[i] = genotypes[i - n // 2]
        changed = rng.integers(genotypes.shape[1], size=5)
        genotypes[i, changed] += (scales[i] * rng.standard_cauchy(5)).astype(np.float32)
    return genotypes


class Watched(NativeFetch):
    """Native episodes that tell the state after every saturated action, and the last one."""

    def __init__(self, env_id: str, cache_memory: int) -> None:
        super().__init__(env_id, 0, cache_memory)
        compiled = self._run
        self._seen: tuple[Any, ...] = ()

        def run(*arguments: Any) -> None:
            compiled(*arguments)
            self._seen = arguments[-2:]

        self._run = run

    def states(self, mlp: MLP, genotype: NDArray[np.float32]) -> list[NDArray[np.float64] | None]:
        """Observations, actions as float64, last positions and velocities, and every saturated state.

        None where a state was known and is no longer, since the episode itself took its place.
        """
        self._seen = (None, None)
        episode = self.run(mlp, genotype, STEPS)
        assert episode.failure == ""
        codes = [int(code_of(action, self._blocked)) for action in episode.actions]
        saturated = codes.index(-1) if -1 in codes else STEPS
        parts: list[Any] = [episode.observations, episode.actions.astype(np.float64)]
        known = [self.known_state(codes[: t + 1]) for t in range(episode.known)]
        if episode.known < STEPS:
            simulated = list(self._seen[1][episode.known : saturated])
            data = self._idle[-1]
            parts += [data.qpos.copy(), data.qvel.copy()]
        else:
            simulated = []
            assert known[-1] is not None
            parts += np.split(known[-1][1 : 1 + self._model.nq + self._model.nv], [self._model.nq])
        return [*parts, *known, *simulated]

    def known_state(self, codes: list[int]) -> NDArray[np.float64] | None:
        """The snapshot that the tree holds after these actions, by its own links."""
        tree = self.motions
        assert tree is not None
        node = 0
        for code in codes:
            node = row_of(tree, node).view(np.int64)[module._CHILD]
            while node >= 0 and row_of(tree, node).view(np.int64)[module._CODE] != code:
                node = row_of(tree, node).view(np.int64)[module._SIBLING]
            if node < 0:
                return None
        return row_of(tree, node)[module._CONTENT + self.inputs :].copy()


def row_of(tree: Motions, node: int) -> NDArray[np.float64]:
    return tree._slabs[node // tree._rows][node % tree._rows]


def assert_exact(env_id: str, n: int, seed: int) -> None:
    """Cold, warm and in a tree too small for one episode, against a tree that holds nothing."""
    plain = Watched(env_id, 1)
    mlp = MLP((plain.inputs, 32, 32, 4))
    cached, tiny = Watched(env_id, 2**30), Watched(env_id, 40_000)
    genotypes = policies(plain.inputs, n, seed)
    off = NativeFetch(env_id, 0, 0)
    shared = 0
    for genotype in genotypes:
        expected: list[Any] = plain.states(mlp, genotype)
        # Once more without any cache at all, whose code takes another path.
        plainly = off.run(mlp, genotype, STEPS).observations
        np.testing.assert_array_equal(plainly.view(np.int64), expected[0].view(np.int64))
        for kind in (cached, tiny, cached):
            found = kind.states(mlp, genotype)
            assert len(found) == len(expected)
            for ours, theirs in zip(found, expected, strict=True):
                if ours is None:
                    assert kind is tiny
                    continue
                np.testing.assert_array_equal(ours.view(np.int64), theirs.view(np.int64))
        shared += len(expected) > 4
    assert shared >= n // 4
    assert plain.motions is not None
    assert len(plain.motions) == 1


@pytest.mark.parametrize("env_id", TASKS)
def test_the_same_bits_whatever_is_known(env_id: str) -> None:
    assert_exact(env_id, 12, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("env_id", TASKS)
def test_the_same_bits_of_two_thousand_episodes(env_id: str) -> None:
    assert_exact(env_id, 500, seed=2)


@pytest.mark.parametrize("memory", [2**28, 60_000])
def test_threads_share_a_tree(memory: int) -> None:
    plain = FetchPickAndPlace(cache_memory=0)
    genotypes = policies(25, 16, seed=3)
    # Every one twice, so that some are walked while others are inserted.
    order = [int(i) for i in np.random.default_rng(0).permutation(np.repeat(np.arange(16), 2))]
    expected = [plain.episode(genotype) for genotype in genotypes]
    shared = FetchPickAndPlace(cache_memory=memory)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda i: shared.episode(genotypes[i]), order))
    for i, episode in zip(order, found, strict=True):
        np.testing.assert_array_equal(episode.observations, expected[i].observations)
        np.testing.assert_array_equal(episode.actions, expected[i].actions)


def test_evaluation_says_what_was_known() -> None:
    domain = FetchPickAndPlace()
    saturated = (100.0 * domain.sample(3, seed=0)).astype(np.float32)
    first = domain.evaluate(saturated[:1])
    assert (first.steps, first.known) == (50, 0)
    again = domain.evaluate(saturated)
    assert again.steps == 150
    assert again.known >= 50
    np.testing.assert_array_equal(again.behavior[0], first.behavior[0])


def test_policies_that_do_not_saturate_leave_nothing_behind() -> None:
    native = NativeFetch(TASKS[0], 0)
    for genotype in MLP().sample(3, 0):
        assert native.run(MLP(), genotype, STEPS).known == 0
    assert native.motions is not None
    assert len(native.motions) == 1


def test_noise_passes_by() -> None:
    domain = FetchPickAndPlace()
    genotypes = (100.0 * domain.sample(2, seed=0)).astype(np.float32)
    noise = Noise(initial=0.02)
    before = domain.evaluate_noisy(genotypes, noise, [1, 2])
    plain = domain.evaluate(genotypes)
    after = domain.evaluate_noisy(genotypes, noise, [1, 2])
    assert after.known == 0
    np.testing.assert_array_equal(before.behavior, after.behavior)
    assert not np.array_equal(plain.behavior, after.behavior)
    native = NativeFetch(TASKS[0], 0)
    native.run(MLP(), genotypes[0], 5, Disturbance(shift=np.zeros(2)))
    assert native.motions is not None
    assert len(native.motions) == 1


def test_unstable_physics_is_not_kept() -> None:
    native = NativeFetch(TASKS[0], 0)
    native._start.qvel[:] = np.inf
    still = np.zeros(MLP().genotype_length, np.float32)
    for _ in range(2):
        episode = native.run(MLP(), still, 3)
        assert "BADQVEL" in episode.failure
        assert episode.known == 0
    assert native.motions is not None
    assert len(native.motions) == 1


@pytest.mark.parametrize(
    ("action", "blocked", "code"),
    [
        ((1, 1, 1, 1), False, 80),
        ((-1, -1, -1, -1), False, 0),
        ((-7, 0, 9, np.inf), False, 3 * (3 * (3 * 0 + 1) + 2) + 2),
        ((1, 1, 1, 0.3), True, 26),
        ((1, 1, 1, 0.3), False, -1),
        ((np.nextafter(np.float32(1), np.float32(0)), 1, 1, 1), False, -1),
        ((-0.0, 1, 1, 1), False, -1),
        ((np.nan, 1, 1, 1), False, -1),
    ],
)
def test_codes_of_actions(action: tuple[float, ...], blocked: bool, code: int) -> None:
    assert code_of(np.array(action, np.float32), blocked) == code


class World:
    """A deterministic world whose states are made up: a function of the actions so far."""

    def __init__(self, limit: int) -> None:
        self.tree = Motions(limit, self.observe(()), STATE, blocked=False)
        self.met: set[tuple[int, ...]] = set()

    @staticmethod
    def observe(codes: tuple[int, ...]) -> NDArray[np.float64]:
        return np.sign(np.random.default_rng([len(codes), *codes]).standard_normal(INPUTS))

    @staticmethod
    def state(codes: tuple[int, ...]) -> NDArray[np.float64]:
        return np.random.default_rng([7, len(codes), *codes]).standard_normal(STATE)

    def run(self, weights: NDArray[np.float32], steps: int) -> tuple[int, int, tuple[int, ...]]:
        """An episode: how much of it the tree knew, how much had ever been met, and its actions."""
        policy = (weights, np.array([INPUTS, 4]), np.array([0]))
        seen, done = np.empty((steps + 1, INPUTS)), np.empty((steps, 4), np.float32)
        codes, snapshot, states = np.empty(steps, np.int64), np.empty(STATE), np.empty((steps, STATE))
        known = self.tree.walk(policy, seen, done, codes, snapshot)
        path: tuple[int, ...] = ()
        met = 0
        matrix = weights[: 4 * INPUTS].reshape(4, INPUTS).astype(np.float64)
        for t in range(steps):
            np.testing.assert_array_equal(seen[t] if t <= known else self.observe(path), self.observe(path))
            if t == known and t:
                np.testing.assert_array_equal(snapshot, self.state(path))
            seen[t] = self.observe(path)
            action = np.sign(matrix @ seen[t]).astype(np.float32)
            codes[t] = code_of(action, False)
            if t < known:
                np.testing.assert_array_equal(np.clip(done[t], -1, 1), action)
            path = (*path, int(codes[t]))
            met += path in self.met
            self.met.add(path)
            seen[t + 1], states[t] = self.observe(path), self.state(path)
        self.tree.insert(known, seen, codes, states)
        return known, met, path


def weights(rng: np.random.Generator) -> NDArray[np.float32]:
    """A policy from few, so that episodes meet."""
    matrix = np.zeros((4, INPUTS), np.float32)
    matrix[np.arange(4), rng.integers(INPUTS, size=4)] = rng.choice([-2.0, 2.0], 4)
    return np.concatenate([matrix.ravel(), np.zeros(4, np.float32)])


def test_everything_met_is_known() -> None:
    world = World(2**24)
    rng = np.random.default_rng(0)
    for _ in range(400):
        known, met, _ = world.run(weights(rng), 6)
        assert known == met
    assert len(world.tree) == 1 + len(world.met)


@pytest.mark.parametrize("nodes", [1, 2, 5, 60, 400])
def test_memory_is_bounded_and_what_is_known_is_right(nodes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # The last slab is cut to what is left.
    monkeypatch.setattr(module, "_SLAB_ROWS", 16)
    width = module._CONTENT + INPUTS + STATE
    world = World(8 * width * nodes)
    rng = np.random.default_rng(1)
    for _ in range(400):
        known, met, _ = world.run(weights(rng), 6)
        assert known <= met
        assert len(world.tree) <= nodes
        assert world.tree.memory <= 8 * width * nodes
    assert len(world.met) > 400


def test_what_is_used_stays() -> None:
    width = module._CONTENT + INPUTS + STATE
    world = World(8 * width * 100)
    rng = np.random.default_rng(2)
    often = weights(rng)
    world.run(often, 6)
    known = [(world.run(weights(rng), 6)[0], world.run(often, 6)[0]) for _ in range(300)]
    assert min(again for _, again in known) == 6
    assert len(world.met) > 300


def test_slabs_are_added_as_the_tree_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SLAB_ROWS", 16)
    world = World(2**20)
    rng = np.random.default_rng(3)
    sizes = set()
    for _ in range(100):
        known, met, _ = world.run(weights(rng), 6)
        assert known == met
        sizes.add(world.tree.memory)
    assert len(sizes) > 5


def test_without_memory_the_tree_shrinks_and_says_so_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "_SLAB_ROWS", 16)
    world = World(2**20)
    add = world.tree._add_slab

    def limited() -> None:
        if len(world.tree._slabs) == 6:
            raise MemoryError
        add()

    monkeypatch.setattr(world.tree, "_add_slab", limited)
    rng = np.random.default_rng(4)
    with caplog.at_level(logging.WARNING):
        for _ in range(200):
            known, met, _ = world.run(weights(rng), 6)
            assert known <= met
            assert len(world.tree) <= 6 * 16
    assert len(world.tree._slabs) == 3
    assert [record.message for record in caplog.records] == [
        "memory ran out: the cache of motions goes on with 0 MB"
    ]


def test_not_even_memory_for_a_small_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(_: Motions) -> None:
        raise MemoryError

    monkeypatch.setattr(Motions, "_add_slab", none)
    native = NativeFetch(TASKS[0], 0)
    assert native.motions is None
    assert native.run(MLP(), np.zeros(MLP().genotype_length, np.float32), 1).known == 0
