"""Walks that select for evolvability: scores by hand, and every step against its births."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import NichechainError, variation
from nichechain.births.table import NONE
from nichechain.core.randomness import Purpose, keyed
from nichechain.execution import Threads
from nichechain.niches import GridNiches
from nichechain.walks import BetterThanParent, Selective, TopFraction, WalkConfig, Walks, run_seed, walk
from nichechain.walks.diversity import OffspringNiches, Surroundings

from ...arms import BrittleArm
from ...choices import mean_distinct

ARM = BrittleArm()
MUTATE = variation.gaussian(0.2)
NICHES = GridNiches((6, 6), ARM.bounds)


def walked(selection=None, *, metric=None, executor=None, runs=3, steps=3, **values):
    config = WalkConfig(
        selection=selection or Selective(), metric=metric or OffspringNiches(5), offspring=6, seed=1, **values
    )
    return walk(ARM, MUTATE, config, runs=runs, steps=steps, niches=NICHES, executor=executor)


def test_a_score_is_the_mean_over_all_choices_of_offspring():
    litters = np.array([[[3, 3, 8, NONE, 1], [3, 3, 3, 3, 3], [0, 1, 2, 3, 4]]])
    query = np.zeros((1, 3, 2))
    query[0, 2] = np.nan
    nothing = np.zeros((1, 0, 2))
    # 8 is outside.
    around = Surroundings(
        nothing, nothing, np.zeros((1, 0), int), nothing[None], np.ones(2), litters=litters, niches=8
    )
    score = OffspringNiches(5, 3)(query, np.zeros(3, int), np.arange(3), around)
    expected = mean_distinct(litters[0, 0], 3, nowhere=(8, NONE))
    np.testing.assert_allclose(score, [[expected, 1.0, np.nan]])


@pytest.mark.parametrize("states", [None, 2])
def test_a_selective_walk_takes_who_has_offspring_in_most_niches(states):
    result = walked(states=states)
    rows = result.births.to_pylist()
    followed = 0
    for record in result.records:
        for i, run in enumerate(record.run):
            born = [row for row in rows if row["run"] == run and row["step"] == record.step + 1]
            here = set(record.uid[i].tolist())
            # The first six of each state are its children, and the next five those that judge it.
            children = [row["uid"] for row in born if row["parent_uid"] in here]
            children = [uid for uid in children if uid < min(children) + 6 * len(here)]
            by = {}
            for row in born:
                if row["uid"] not in children:
                    by.setdefault(row["parent_uid"], []).append(row["child_niche"])
            assert all(len(landed) == 5 for landed in by.values())
            score = {
                uid: len({niche for niche in landed if niche is not None and niche < 36})
                for uid, landed in by.items()
            }
            candidates = [uid for uid in score if states or uid in children]
            best = sorted((score[uid] for uid in candidates), reverse=True)[: len(here)]
            assert sorted(record.diversity[i].tolist(), reverse=True) == best
            assert sorted((score[uid] for uid in record.next_uid[i].tolist()), reverse=True) == best
            failed = [row["uid"] for row in born if row["uid"] in children and row["failed"]]
            assert not set(failed) & set(by)
            followed += len(failed)
    assert followed > 0


def test_births_that_judge_are_replayed_from_their_parents():
    result = walked(TopFraction(0.5))
    rows = {(row["run"], row["uid"]): row for row in result.births.to_pylist()}
    assert len(rows) == result.births.num_rows
    genotypes = {}
    for (run, uid), row in sorted(rows.items()):
        seed = run_seed(1, run)
        if row["parent_uid"] is None:
            genotypes[run, uid] = ARM.sample(1, seed=keyed(seed, Purpose.INITIAL))[0]
        else:
            parent = rows[run, row["parent_uid"]]
            assert (row["depth"], row["parent_niche"]) == (parent["depth"] + 1, parent["child_niche"])
            genotypes[run, uid] = MUTATE(
                genotypes[run, row["parent_uid"]], keyed(seed, Purpose.MUTATION, uid)
            )
    again = ARM.evaluate(np.stack(list(genotypes.values())))
    behavior = [[rows[key]["behavior_0"], rows[key]["behavior_1"]] for key in genotypes]
    np.testing.assert_array_equal(np.array(behavior, float), again.behavior)


def test_workers_company_and_length_change_nothing():
    whole = walked(steps=3)
    with Threads(2) as executor:
        assert walked(steps=3, executor=executor).births.equals(whole.births)
    alone = walked(runs=[2], steps=3).births
    assert alone.equals(whole.births.filter(np.equal(whole.births["run"].to_numpy(), 2)))
    shorter = walked(steps=1).births
    assert whole.births.slice(0, shorter.num_rows).equals(shorter)


def test_it_climbs_evolvability():
    """Children of the selected reach more niches than those of a random walk, by offspring of their own."""
    metric = OffspringNiches(10)
    climbing = walked(metric=metric, runs=20, steps=6).series("coverage")[-1].mean()
    drifting = walked(TopFraction(1.0), metric=metric, runs=20, steps=6).series("coverage")[-1].mean()
    assert climbing > drifting


def test_a_state_is_scored_as_its_children_are():
    result = walked(BetterThanParent(), runs=4, steps=5)
    moved = result.series("stalled") == 0
    assert 0 < moved.sum() < moved.size


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: OffspringNiches(0), "offspring is 0, but must be at least 1"),
        (lambda: OffspringNiches(5, 6), "lineages is 6, but must be at most 5"),
        (lambda: OffspringNiches(5, 0), "lineages is 0, but must be at least 1"),
        (
            lambda: Walks(ARM, MUTATE, WalkConfig(metric=OffspringNiches())),
            "metric counts the niches of offspring, but no niches are given",
        ),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()
