"""The landscape of an archive: each elite as if measured alone, whatever happens on the way."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from nichechain import NichechainError, build, landscape, load, variation
from nichechain.domains import Noise, Noisy, PlanarArm
from nichechain.execution import Threads
from nichechain.landscape import MEASURES, measure_archive, sampling
from nichechain.search.config import BuildConfig

ARM = BuildConfig(
    "arm", (6, 5), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=400, initial=50, batch=32, scale=0.2, seed=2
)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """An archive with an elite outside."""
    folder = tmp_path_factory.mktemp("arm")
    with Threads(1) as executor:
        build(ARM, folder, executor)
    archive = load(folder)
    assert archive.elites.niche[-1] == len(archive.niches)
    return archive


@pytest.fixture(scope="module")
def measured(arm):
    return measure_archive(arm, 6, seed=4)


class Interrupted:
    """An executor that is interrupted before one of its batches, and counts what it evaluates."""

    def __init__(self, batches=None):
        self.batches = batches
        self.evaluated = 0

    def evaluate(self, domain, genotypes, on_done=None):
        if self.batches == 0:
            raise KeyboardInterrupt
        if self.batches is not None:
            self.batches -= 1
        self.evaluated += len(genotypes)
        if on_done is not None:
            on_done(len(genotypes))
        return domain.evaluate(genotypes)


def test_every_elite_is_measured_as_if_alone(arm, measured):
    assert measured.state.tolist() == arm.elites.niche.tolist()
    frame = measured.frame()
    for row, genotype in enumerate(arm.elites.genotype):
        alone = landscape.measure(arm.domain, genotype, arm.mutate, 6, 4, niches=arm.niches)
        for name in MEASURES:
            assert frame.loc[row, name] == getattr(alone, name)
    np.testing.assert_array_equal(measured.parent, arm.elites.behavior)
    with pytest.raises(ValueError, match="read-only"):
        measured.offspring[0] = 0.0
    assert frame["uid"].tolist() == arm.elites.uid.tolist()
    assert frame["index"].iloc[-1] == "outside"
    assert (frame["sample_size"] == 6).all()


def test_a_smaller_sample_of_elites_is_part_of_a_larger(arm, measured):
    frame = measured.frame().set_index("niche")
    before = set()
    for elites in (1, 3, 9, len(arm.elites) + 5):
        part = measure_archive(arm, 6, seed=4, elites=elites)
        assert len(part) == min(elites, len(arm.elites))
        assert before <= set(part.state.tolist())
        before = set(part.state.tolist())
        columns = ["uid", *MEASURES]
        pd.testing.assert_frame_equal(
            part.frame().set_index("niche")[columns], frame.loc[part.state, columns]
        )


def test_workers_change_nothing(arm, measured):
    archive = load(arm.folder, domain=PlanarArm())
    archive.domain.chunk = 5
    with Threads(3) as threads:
        assert measure_archive(archive, 6, 4, threads).frame().equals(measured.frame())


def test_what_was_measured_before_an_interruption_is_not_measured_again(arm, measured, tmp_path, monkeypatch):
    for name in ("_FIRST_BATCH", "_LARGEST_BATCH"):
        monkeypatch.setattr(sampling, name, 21)
    keep = tmp_path / "kept"
    for batches in (2, 0, 1):
        with pytest.raises(KeyboardInterrupt):
            measure_archive(arm, 6, 4, Interrupted(batches), keep=keep)
    told, last = [], Interrupted()
    resumed = measure_archive(arm, 6, 4, last, keep=keep, on_done=told.append)
    # Three batches of three families of seven.
    assert last.evaluated == 7 * len(arm.elites) - 3 * 21
    assert told[0] == 3 * 21
    assert sum(told) == 7 * len(arm.elites)
    np.testing.assert_array_equal(resumed.offspring, measured.offspring)
    assert resumed.frame().equals(measured.frame())
    again = Interrupted(0)
    assert measure_archive(arm, 6, 4, again, keep=keep).frame().equals(measured.frame())


def test_what_is_kept_serves_other_samples_of_elites(arm, tmp_path):
    keep = tmp_path / "kept"
    measure_archive(arm, 6, 4, elites=5, keep=keep)
    more = Interrupted()
    measure_archive(arm, 6, 4, more, elites=8, keep=keep)
    assert more.evaluated == 3 * 7


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 5}, "differ in seed, mutation:"),
        ({"offspring": 7}, "differ in sample size:"),
        ({"mutate": variation.cauchy(0.3)}, "differ in mutation:"),
        ({"mutate": variation.cauchy(0.2, variation.Bound("rescaled", 1.0))}, "differ in mutation:"),
    ],
)
def test_what_is_kept_of_something_else_is_refused(arm, tmp_path, change, said):
    keep = tmp_path / "kept"
    measure_archive(arm, offspring=6, seed=4, elites=2, keep=keep)
    content = keep.read_bytes()
    with pytest.raises(NichechainError, match=said):
        measure_archive(arm, **{"offspring": 6, "seed": 4, "elites": 2, "keep": keep, **change})
    assert keep.read_bytes() == content


def test_what_is_kept_of_another_domain_of_that_name_is_refused(arm, tmp_path):
    keep = tmp_path / "kept"
    measure_archive(arm, 6, keep=keep)
    content = keep.read_bytes()
    noisy = load(arm.folder, domain=Noisy(PlanarArm(), Noise(action=0.1)))
    with pytest.raises(NichechainError, match="kept holds measurements that arm does not repeat"):
        measure_archive(noisy, 6, keep=keep)
    assert keep.read_bytes() == content


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 not an archive", b"\x80\x04N."])
def test_a_damaged_file_is_named(arm, tmp_path, content):
    keep = tmp_path / "kept"
    keep.write_bytes(content)
    with pytest.raises(NichechainError, match="kept is damaged, remove it"):
        measure_archive(arm, 6, keep=keep)


def test_measures_of_the_set(measured):
    away = np.linalg.norm(measured.offspring - measured.parent[:, None], axis=2)
    assert measured.global_sensitivity == pytest.approx(away.max(), rel=1e-14)
    assert measured.expected_global_sensitivity == pytest.approx(away.mean(), rel=1e-14)
    # Where nothing failed the jackknife is the standard error of a mean, of one value per noise.
    shared = away.mean(axis=0)
    assert measured.expected_global_sensitivity_error == pytest.approx(stats.sem(shared), rel=1e-12)
    ratio = measured.measures.expected_ratio
    count = int(np.ceil(0.1 * len(ratio)))
    assert sorted(ratio[measured.dissimila.dissimila]) == sorted(ratio)[:count]


def test_a_summary_is_plain(measured):
    summary = measured.summary()
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert summary["measured_elites"] == len(measured)
    assert summary["expected_ratio_quantiles"]["50%"] == np.median(measured.measures.expected_ratio)
    still = replace(measured, offspring=np.repeat(measured.parent[:, None], 6, axis=1)).summary()
    assert still["neutral"] == len(measured)
    assert still["dissimila"] == {"share": 0.1, "threshold": None, "count": 0}
    assert still["expected_ratio_quantiles"]["50%"] is None


def test_elites_whose_offspring_all_failed_are_neither_neutral_nor_dissimila(measured):
    offspring = measured.offspring.copy()
    offspring[3] = np.nan
    offspring[4, 1:] = np.nan
    broken = replace(measured, offspring=offspring)
    frame = broken.frame()
    assert frame.loc[3, "failed"] == 6
    assert frame.loc[4, "failed"] == 5
    assert not frame.loc[3:4, ["neutral", "dissimilum"]].any(axis=None)
    assert np.isnan(frame.loc[3, "expected_ratio"])
    # One child has a distance to its parent, but none to a sibling.
    assert np.isnan(frame.loc[4, "expected_evolvability"])
    assert frame.loc[4, "expected_local_sensitivity"] > 0
    json.dumps(broken.summary(), allow_nan=False)


def test_correlations_are_those_of_scipy_over_the_niches_that_are_known(measured):
    values = np.random.default_rng(0).normal(size=30)
    values[measured.state[:2]] = np.nan
    found = {c.measure: c for c in measured.correlations(values)}
    # Neither the outside elite nor those of the two unknown niches.
    rows = slice(2, len(measured) - 1)
    for name in MEASURES:
        expected = stats.spearmanr(measured.measures[name][rows], values[measured.state[rows]])
        assert found[name].n == len(measured) - 3
        assert found[name].rho == pytest.approx(expected.statistic, rel=1e-12)
        assert found[name].p_value == pytest.approx(expected.pvalue, rel=1e-9)
    assert all(np.isnan(c.rho) for c in measured.correlations(np.ones(30)))
    with pytest.raises(NichechainError, match=r"shape \(31,\), but there must be one for each of 30 niches"):
        measured.correlations(np.ones(31))


@pytest.mark.parametrize(
    ("mutate", "bounded", "most"),
    [
        # The hand moves by at most the mean over the links of how far their direction turns, and
        # the direction of link j is a sum of j of the 10 angles.
        (variation.cauchy(1.0, variation.Bound("per-coordinate", 0.02)), True, 0.02 * 5.5),
        (variation.cauchy(1.0, variation.Bound("rescaled", 0.05)), True, 0.05 * np.sqrt(385.0) / 10),
        (variation.uniform_ball(0.05), True, 0.05 * np.sqrt(385.0) / 10),
        (variation.cauchy(1.0), False, 2.0),
        (lambda parent, rng: parent + rng.normal(size=parent.shape).astype(np.float32), False, 2.0),
        (variation.SelfAdaptiveMutation(variation.noise_of("uniform-ball"), (9,)), False, 2.0),
    ],
)
def test_bounded_neighbourhoods_bound_the_sensitivity(arm, mutate, bounded, most):
    found = measure_archive(arm, 20, elites=5, mutate=mutate)
    assert found.bounded == bounded
    assert 0 < found.global_sensitivity <= most * (1 + 1e-6)
    assert found.global_sensitivity > 0.05 * most


class Broken(PlanarArm):
    """An arm on which everything fails, once it is broken."""

    def evaluate(self, genotypes):
        return super().evaluate(np.full_like(genotypes, np.inf))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"offspring": 1}, "offspring is 1"),
        ({"offspring": -3}, "offspring is -3"),
        ({"seed": -1}, "seed is -1"),
        ({"elites": 0}, "elites is 0"),
        ({"share": 0.0}, "share is 0.0"),
        ({"share": float("nan")}, "share is nan"),
    ],
)
def test_bad_input_is_one_sentence(arm, options, said):
    with pytest.raises(NichechainError, match=said):
        measure_archive(arm, **options)


def test_an_archive_without_elites(arm):
    archive = load(arm.folder)
    archive.elites = archive.elites[np.zeros(0, np.int64)]
    with pytest.raises(NichechainError, match="has no elites to measure"):
        measure_archive(archive)


def test_an_elite_that_fails_now_is_named(arm):
    archive = load(arm.folder, domain=Broken())
    with pytest.raises(NichechainError, match="the elite of niche 0,1 failed to evaluate") as error:
        measure_archive(archive)
    assert archive.niches.label(int(archive.elites.niche[0])) in str(error.value)


def test_a_domain_of_another_genotype_length_is_refused(arm):
    with pytest.raises(NichechainError, match="genotypes of 10 parameters, but arm has 4"):
        measure_archive(load(arm.folder, domain=PlanarArm(4)))
