"""Every step of a walk by brute force: who is selected, and who stays where nobody can be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import distance

from nichechain.niches import GridNiches
from nichechain.walks import (
    AtLeast,
    BetterThanParent,
    Selective,
    TopFraction,
    Uniform,
    WalkConfig,
    diversity,
    walk,
)
from nichechain.walks.diversity import KNearest, ParentDistance

from .samples import ARM, behavior_of, by_birth, walked


def test_a_selective_walk_takes_the_offspring_farthest_from_the_parent():
    result = walked(domain=ARM, metric=ParentDistance())
    rows = by_birth(result)
    for record in result.records:
        np.testing.assert_allclose(record.diversity, record.local_sensitivity, rtol=1e-14)
    for row in rows.values():
        if row["accepted"] and row["parent_uid"] is not None:
            siblings = [r for r in rows.values() if (r["run"], r["step"]) == (row["run"], row["step"])]
            parent = behavior_of(rows[row["run"], row["parent_uid"]])
            away = [np.linalg.norm(behavior_of(r) - parent) for r in siblings]
            assert siblings[int(np.argmax(away))]["uid"] == row["uid"]


def test_a_multi_state_walk_keeps_the_best_of_parents_and_children():
    result = walked(domain=ARM, states=3, offspring=4, metric=KNearest(5, archive=False))
    rows = by_birth(result)
    for record in result.records:
        for i, run in enumerate(record.run):
            uids = record.uid[i].tolist()
            uids += [
                row["uid"] for row in rows.values() if (row["run"], row["step"]) == (run, record.step + 1)
            ]
            behaviors = np.stack([behavior_of(rows[run, uid]) for uid in uids])
            away = np.sort(distance.cdist(behaviors, behaviors), axis=1)[:, 1:6].sum(axis=1)
            best = np.argsort(away)[-3:]
            assert sorted(record.next_uid[i]) == sorted(uids[j] for j in best)
            assert sorted(record.diversity[i]) == pytest.approx(sorted(away[best]))
            assert record.population_evolvability[i] == pytest.approx(
                distance.pdist(record.next_behavior[i]).mean()
            )


def test_places_without_a_candidate_keep_the_best_of_the_states():
    metric = KNearest(5, archive=False)
    result = walked(AtLeast(1.6), domain=ARM, states=3, offspring=4, metric=metric, steps=8)
    rows = by_birth(result)
    kept = 0
    for record in result.records:
        for i, run in enumerate(record.run):
            children = [uid for number, uid in rows if number == run and 3 <= uid - 12 * record.step < 15]
            uids = np.array([*record.uid[i], *children])
            behaviors = np.stack([behavior_of(rows[run, uid]) for uid in uids])
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
    result = walked(AtLeast(1e9))
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
    result = walked(AtLeast(0.7), domain=ARM, metric=ParentDistance(), steps=8)
    found, stalled = result.series("diversity")[:, :, 0], result.series("stalled") == 1
    assert (found[~stalled] >= 0.7).all()
    farthest = result.series("local_sensitivity")[:, :, 0]
    # It stalls exactly where no offspring is that far, and both happen.
    assert ((farthest < 0.7) == stalled).all()
    assert 0 < stalled.sum() < stalled.size


@pytest.mark.parametrize("strict", [True, False])
def test_better_than_the_parent(strict):
    result = walked(BetterThanParent(strict), metric=diversity.AncestorDistance(), steps=8, runs=6)
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
    result = walked(selection, niches=niches, other_niche=True, steps=12, offspring=3)
    niche = np.concatenate([result.series("niche"), result.state.niche[None]])[:, :, 0]
    stalled = result.series("stalled") == 1
    assert ((niche[1:] == niche[:-1]) == stalled).all()
    assert 0 < stalled.sum() < stalled.size


def test_niches_that_absorb_are_not_left_by_the_niche_variant():
    small = ((0.9, 1.0), (-0.2, 0.2))
    for outside, leaves in (("state", True), ("absorb", False)):
        niches = GridNiches((3, 3), small, outside)
        result = walked(niches=niches, domain=ARM, other_niche=True)
        assert (result.state.niche == len(niches)).any() == leaves


@pytest.mark.parametrize("selection", [Selective(), TopFraction(0.5), Uniform()])
def test_offspring_that_failed_are_never_selected(selection):
    result = walked(selection, steps=10)
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
