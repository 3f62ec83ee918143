"""What walks remember of where they were: births that enter the novelty archive, and what they count for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from nichechain.core.randomness import Purpose, keyed
from nichechain.walks import Uniform, diversity, run_seed
from nichechain.walks.diversity import ArchiveRule, KNearest

from .samples import ARM, behavior_of, by_birth, walked


def test_the_archive_takes_a_tenth_of_the_offspring():
    result = walked(runs=40, steps=9, domain=ARM)
    # 40 · 10 · 8 · 0.1 = 320 births on average, with a standard deviation of 17.
    assert 240 < result.state.archive.size.sum() < 400
    rows = by_birth(result)
    for run in (0, 39):
        enter = [
            (1 + step * 8 + i, step)
            for step in range(10)
            for i, lot in enumerate(keyed(run_seed(1, run), Purpose.NOVELTY_ARCHIVE, step).random(8))
            if lot < 0.1
        ]
        held = result.state.archive.size[run]
        expected = [behavior_of(rows[run, uid]) for uid, _ in enter]
        np.testing.assert_array_equal(result.state.archive.behavior[run, :held], expected)
        assert result.state.archive.entered[run, :held].tolist() == [step for _, step in enter]


def test_an_archive_takes_no_offspring_that_failed():
    result = walked(Uniform(), archive=ArchiveRule(probability=1.0), steps=10)
    fine = result.births.filter(np.greater(result.births["step"].to_numpy(), 0)).to_pylist()
    fine = [row for row in fine if row["failed"] is None]
    assert result.state.archive.size.sum() == len(fine) < 3 * 11 * 8
    for run, size in enumerate(result.state.archive.size):
        expected = [behavior_of(row) for row in fine if row["run"] == run]
        np.testing.assert_array_equal(result.state.archive.behavior[run, :size], expected)


def test_what_an_archive_holds_fades_with_its_age():
    metric = diversity.KernelDensity(0.4, "length", decay=0.5)
    result = walked(domain=ARM, metric=metric, archive=ArchiveRule(probability=1.0))
    rows = by_birth(result)
    for record in result.records:
        for i, run in enumerate(record.run):
            chosen = rows[run, record.next_uid[i, 0]]
            others = [
                (behavior_of(row), 0.5 ** (chosen["step"] - row["step"]))
                for key, row in rows.items()
                if key[0] == run and 0 < row["step"] <= chosen["step"] and key[1] != chosen["uid"]
            ]
            kernels = [
                weight * multivariate_normal.pdf(behavior_of(chosen), other, 0.16) for other, weight in others
            ]
            assert record.diversity[i, 0] == pytest.approx(-np.mean(kernels))


def test_a_shared_archive_holds_the_selected_of_all_walks():
    rule = ArchiveRule(entry="selected", scope="configuration", limit=7)
    result = walked(domain=ARM, archive=rule)
    chosen = np.concatenate([record.next_behavior[:, 0] for record in result.records])
    np.testing.assert_array_equal(result.state.archive.behavior, chosen[None, -7:])
    assert result.state.archive.entered.tolist() == [[2, 3, 3, 3, 4, 4, 4]]


def test_an_archive_is_asked_before_it_is_added_to():
    """With every offspring entering at once, the first step would score each beside its own copy."""
    config = {"domain": ARM, "metric": KNearest(1), "steps": 0}
    full = walked(archive=ArchiveRule(probability=1.0), **config).series("diversity")
    without = walked(**{**config, "metric": KNearest(1, archive=False)}).series("diversity")
    np.testing.assert_array_equal(full, without)
    assert (full > 0).all()


def test_a_metric_without_memory_keeps_no_archive():
    result = walked(metric=diversity.make("knn-no-archive"), archive=ArchiveRule(probability=1.0))
    assert result.state.archive.size.tolist() == [0, 0, 0]
