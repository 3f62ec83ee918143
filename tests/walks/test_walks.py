"""Walks: their laws to the last bit, their births replayed, every step checked by brute force."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
from scipy.spatial import distance
from scipy.stats import multivariate_normal

from nichechain import NichechainError, landscape, variation
from nichechain.births.table import schema
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains import PlanarArm
from nichechain.domains.base import Evaluation
from nichechain.execution import Threads
from nichechain.niches import GridNiches
from nichechain.walks import (
    AtLeast,
    BetterThanParent,
    Selective,
    TopFraction,
    Uniform,
    WalkConfig,
    Walks,
    WalkState,
    diversity,
    draw_starts,
    run_seed,
    walk,
)
from nichechain.walks.diversity import ArchiveRule, KNearest, ParentDistance


class RoughArm(PlanarArm):
    """An arm whose hand snaps to a coarse lattice, so that offspring tie, and which sometimes breaks."""

    chunk = 7

    def evaluate(self, genotypes):
        """Fail where the first joint is far from its rest."""
        fine = super().evaluate(genotypes)
        failed = np.abs(np.asarray(genotypes)[:, 0]) > 0.8
        behavior = np.round(fine.behavior * 4) / 4
        behavior[failed] = np.nan
        reasons = tuple("broken" if bad else "" for bad in failed)
        return Evaluation(behavior, np.where(failed, np.nan, fine.objective), failed, reasons)


ARM = PlanarArm()
ROUGH = RoughArm()
MUTATE = variation.gaussian(0.2)
NICHES = GridNiches((5, 5), ARM.bounds)


def _walk(selection=None, *, domain=ROUGH, runs=3, steps=4, niches=NICHES, **values):
    config = WalkConfig(selection=selection or Selective(), **{"offspring": 8, "seed": 1, **values})
    return walk(domain, MUTATE, config, runs=runs, steps=steps, niches=niches)


def _by_birth(result):
    """(run, uid) → row of the births."""
    return {(row["run"], row["uid"]): row for row in result.births.to_pylist()}


def _behavior(row):
    return np.array([row["behavior_0"], row["behavior_1"]], float)


@pytest.mark.parametrize("metric", ["knn", "kde", "ancestors"])
@pytest.mark.parametrize("variant", [{}, {"other_niche": True}, {"states": 3}])
def test_adaptive_walks_end_in_the_random_and_the_selective_one(metric, variant):
    common = {"metric": diversity.make(metric), **variant}
    assert _walk(TopFraction(1.0), **common).births.equals(_walk(Uniform(), **common).births)
    # Three states and their children are 27 individuals, of whom 3 are selected.
    share = 3 / 27 if "states" in variant else 1 / 8
    narrow, selective = _walk(TopFraction(share), **common), _walk(Selective(), **common)
    assert narrow.births.equals(selective.births)
    assert narrow.table().equals(selective.table())


def test_pressure_changes_the_walk():
    walks = [_walk(rule).births for rule in (Selective(), TopFraction(0.5), Uniform())]
    assert not walks[0].equals(walks[1])
    assert not walks[1].equals(walks[2])


@pytest.mark.parametrize("metric", ["knn", "kde", "ancestors", "parent"])
@pytest.mark.parametrize("states", [None, 2])
def test_a_run_is_the_same_alone_and_in_company(metric, states):
    values = {"metric": diversity.make(metric), "states": states, "domain": ARM, "offspring": 9}
    together = _walk(TopFraction(0.3), runs=5, **values)
    alone = _walk(TopFraction(0.3), runs=[3], **values)
    for own, all_runs in ((alone.births, together.births), (alone.table(), together.table())):
        assert own.equals(all_runs.filter(np.equal(all_runs["run"].to_numpy(), 3)))


def test_workers_change_nothing():
    config = WalkConfig(offspring=8, seed=2)
    here = walk(ROUGH, MUTATE, config, runs=3, steps=3)
    with Threads(2) as threads:
        there = walk(ROUGH, MUTATE, config, runs=3, steps=3, executor=threads)
    assert here.births.equals(there.births)
    assert here.table().equals(there.table())


def test_a_walk_goes_on_from_a_file():
    config = WalkConfig(
        selection=TopFraction(0.5), offspring=8, archive=ArchiveRule(limit=5, probability=0.5)
    )
    walks = Walks(ROUGH, MUTATE, config, NICHES)
    state, _ = walks.start(4)
    for _ in range(3):
        state = walks.advance(state).state
    file = io.BytesIO()
    np.savez(file, **state.arrays())
    file.seek(0)
    with np.load(file, allow_pickle=False) as arrays:
        restored = WalkState.from_arrays(arrays)
    for _ in range(3):
        before, after = walks.advance(state), walks.advance(restored)
        assert before.births.equals(after.births)
        assert before.record.table().equals(after.record.table())
        state, restored = before.state, after.state


def test_steps_states_and_evaluations():
    result = _walk(runs=3, steps=4)
    assert len(result.records) == 5
    assert [record.step for record in result.records] == [0, 1, 2, 3, 4]
    assert result.births.num_rows == 3 * (1 + 5 * 8)
    assert result.series("expected_evolvability").shape == (5, 3, 1)
    assert result.table().num_rows == 15
    assert _walk(steps=0).births.num_rows == 3 * (1 + 8)
    # A longer walk is the shorter one, continued.
    assert _walk(steps=6).births.slice(0, result.births.num_rows).equals(result.births)


@pytest.mark.parametrize("states", [None, 3])
def test_any_birth_is_replayed_from_its_root(states):
    result = _walk(TopFraction(0.5), states=states)
    assert result.births.schema.equals(schema(2))
    rows = _by_birth(result)
    genotypes = {}
    for (run, uid), row in sorted(rows.items()):
        seed = run_seed(1, run)
        if row["parent_uid"] is None:
            assert (row["step"], row["depth"], row["parent_niche"]) == (0, 0, None)
            genotypes[run, uid] = ROUGH.sample(states or 1, seed=keyed(seed, Purpose.INITIAL))[uid]
            continue
        parent = rows[run, row["parent_uid"]]
        assert (row["depth"], row["parent_niche"]) == (parent["depth"] + 1, parent["child_niche"])
        assert parent["accepted"]
        parents_genotype = genotypes[run, row["parent_uid"]]
        genotypes[run, uid] = MUTATE(parents_genotype, keyed(seed, Purpose.MUTATION, uid))
    replayed = ROUGH.evaluate(np.stack(list(genotypes.values())))
    for number, (key, row) in enumerate(sorted(rows.items())):
        assert (row["failed"] is not None) == replayed.failed[number]
        np.testing.assert_array_equal(_behavior(row), replayed.behavior[number])
        niche = None if replayed.failed[number] else NICHES.of(replayed.behavior[[number]])[0]
        assert row["child_niche"] == niche, key
    for run, genotype, uid in zip(result.state.run, result.state.genotype, result.state.uid, strict=True):
        for place, number in enumerate(uid):
            np.testing.assert_array_equal(genotype[place], genotypes[run, number])


def test_records_are_measures_of_the_births():
    result = _walk(TopFraction(0.5))
    rows = _by_birth(result)
    for record in result.records:
        for i, run in enumerate(record.run):
            family = [
                row
                for row in rows.values()
                if (row["run"], row["step"], row["parent_uid"]) == (run, record.step + 1, record.uid[i, 0])
            ]
            offspring = np.stack([_behavior(row) for row in family])
            parent = _behavior(rows[run, record.uid[i, 0]])
            np.testing.assert_array_equal(record.behavior[i, 0], parent)
            alive = [row for row in family if row["failed"] is None]
            assert record.sample_size[i, 0] == len(alive)
            assert record.expected_evolvability[i, 0] == landscape.expected_evolvability(offspring)
            assert record.evolvability[i, 0] == landscape.evolvability(offspring)
            assert record.local_sensitivity[i, 0] == landscape.local_sensitivity(parent, offspring)
            assert record.expected_local_sensitivity[i, 0] == landscape.expected_local_sensitivity(
                parent, offspring
            )
            inside = {row["child_niche"] for row in alive if row["child_niche"] < len(NICHES)}
            assert record.coverage[i, 0] == len(inside) / len(NICHES)
            (chosen,) = [row["uid"] for row in family if row["accepted"]]
            assert record.next_uid[i, 0] == chosen
            np.testing.assert_array_equal(record.next_behavior[i, 0], _behavior(rows[run, chosen]))


def test_a_selective_walk_takes_the_offspring_farthest_from_the_parent():
    result = _walk(domain=ARM, metric=ParentDistance())
    rows = _by_birth(result)
    for record in result.records:
        np.testing.assert_allclose(record.diversity, record.local_sensitivity, rtol=1e-14)
    for row in rows.values():
        if row["accepted"] and row["parent_uid"] is not None:
            siblings = [r for r in rows.values() if (r["run"], r["step"]) == (row["run"], row["step"])]
            parent = _behavior(rows[row["run"], row["parent_uid"]])
            away = [np.linalg.norm(_behavior(r) - parent) for r in siblings]
            assert siblings[int(np.argmax(away))]["uid"] == row["uid"]


def test_a_multi_state_walk_keeps_the_best_of_parents_and_children():
    result = _walk(domain=ARM, states=3, offspring=4, metric=KNearest(5, archive=False))
    rows = _by_birth(result)
    for record in result.records:
        for i, run in enumerate(record.run):
            uids = record.uid[i].tolist()
            uids += [
                row["uid"] for row in rows.values() if (row["run"], row["step"]) == (run, record.step + 1)
            ]
            behaviors = np.stack([_behavior(rows[run, uid]) for uid in uids])
            away = np.sort(distance.cdist(behaviors, behaviors), axis=1)[:, 1:6].sum(axis=1)
            best = np.argsort(away)[-3:]
            assert sorted(record.next_uid[i]) == sorted(uids[j] for j in best)
            assert sorted(record.diversity[i]) == pytest.approx(sorted(away[best]))
            assert record.population_evolvability[i] == pytest.approx(
                distance.pdist(record.next_behavior[i]).mean()
            )


def test_places_without_a_candidate_keep_the_best_of_the_states():
    metric = KNearest(5, archive=False)
    result = _walk(AtLeast(1.6), domain=ARM, states=3, offspring=4, metric=metric, steps=8)
    rows = _by_birth(result)
    kept = 0
    for record in result.records:
        for i, run in enumerate(record.run):
            children = [uid for number, uid in rows if number == run and 3 <= uid - 12 * record.step < 15]
            uids = np.array([*record.uid[i], *children])
            behaviors = np.stack([_behavior(rows[run, uid]) for uid in uids])
            away = np.sort(distance.cdist(behaviors, behaviors), axis=1)[:, 1:6].sum(axis=1)
            passing = set(uids[away >= 1.6].tolist())
            missing = max(0, 3 - len(passing))
            assert record.stalled[i] == missing
            if missing:
                left = [j for j in np.argsort(away[:3])[::-1] if uids[j] not in passing]
                stay = {uids[j] for j in left[:missing]}
                assert set(record.next_uid[i].tolist()) == passing | stay
                kept += missing < len(left)
            else:
                assert set(record.next_uid[i].tolist()) <= passing
    # There were places that only some of the states could keep.
    assert kept > 3


def test_a_threshold_that_nobody_reaches_stalls_the_walk():
    result = _walk(AtLeast(1e9))
    assert result.state.stalls.tolist() == [5, 5, 5]
    assert (result.state.uid == 0).all()
    assert (result.series("stalled") == 1).all()
    assert np.isnan(result.series("diversity")).all()
    assert not any(row["accepted"] for row in result.births.to_pylist() if row["step"])
    # Each step samples offspring anew.
    assert len(set(result.series("expected_evolvability")[:, 0, 0])) > 1
    # All offspring are children of the start.
    assert set(result.births["depth"].to_pylist()) == {0, 1}
    np.testing.assert_array_equal(result.state.path, np.repeat(result.state.path[:, :, :1], 6, axis=2))


def test_a_constant_threshold_lets_pass_what_reaches_it():
    result = _walk(AtLeast(0.7), domain=ARM, metric=ParentDistance(), steps=8)
    found, stalled = result.series("diversity")[:, :, 0], result.series("stalled") == 1
    assert (found[~stalled] >= 0.7).all()
    farthest = result.series("local_sensitivity")[:, :, 0]
    # It stalls exactly where no offspring is that far, and both happen.
    assert ((farthest < 0.7) == stalled).all()
    assert 0 < stalled.sum() < stalled.size


@pytest.mark.parametrize("strict", [True, False])
def test_better_than_the_parent(strict):
    result = _walk(BetterThanParent(strict), metric=diversity.AncestorDistance(), steps=8, runs=6)
    equal = 0
    for before in result.records:
        path = result.state.path[:, :, : before.step + 1]
        here = diversity.ancestor_distance(before.behavior, path, [0])
        moved = before.stalled == 0
        better = before.diversity[moved] > here[moved]
        equal += np.count_nonzero(before.diversity[moved] == here[moved])
        assert better.all() or not strict
        assert (before.diversity[moved] >= here[moved]).all()
    assert (equal == 0) == strict


@pytest.mark.parametrize("selection", [Selective(), TopFraction(0.3), Uniform(), AtLeast(0.1)])
def test_the_niche_variant_moves_to_another_niche_or_stays(selection):
    niches = GridNiches((2, 2), ARM.bounds)
    result = _walk(selection, niches=niches, other_niche=True, steps=12, offspring=3)
    niche = np.concatenate([result.series("niche"), result.state.niche[None]])[:, :, 0]
    stalled = result.series("stalled") == 1
    assert ((niche[1:] == niche[:-1]) == stalled).all()
    assert 0 < stalled.sum() < stalled.size


def test_niches_that_absorb_are_not_left_by_the_niche_variant():
    small = ((0.9, 1.0), (-0.2, 0.2))
    for outside, leaves in (("state", True), ("absorb", False)):
        niches = GridNiches((3, 3), small, outside)
        result = _walk(niches=niches, domain=ARM, other_niche=True)
        assert (result.state.niche == len(niches)).any() == leaves


@pytest.mark.parametrize("selection", [Selective(), TopFraction(0.5), Uniform()])
def test_offspring_that_failed_are_never_selected(selection):
    result = _walk(selection, steps=10)
    rows = result.births.to_pylist()
    assert sum(row["failed"] is not None for row in rows) > 5
    assert not any(row["accepted"] for row in rows if row["failed"] is not None)
    assert np.isfinite(result.state.path).all()


def test_a_walk_whose_offspring_all_fail_stays():
    def breaking(parent, rng):  # noqa: ARG001
        return np.full_like(parent, np.nan)

    result = walk(ARM, breaking, WalkConfig(selection=Uniform(), offspring=4), runs=2, steps=3)
    assert result.state.stalls.tolist() == [4, 4]
    assert np.isnan(result.series("expected_evolvability")).all()
    assert (result.series("sample_size") == 0).all()


def test_the_archive_takes_a_tenth_of_the_offspring():
    result = _walk(runs=40, steps=9, domain=ARM)
    # 40 · 10 · 8 · 0.1 = 320 births on average, with a standard deviation of 17.
    assert 240 < result.state.archive.size.sum() < 400
    rows = _by_birth(result)
    for run in (0, 39):
        enter = [
            (1 + step * 8 + i, step)
            for step in range(10)
            for i, lot in enumerate(keyed(run_seed(1, run), Purpose.NOVELTY_ARCHIVE, step).random(8))
            if lot < 0.1
        ]
        held = result.state.archive.size[run]
        expected = [_behavior(rows[run, uid]) for uid, _ in enter]
        np.testing.assert_array_equal(result.state.archive.behavior[run, :held], expected)
        assert result.state.archive.entered[run, :held].tolist() == [step for _, step in enter]


def test_an_archive_takes_no_offspring_that_failed():
    result = _walk(Uniform(), archive=ArchiveRule(probability=1.0), steps=10)
    fine = result.births.filter(np.greater(result.births["step"].to_numpy(), 0)).to_pylist()
    fine = [row for row in fine if row["failed"] is None]
    assert result.state.archive.size.sum() == len(fine) < 3 * 11 * 8
    for run, size in enumerate(result.state.archive.size):
        expected = [_behavior(row) for row in fine if row["run"] == run]
        np.testing.assert_array_equal(result.state.archive.behavior[run, :size], expected)


def test_what_an_archive_holds_fades_with_its_age():
    metric = diversity.KernelDensity(0.4, "length", decay=0.5)
    result = _walk(domain=ARM, metric=metric, archive=ArchiveRule(probability=1.0))
    rows = _by_birth(result)
    for record in result.records:
        for i, run in enumerate(record.run):
            chosen = rows[run, record.next_uid[i, 0]]
            others = [
                (_behavior(row), 0.5 ** (chosen["step"] - row["step"]))
                for key, row in rows.items()
                if key[0] == run and 0 < row["step"] <= chosen["step"] and key[1] != chosen["uid"]
            ]
            kernels = [
                weight * multivariate_normal.pdf(_behavior(chosen), other, 0.16) for other, weight in others
            ]
            assert record.diversity[i, 0] == pytest.approx(-np.mean(kernels))


def test_a_shared_archive_holds_the_selected_of_all_walks():
    rule = ArchiveRule(entry="selected", scope="configuration", limit=7)
    result = _walk(domain=ARM, archive=rule)
    chosen = np.concatenate([record.next_behavior[:, 0] for record in result.records])
    np.testing.assert_array_equal(result.state.archive.behavior, chosen[None, -7:])
    assert result.state.archive.entered.tolist() == [[2, 3, 3, 3, 4, 4, 4]]


def test_an_archive_is_asked_before_it_is_added_to():
    """With every offspring entering at once, the first step would score each beside its own copy."""
    config = {"domain": ARM, "metric": KNearest(1), "steps": 0}
    full = _walk(archive=ArchiveRule(probability=1.0), **config).series("diversity")
    without = _walk(**{**config, "metric": KNearest(1, archive=False)}).series("diversity")
    np.testing.assert_array_equal(full, without)
    assert (full > 0).all()


def test_a_metric_without_memory_keeps_no_archive():
    result = _walk(metric=diversity.make("knn-no-archive"), archive=ArchiveRule(probability=1.0))
    assert result.state.archive.size.tolist() == [0, 0, 0]


def test_walks_start_where_they_are_told():
    genotypes = ARM.sample(4, seed=9)
    config = WalkConfig(offspring=3)
    result = walk(ARM, MUTATE, config, runs=4, steps=0, genotypes=genotypes)
    np.testing.assert_array_equal(result.records[0].behavior[:, 0], ARM.evaluate(genotypes).behavior)
    starts = draw_starts(genotypes, config, 300)
    numbers = [int(np.flatnonzero((genotypes == row).all(axis=1))[0]) for row in starts]
    # Each of four is drawn 75 times on average, with a standard deviation of 7.5.
    assert np.bincount(numbers, minlength=4).min() > 45
    np.testing.assert_array_equal(draw_starts(genotypes, config, [7])[0], starts[7])
    assert draw_starts(genotypes, dataclasses.replace(config, states=2), 5).shape == (5, 2, 10)


def test_runs_differ_and_seeds_differ():
    result = _walk(domain=ARM)
    assert len({tuple(row) for row in result.state.behavior[:, 0].tolist()}) == 3
    assert not result.births.equals(_walk(domain=ARM, seed=2).births)
    assert run_seed(1, 2) != run_seed(2, 1)


def _start(genotypes, runs=2, **values):
    return walk(ARM, MUTATE, WalkConfig(**values), runs=runs, steps=0, genotypes=genotypes)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: WalkConfig(offspring=0), "offspring is 0"),
        (lambda: WalkConfig(states=0), "states is 0"),
        (lambda: WalkConfig(seed=-1), "seed is -1"),
        (lambda: Walks(ARM, MUTATE, WalkConfig(other_niche=True)), "needs niches: none are given"),
        (lambda: _start(np.zeros((2, 9))), r"shape \(2, 9\), but must be \(2, 10\)"),
        (lambda: _start(np.zeros((3, 10))), r"shape \(3, 10\), but must be \(2, 10\)"),
        (lambda: _start(np.zeros((2, 10)), states=3), r"must be \(2, 3, 10\)"),
        (
            lambda: _start(np.array([[0.0] * 10, [np.inf] * 10])),
            "start genotype of run 1 failed to evaluate: genotype is not finite",
        ),
        (lambda: _start(None, runs=0), "runs is 0"),
        (lambda: _start(None, runs=[]), r"runs is \[\]"),
        (lambda: _start(None, runs=[0, -1]), r"runs is \[0, -1\]"),
        (lambda: walk(ARM, MUTATE, WalkConfig(), runs=1, steps=-1), "steps is -1"),
        (lambda: draw_starts(np.zeros((0, 10)), WalkConfig(), 2), r"\(K, P\) with K at least 1"),
        (
            lambda: _start(None, metric=diversity.KernelDensity(((1.0,),), "matrix")),
            r"shape \(1, 1\), but behavior needs \(2, 2\)",
        ),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()
