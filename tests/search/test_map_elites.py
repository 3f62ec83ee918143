"""MAP-Elites against an independent account of its births.

Every birth must follow from the births table and the seed alone: which niche it fell in, which
key it had, whether it became the elite, who its parent was, and which genotype it had.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from nichechain import variation
from nichechain.archive import read
from nichechain.archive.building import build
from nichechain.core.errors import NichechainError
from nichechain.domains import Evaluation, PlanarArm
from nichechain.execution import Threads
from nichechain.niches import GridNiches
from nichechain.search.config import BuildConfig
from nichechain.search.elites import Elites
from nichechain.search.map_elites import MapElites

from ..arms import RoughArm

CONFIG = BuildConfig(
    "arm",
    (8, 6),
    ((-0.6, 1.0), (-0.8, 0.7)),
    evaluations=1500,
    initial=90,
    batch=47,
    scale=0.3,
    seed=11,
)
# The archive format fixes the numbers of these streams.
INITIAL, SELECTION, MUTATION, REPLACEMENT = range(4)
MODES = [
    replace(CONFIG, replacement=replacement, outside=outside)  # type: ignore[arg-type]
    for replacement, outside in itertools.product(
        ["random", "first", "newest", "objective"], ["state", "absorb", "clip"]
    )
]


class TyingArm(RoughArm):
    """One whose objective has many ties."""

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        fine = super().evaluate(genotypes)
        return replace(fine, objective=np.round(4 * fine.objective))


def stream(seed: int, purpose: int, index: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(purpose, index))))


@dataclass
class Run:
    config: BuildConfig
    births: list[dict[str, Any]]
    elites: Elites


def run(config: BuildConfig, folder: Path, domain: PlanarArm) -> Run:
    with Threads(1) as executor:
        build(config, folder, executor, domain=domain)
    meta = read.read_meta(folder)
    return Run(config, read.read_births(folder, meta).to_pylist(), read.read_state(folder, meta).elites)


@pytest.fixture(scope="module", params=MODES, ids=lambda c: f"{c.replacement}-{c.outside}")
def finished(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(request.param, tmp_path_factory.mktemp("archive"), TyingArm())


def key(config: BuildConfig, row: dict[str, Any]) -> float:
    if config.replacement == "random":
        first = 0 if row["step"] == 0 else config.initial + (row["step"] - 1) * config.batch
        size = config.initial if row["step"] == 0 else config.batch
        return float(stream(config.seed, REPLACEMENT, row["step"]).random(size)[row["uid"] - first])
    return {"first": -row["uid"], "newest": row["uid"], "objective": row["objective"]}[config.replacement]


def fold(config: BuildConfig, rows: list[dict[str, Any]]) -> tuple[dict[int, tuple[float, int]], list[bool]]:
    """Largest key and its birth of every niche, and whether each birth beat all before it."""
    best: dict[int, tuple[float, int]] = {}
    accepted = []
    for row in rows:
        niche = row["child_niche"]
        fits = niche is not None and (niche not in best or key(config, row) > best[niche][0])
        if fits:
            best[niche] = (key(config, row), row["uid"])
        accepted.append(fits)
    return best, accepted


def genotypes(config: BuildConfig, rows: list[dict[str, Any]]) -> NDArray[np.float32]:
    """Every birth's genotype, replayed from the initial ones."""
    found = list(PlanarArm().sample(config.initial, seed=stream(config.seed, INITIAL, 0)))
    for row in rows[config.initial :]:
        noise = stream(config.seed, MUTATION, row["uid"]).standard_cauchy(10)
        parent = found[row["parent_uid"]].astype(np.float64)
        found.append((parent + config.scale * noise).astype(np.float32))
    return np.array(found)


def test_every_niches_elite_is_its_birth_with_the_largest_key(finished: Run) -> None:
    best, accepted = fold(finished.config, finished.births)
    assert finished.elites.niche.tolist() == sorted(best)
    assert finished.elites.uid.tolist() == [best[niche][1] for niche in sorted(best)]
    assert [row["accepted"] for row in finished.births] == accepted
    assert 0 < sum(accepted) < len(accepted)
    for i, uid in enumerate(finished.elites.uid):
        row = finished.births[uid]
        assert finished.elites.behavior[i].tolist() == [row["behavior_0"], row["behavior_1"]]
        assert finished.elites.objective[i] == row["objective"]
        assert finished.elites.depth[i] == row["depth"]
        assert finished.elites.key[i] == key(finished.config, row)


def test_births_are_numbered_and_stepped(finished: Run) -> None:
    config, rows = finished.config, finished.births
    assert [row["uid"] for row in rows] == list(range(config.evaluations))
    assert {row["run"] for row in rows} == {0}
    for row in rows:
        beyond = row["uid"] - config.initial
        assert row["step"] == (0 if beyond < 0 else 1 + beyond // config.batch)


def test_parents_were_elites_at_the_time(finished: Run) -> None:
    config, rows = finished.config, finished.births
    assert all(row["parent_uid"] is None and row["parent_niche"] is None for row in rows[: config.initial])
    assert {row["depth"] for row in rows[: config.initial]} == {0}
    for step, group in itertools.groupby(rows[config.initial :], key=lambda row: row["step"]):
        children = list(group)
        best, _ = fold(config, [row for row in rows[: children[0]["uid"]] if row["step"] < step])
        for child in children:
            if not child["lineage"]:
                assert child["parent_uid"] == best[child["parent_niche"]][1]
            assert child["depth"] == rows[child["parent_uid"]]["depth"] + 1


def test_births_replay_from_their_roots(finished: Run) -> None:
    """Seed, parent and number of each birth give its genotype, and so everything else."""
    replayed = genotypes(finished.config, finished.births)
    np.testing.assert_array_equal(replayed[finished.elites.uid], finished.elites.genotype)
    evaluation = TyingArm().evaluate(replayed)
    for i, row in enumerate(finished.births):
        if evaluation.failed[i]:
            assert row["failed"] == "the first joint broke"
        else:
            assert [row["behavior_0"], row["behavior_1"]] == evaluation.behavior[i].tolist()
            assert row["objective"] == evaluation.objective[i]


def test_behaviors_are_in_their_niches(finished: Run) -> None:
    config = finished.config
    (x0, x1), (y0, y1) = config.bounds
    nx, ny = config.shape
    for row in finished.births:
        if row["failed"] is not None:
            continue
        x, y = row["behavior_0"], row["behavior_1"]
        if config.outside != "clip" and not (x0 <= x <= x1 and y0 <= y <= y1):
            expected = nx * ny
        else:
            i = min(max(int(np.floor((x - x0) / (x1 - x0) * nx)), 0), nx - 1)
            j = min(max(int(np.floor((y - y0) / (y1 - y0) * ny)), 0), ny - 1)
            expected = i * ny + j
        assert row["child_niche"] == expected


def test_failed_births_are_recorded_and_never_elites(finished: Run) -> None:
    failed = [row for row in finished.births if row["failed"] is not None]
    assert len(failed) > 10
    for row in failed:
        assert row["failed"] == "the first joint broke"
        assert row["child_niche"] is row["behavior_0"] is row["behavior_1"] is row["objective"] is None
        assert row["accepted"] is False
    uids = {row["uid"] for row in failed}
    assert uids.isdisjoint(finished.elites.uid.tolist())
    assert uids.isdisjoint(row["parent_uid"] for row in finished.births)
    # Every other birth is in some state.
    assert all(row["child_niche"] is not None for row in finished.births if row["uid"] not in uids)


def test_outside_modes(finished: Run) -> None:
    outside = np.prod(finished.config.shape)
    children = sum(row["child_niche"] == outside for row in finished.births)
    parents = sum(row["parent_niche"] == outside for row in finished.births)
    match finished.config.outside:
        case "state":
            assert children > 10
            assert parents > 5
            assert finished.elites.niche[-1] == outside
        case "absorb":
            assert children > 10
            assert parents == 0
            assert finished.elites.niche[-1] == outside
        case "clip":
            assert children == parents == 0
            assert finished.elites.niche[-1] < outside


def searched(config: BuildConfig, domain: PlanarArm) -> MapElites:
    niches = GridNiches(config.shape, config.bounds, config.outside)
    return MapElites(domain, niches, variation.make(config.mutation, config.scale), config)


def test_parents_are_uniform_over_the_occupied_states() -> None:
    """Among them the state outside, however many births each has had."""
    config = replace(CONFIG, initial=400, batch=20_000, scale=1.0, shape=(4, 4))
    search = searched(config, PlanarArm())
    with Threads(1) as executor:
        # A nearly stretched arm is born in few niches, but its children are born in many.
        search.advance(executor, 400)
        search.advance(executor, 20_000)
        occupied = search._archive.occupied()
        rows = search.advance(executor, 20_000)
    parent = rows["parent_niche"].to_numpy()[~rows["lineage"].to_numpy()]
    assert 16 in occupied
    assert set(parent.tolist()) == set(occupied.tolist())
    counts = np.bincount(parent)[occupied]
    assert len(counts) > 8
    assert stats.chisquare(counts).pvalue > 1e-3


def test_random_replacement_makes_the_elite_a_uniform_sample() -> None:
    """Over seeds, the elite's rank among its niche's initial births is uniform."""
    ranks = []
    for seed in range(150):
        config = replace(CONFIG, seed=seed, initial=20, shape=(2, 2), replacement="random")
        search = searched(config, PlanarArm())
        with Threads(1) as executor:
            rows = search.advance(executor, 20).to_pylist()
        elites = search.state.elites
        for niche, uid in zip(elites.niche.tolist(), elites.uid.tolist(), strict=True):
            members = [row["uid"] for row in rows if row["child_niche"] == niche]
            # A uniform number within the rank's slot makes ranks of different sizes comparable.
            slot = np.random.default_rng(seed).random()
            ranks.append((members.index(uid) + slot) / len(members))
    assert stats.kstest(ranks, "uniform").pvalue > 1e-3


class EdgeArm(PlanarArm):
    """Hands on the very edges and corners of 20 cells over bounds that binary cannot write."""

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        plain = super().evaluate(genotypes)
        hand = 1.05 + 0.5 * np.round(20 * (plain.behavior + 1) / 2) / 20
        # Some miss the edge by a rounding error, to either side.
        hand = np.where(np.asarray(genotypes)[:, :1] > 0, np.nextafter(hand, 0), hand)
        return Evaluation(hand, plain.objective, plain.failed, plain.reasons)


@pytest.mark.parametrize("outside", ["state", "clip"])
def test_niches_and_pyribs_agree_on_edges(outside: Any, tmp_path: Path) -> None:
    """An elite kept in another cell than its births would show as a missing or extra niche."""
    config = replace(CONFIG, shape=(20, 20), bounds=((1.05, 1.55),) * 2, outside=outside, scale=1.0)
    finished = run(config, tmp_path, EdgeArm())
    best, _ = fold(config, finished.births)
    assert len(best) > 100
    assert finished.elites.niche.tolist() == sorted(best)
    assert finished.elites.uid.tolist() == [best[niche][1] for niche in sorted(best)]


def test_search_goes_on_where_everybody_was_born_outside(tmp_path: Path) -> None:
    config = replace(CONFIG, bounds=((-0.8, -0.1), (-0.4, 0.4)), evaluations=600, scale=1.0)
    finished = run(config, tmp_path, PlanarArm())
    first = finished.births[: config.initial]
    assert {row["child_niche"] for row in first} == {48}
    second = [row for row in finished.births if row["step"] == 1]
    assert {row["parent_niche"] for row in second} == {48}
    assert len(finished.elites) > 1


class BrokenArm(PlanarArm):
    """An arm that nothing can be done with."""

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        n = len(np.asarray(genotypes))
        return Evaluation(np.full((n, 2), np.nan), np.full(n, np.nan), np.ones(n, bool), ("broken",) * n)


def test_no_birth_can_be_a_parent(tmp_path: Path) -> None:
    config = replace(CONFIG, bounds=((-1.0, -0.5), (-1.0, -0.5)), outside="absorb")
    for _ in range(2):
        with Threads(1) as executor, pytest.raises(NichechainError, match="none of the 90 initial births"):
            build(config, tmp_path, executor)
        # What was born is kept all the same.
        assert len(read.read_births(tmp_path, read.read_meta(tmp_path))) == 90


def test_everybody_fails(tmp_path: Path) -> None:
    message = "all 90 births of the first batch failed, the first because: broken"
    with Threads(1) as executor, pytest.raises(NichechainError, match=message):
        build(CONFIG, tmp_path, executor, domain=BrokenArm())
    # The domain is wrong, not the births: the folder is free for another try.
    assert not read.is_archive(tmp_path)


def test_state_can_be_handed_to_another_search() -> None:
    """Any point to stop at, pending children included, ends in the same births."""
    with Threads(1) as executor:
        whole = searched(CONFIG, TyingArm())
        expected = [row for _ in range(4) for row in whole.advance(executor, 10_000).to_pylist()]
        for limit in (1, 31, 89, 90, 130):
            search = searched(CONFIG, TyingArm())
            rows: list[dict[str, Any]] = []
            while len(rows) < len(expected):
                rows += search.advance(executor, min(limit, len(expected) - len(rows))).to_pylist()
                niches = GridNiches(CONFIG.shape, CONFIG.bounds, CONFIG.outside)
                mutate = variation.make(CONFIG.mutation, CONFIG.scale)
                search = MapElites(TyingArm(), niches, mutate, CONFIG, search.state)
            assert rows == expected
            for name in Elites.__dataclass_fields__:
                np.testing.assert_array_equal(
                    getattr(search.state.elites, name), getattr(whole.state.elites, name)
                )


def test_filled_counts_niches_and_not_the_state_outside() -> None:
    search = searched(CONFIG, PlanarArm())
    assert search.filled == 0
    with Threads(1) as executor:
        for _ in range(5):
            search.advance(executor, 100)
    elites = search.state.elites
    assert elites.niche[-1] == 48
    assert search.filled == len(elites) - 1
