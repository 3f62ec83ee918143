"""Same seed, same bits: whoever evaluates, wherever it was interrupted, in whichever process."""

from __future__ import annotations

import os
import random
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import nichechain as nc
from nichechain import variation
from nichechain.archive.building import build
from nichechain.core.randomness import Purpose
from nichechain.domains import Evaluation, FetchPickAndPlace, PlanarArm
from nichechain.domains.base import Domain
from nichechain.execution import Executor, Processes, Ray, Threads
from nichechain.niches import GridNiches
from nichechain.search.config import BuildConfig
from nichechain.verification import verify
from nichechain.walks import TopFraction, WalkConfig, Walks, diversity, walk

from .execution.samples import Arm

CONFIG = BuildConfig(
    "arm", (7, 6), PlanarArm.bounds, evaluations=260, initial=60, batch=48, scale=0.3, seed=11
)
WALK = WalkConfig(TopFraction(0.5), diversity.make("knn"), offspring=9, seed=11)
NICHES = GridNiches(CONFIG.shape, CONFIG.bounds)
STEPS = 4

SEARCH = {
    Purpose.INITIAL,
    Purpose.SELECTION,
    Purpose.MUTATION,
    Purpose.REPLACEMENT,
    Purpose.NOVELTY_ARCHIVE,
}


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder but the lock."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def walked(executor: Executor | None) -> dict[str, bytes]:
    """Everything that a walk leaves."""
    result = walk(Arm(), variation.gaussian(0.2), WALK, runs=3, steps=STEPS, niches=NICHES, executor=executor)
    arrays = {name: array.tobytes() for name, array in result.state.arrays().items()}
    tables = {"births": result.births, "records": result.table()}
    return arrays | {name: _bytes(table) for name, table in tables.items()}


def _bytes(table: Any) -> bytes:
    import pyarrow as pa

    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as stream:
        stream.write_table(table.combine_chunks())
    found: bytes = sink.getvalue().to_pybytes()
    return found


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("determinism")
    with Threads(1) as executor:
        build(CONFIG, folder, executor, domain=Arm())
    return content(folder)


@pytest.fixture(scope="module")
def steps() -> dict[str, bytes]:
    return walked(None)


@contextmanager
def _ray(workers: int) -> Iterator[Executor]:
    ray = pytest.importorskip("ray")
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray.init(
        address="local",
        num_cpus=workers,
        include_dashboard=False,
        object_store_memory=128 * 2**20,
        logging_level="ERROR",
    )
    try:
        with Ray() as executor:
            yield executor
    finally:
        ray.shutdown()


class Backwards:
    """Evaluates one genotype at a time, the last first."""

    def evaluate(
        self, domain: Domain, genotypes: NDArray[np.float32], on_done: Callable[[int], None] | None = None
    ) -> Evaluation:
        """Rows in the order that is asked for, made in the other."""
        rows = [domain.evaluate(genotypes[row : row + 1]) for row in reversed(range(len(genotypes)))]
        if on_done is not None:
            on_done(len(rows))
        return Evaluation.concatenate(rows[::-1])


@contextmanager
def _backwards() -> Iterator[Executor]:
    yield Backwards()


@pytest.mark.parametrize(
    "make",
    [
        *(pytest.param(lambda n=n: Threads(n), id=f"threads-{n}") for n in (2, 4)),
        *(pytest.param(lambda n=n: Processes(n), id=f"processes-{n}") for n in (1, 4)),
        pytest.param(lambda: _ray(4), id="ray-4", marks=pytest.mark.slow),
        pytest.param(_backwards, id="backwards"),
    ],
)
def test_executors_and_where_a_build_was_stopped_change_nothing(
    make: Callable[[], Any], archive: dict[str, bytes], steps: dict[str, bytes], tmp_path: Path
) -> None:
    with make() as executor, Threads(1) as one:
        assert walked(executor) == steps
        # Stopped in the middle of a step, and in the middle of the initial births.
        build(replace(CONFIG, evaluations=37), tmp_path, executor, domain=Arm())
        build(replace(CONFIG, evaluations=150), tmp_path, one, domain=Arm())
        build(CONFIG, tmp_path, executor, domain=Arm())
    assert content(tmp_path) == archive


_ELSEWHERE = """
import random, sys
from pathlib import Path
import numpy as np
import torch
random.seed(1); np.random.seed(2); torch.manual_seed(3)
from dataclasses import replace
from nichechain.archive.building import build
from nichechain.search.config import BuildConfig
from nichechain.domains import PlanarArm
from nichechain.execution import Threads
from nichechain import variation
from nichechain.walks import diversity
from nichechain.niches import GridNiches
from nichechain.walks import TopFraction, WalkConfig, Walks, WalkState

class Arm(PlanarArm):
    chunk = 5

folder, evaluations, steps = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
config = BuildConfig(
    "arm", (7, 6), PlanarArm.bounds, evaluations=evaluations, initial=60, batch=48, scale=0.3, seed=11
)
with Threads(2) as executor:
    build(config, folder / "archive", executor, domain=Arm())
    walk = WalkConfig(TopFraction(0.5), diversity.make("knn"), offspring=9, seed=11)
    walks = Walks(Arm(), variation.gaussian(0.2), walk, GridNiches((7, 6), PlanarArm.bounds))
    if (folder / "state.npz").exists():
        with np.load(folder / "state.npz", allow_pickle=False) as arrays:
            state = WalkState.from_arrays(arrays)
    else:
        state, _ = walks.start(3, executor)
    for _ in range(steps):
        state = walks.advance(state, executor).state
np.savez(folder / "state.npz", **state.arrays())
"""


def _elsewhere(folder: Path, evaluations: int, steps: int, hash_seed: int) -> None:
    environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed), "OMP_NUM_THREADS": str(1 + hash_seed % 3)}
    subprocess.run(
        [sys.executable, "-c", _ELSEWHERE, str(folder), str(evaluations), str(steps)],
        check=True,
        env=environment,
        cwd=Path(nc.__file__).parent.parent,
    )


def test_other_processes_go_on_to_the_same_bits(
    archive: dict[str, bytes], steps: dict[str, bytes], tmp_path: Path
) -> None:
    _elsewhere(tmp_path, 150, 2, hash_seed=1)
    assert content(tmp_path / "archive") != archive
    _elsewhere(tmp_path, 260, STEPS + 1 - 2, hash_seed=2)
    assert content(tmp_path / "archive") == archive
    with np.load(tmp_path / "state.npz", allow_pickle=False) as arrays:
        state = {name: arrays[name].tobytes() for name in arrays.files}
    assert state == {name: steps[name] for name in state}


def _global_generators() -> tuple[Any, ...]:
    import torch

    kind, keys, *rest = np.random.get_state()  # noqa: NPY002  # it is the one to be left alone
    return random.getstate(), kind, keys.tobytes(), rest, torch.get_rng_state().numpy().tobytes()


def _analyse(folder: Path) -> None:
    """Everything that draws."""
    loaded = nc.load(folder, domain=Arm())
    chain = loaded.chain()
    niche = int(loaded.elites.niche[0])
    nc.niche_evolvability(chain, l=3, lineages=5, draws=3, seed=CONFIG.seed)
    nc.niche_evolvability(chain, l=3, lineages=5, draws=3, seed=CONFIG.seed, method="monte-carlo", repeats=3)
    nc.l_evolvability(chain, niche=niche, l=3, lineages=5, draws=3, seed=CONFIG.seed)
    nc.genotype_evolvability(
        loaded, loaded.elite(niche), l=3, lineages=5, offspring=4, draws=3, seed=CONFIG.seed
    )
    nc.bootstrap_elites(loaded.counts, l=2, lineages=5, resamples=2, draws=2, seed=CONFIG.seed)


def test_analysis_between_two_halves_of_a_build_changes_nothing(
    archive: dict[str, bytes], tmp_path: Path
) -> None:
    with Threads(1) as executor:
        build(replace(CONFIG, evaluations=200), tmp_path, executor, domain=Arm())
        _analyse(tmp_path)
        assert verify(nc.load(tmp_path, domain=Arm()), sample=20).ok
        build(CONFIG, tmp_path, executor, domain=Arm())
    assert content(tmp_path) == archive


def test_global_generators_are_left_alone(tmp_path: Path) -> None:
    before = _global_generators()
    with Threads(1) as executor:
        build(CONFIG, tmp_path, executor, domain=Arm())
        walked(executor)
        FetchPickAndPlace().sample(2, seed=0)
    _analyse(tmp_path)
    verify(nc.load(tmp_path, domain=Arm()), sample=20)
    assert _global_generators() == before


def test_analysis_draws_nothing_that_a_search_draws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its generators have other keys, so the same seed gives both without their sharing a draw."""
    with Threads(1) as executor:
        build(CONFIG, tmp_path, executor, domain=Arm())
    keys: set[tuple[int, ...]] = set()
    real = np.random.SeedSequence

    def spy(entropy: int, *, spawn_key: tuple[int, ...]) -> np.random.SeedSequence:
        keys.add(spawn_key)
        return real(entropy, spawn_key=spawn_key)

    monkeypatch.setattr("nichechain.core.randomness.np.random.SeedSequence", spy)
    _analyse(tmp_path)
    used = {Purpose(key[0]) for key in keys}
    assert {Purpose.POSTERIOR, Purpose.WALKS, Purpose.OFFSPRING, Purpose.RESAMPLING} <= used
    assert not used & SEARCH


def test_a_search_draws_with_its_own_keys_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    keys: list[tuple[int, tuple[int, ...]]] = []
    real = np.random.SeedSequence

    def spy(entropy: int, *, spawn_key: tuple[int, ...]) -> np.random.SeedSequence:
        keys.append((entropy, spawn_key))
        return real(entropy, spawn_key=spawn_key)

    monkeypatch.setattr("nichechain.core.randomness.np.random.SeedSequence", spy)
    with Threads(1) as executor:
        build(CONFIG, tmp_path, executor, domain=Arm())
    assert {entropy for entropy, _ in keys} == {CONFIG.seed}
    # One generator per child, keyed by its uid, and one per step.
    children = [key[1] for _, key in keys if key[0] == Purpose.MUTATION]
    # The step under way at 260 births has been bred whole: 60 + 5 * 48 = 300.
    assert set(children) == set(range(60, 300))
    # Children are grown to be evaluated, and again where they are kept: as elites, in lineages, pending.
    assert len(children) < 2 * 240
    assert max(children.count(child) for child in set(children)) <= 3
    assert [key[1] for _, key in keys if key[0] == Purpose.SELECTION] == [1, 2, 3, 4, 5]
    others = [key for key in keys if key[1][0] != Purpose.MUTATION]
    assert len(set(others)) == len(others)


def test_seeds_are_documented() -> None:
    page = (Path(__file__).resolve().parents[1] / "docs" / "reproducibility.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| `(\w+)`: ", page, re.MULTILINE)
    assert {name: int(number) for number, name in rows} == {p.name: p.value for p in Purpose}


def test_walks_of_one_configuration_have_seeds_of_their_own() -> None:
    walks = Walks(Arm(), variation.gaussian(0.2), WALK, NICHES)
    state, _ = walks.start(4)
    assert len(np.unique(state.genotype.reshape(4, -1), axis=0)) == 4
    alone, _ = walks.start([2])
    assert alone.genotype.tobytes() == state.genotype[2:3].tobytes()


FETCH = BuildConfig(
    "fetch", (5, 5), FetchPickAndPlace.bounds, evaluations=20, initial=8, batch=8, scale=1.0, seed=4
)


def test_fetch_gives_the_same_archive_whoever_evaluates_and_in_a_new_process(tmp_path: Path) -> None:
    for workers, budgets in ((1, (20,)), (2, (11, 20)), (4, (20,))):
        for budget in budgets:
            with Threads(workers) as executor:
                build(replace(FETCH, evaluations=budget), tmp_path / str(workers), executor)
    expected = content(tmp_path / "1")
    assert content(tmp_path / "2") == expected
    assert content(tmp_path / "4") == expected
    options = [
        *("--evaluations", "20", "--grid", "5x5", "--initial", "8", "--batch", "8"),
        *("--seed", "4", "--workers", "2"),
    ]
    subprocess.run(
        [sys.executable, "-m", "nichechain", "build", "fetch", *options, "--out", str(tmp_path / "new")],
        check=True,
        env={**os.environ, "PYTHONHASHSEED": "7"},
        cwd=Path(nc.__file__).parent.parent,
        stdout=subprocess.DEVNULL,
    )
    assert content(tmp_path / "new") == expected
    result = verify(tmp_path / "new", sample=None)
    assert result.ok
    assert result.sampled_births == 20
