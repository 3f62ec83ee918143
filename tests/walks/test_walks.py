"""Walks: their laws to the last bit, their births replayed, their records measured again."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest

from nichechain import NichechainError, landscape
from nichechain.births.table import schema
from nichechain.core.randomness import Purpose, keyed
from nichechain.execution import Threads
from nichechain.walks import (
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
from nichechain.walks.diversity import ArchiveRule

from .samples import ARM, LATTICE, MUTATE, NICHES, behavior_of, by_birth, walked


@pytest.mark.parametrize("metric", ["knn", "kde", "ancestors"])
@pytest.mark.parametrize("variant", [{}, {"other_niche": True}, {"states": 3}])
def test_adaptive_walks_end_in_the_random_and_the_selective_one(metric, variant):
    common = {"metric": diversity.make(metric), **variant}
    assert walked(TopFraction(1.0), **common).births.equals(walked(Uniform(), **common).births)
    # Three states and their children are 27 individuals, of whom 3 are selected.
    share = 3 / 27 if "states" in variant else 1 / 8
    narrow, selective = walked(TopFraction(share), **common), walked(Selective(), **common)
    assert narrow.births.equals(selective.births)
    assert narrow.table().equals(selective.table())


def test_pressure_changes_the_walk():
    walks = [walked(rule).births for rule in (Selective(), TopFraction(0.5), Uniform())]
    assert not walks[0].equals(walks[1])
    assert not walks[1].equals(walks[2])


@pytest.mark.parametrize("metric", ["knn", "kde", "ancestors", "parent"])
@pytest.mark.parametrize("states", [None, 2])
def test_a_run_is_the_same_alone_and_in_company(metric, states):
    values = {"metric": diversity.make(metric), "states": states, "domain": ARM, "offspring": 9}
    together = walked(TopFraction(0.3), runs=5, **values)
    alone = walked(TopFraction(0.3), runs=[3], **values)
    for own, all_runs in ((alone.births, together.births), (alone.table(), together.table())):
        assert own.equals(all_runs.filter(np.equal(all_runs["run"].to_numpy(), 3)))


def test_workers_change_nothing():
    config = WalkConfig(offspring=8, seed=2)
    here = walk(LATTICE, MUTATE, config, runs=3, steps=3)
    with Threads(2) as threads:
        there = walk(LATTICE, MUTATE, config, runs=3, steps=3, executor=threads)
    assert here.births.equals(there.births)
    assert here.table().equals(there.table())


def test_a_walk_goes_on_from_a_file():
    config = WalkConfig(
        selection=TopFraction(0.5), offspring=8, archive=ArchiveRule(limit=5, probability=0.5)
    )
    walks = Walks(LATTICE, MUTATE, config, NICHES)
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
    result = walked(runs=3, steps=4)
    assert len(result.records) == 5
    assert [record.step for record in result.records] == [0, 1, 2, 3, 4]
    assert result.births.num_rows == 3 * (1 + 5 * 8)
    assert result.series("expected_evolvability").shape == (5, 3, 1)
    assert result.table().num_rows == 15
    assert walked(steps=0).births.num_rows == 3 * (1 + 8)
    # A longer walk is the shorter one, continued.
    assert walked(steps=6).births.slice(0, result.births.num_rows).equals(result.births)


@pytest.mark.parametrize("states", [None, 3])
def test_any_birth_is_replayed_from_its_root(states):
    result = walked(TopFraction(0.5), states=states)
    assert result.births.schema.equals(schema(2))
    rows = by_birth(result)
    genotypes = {}
    for (run, uid), row in sorted(rows.items()):
        seed = run_seed(1, run)
        if row["parent_uid"] is None:
            assert (row["step"], row["depth"], row["parent_niche"]) == (0, 0, None)
            genotypes[run, uid] = LATTICE.sample(states or 1, seed=keyed(seed, Purpose.INITIAL))[uid]
            continue
        parent = rows[run, row["parent_uid"]]
        assert (row["depth"], row["parent_niche"]) == (parent["depth"] + 1, parent["child_niche"])
        assert parent["accepted"]
        parents_genotype = genotypes[run, row["parent_uid"]]
        genotypes[run, uid] = MUTATE(parents_genotype, keyed(seed, Purpose.MUTATION, uid))
    replayed = LATTICE.evaluate(np.stack(list(genotypes.values())))
    for number, (key, row) in enumerate(sorted(rows.items())):
        assert (row["failed"] is not None) == replayed.failed[number]
        np.testing.assert_array_equal(behavior_of(row), replayed.behavior[number])
        niche = None if replayed.failed[number] else NICHES.of(replayed.behavior[[number]])[0]
        assert row["child_niche"] == niche, key
    for run, genotype, uid in zip(result.state.run, result.state.genotype, result.state.uid, strict=True):
        for place, number in enumerate(uid):
            np.testing.assert_array_equal(genotype[place], genotypes[run, number])


def test_records_are_measures_of_the_births():
    result = walked(TopFraction(0.5))
    rows = by_birth(result)
    for record in result.records:
        for i, run in enumerate(record.run):
            family = [
                row
                for row in rows.values()
                if (row["run"], row["step"], row["parent_uid"]) == (run, record.step + 1, record.uid[i, 0])
            ]
            offspring = np.stack([behavior_of(row) for row in family])
            parent = behavior_of(rows[run, record.uid[i, 0]])
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
            np.testing.assert_array_equal(record.next_behavior[i, 0], behavior_of(rows[run, chosen]))


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
    result = walked(domain=ARM)
    assert len({tuple(row) for row in result.state.behavior[:, 0].tolist()}) == 3
    assert not result.births.equals(walked(domain=ARM, seed=2).births)
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
