"""Bands over priors and over elites: what they hold, when they widen, and what brute force says."""

from __future__ import annotations

import json

import numpy as np
import pytest

from nichechain import (
    GridNiches,
    NichechainError,
    TransitionCounts,
    bootstrap_elites,
    estimate,
    niche_evolvability,
    prior_sensitivity,
)
from nichechain.cli import main

GRID = GridNiches((4, 4), ((0.0, 4.0), (0.0, 4.0)), outside="clip")
SHORT = {"l": 2, "lineages": 10}
N = len(GRID)


def _born(elites, children, seed):
    """Counts of elites in each niche whose children are few niches' own, whatever their niche."""
    rng = np.random.default_rng(seed)
    truth = np.random.default_rng(99).dirichlet(np.full(N, 0.5), N)
    parent, child, elite = [], [], []
    for number in range(N * elites):
        # Siblings take after each other: an elite's own distribution strays from its niche's.
        own = rng.dirichlet(6.0 * truth[number % N] + 1e-3)
        parent += [number % N] * children
        elite += [number] * children
        child += rng.choice(N, children, p=own).tolist()
    return TransitionCounts.from_births(parent, child, GRID, elite=elite)


@pytest.mark.parametrize("band", [prior_sensitivity, bootstrap_elites])
def test_a_band_holds_the_posterior_mean_and_is_fixed_by_the_seed(band):
    counts = _born(5, 4, seed=1)
    first, again, other = (band(counts, draws=3, seed=seed, **SHORT) for seed in (4, 4, 5))
    assert (first.low <= first.value).all()
    assert (first.value <= first.high).all()
    for name in ("value", "low", "high"):
        assert getattr(first, name).shape == (N,)
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert (first.low != other.low).any()
    mean = niche_evolvability(
        estimate(counts), draws=3 if band is prior_sensitivity else 50, seed=4, **SHORT
    ).value
    np.testing.assert_allclose(first.value, mean, rtol=1e-12)


def test_the_kinds_and_the_fits_are_named():
    counts = _born(3, 4, seed=1)
    prior = prior_sensitivity(counts, draws=2, factor=3.0, **SHORT)
    assert prior.kind == "prior sensitivity"
    assert prior.fits == (
        "fitted",
        "strength / 3",
        "strength x 3",
        "all destination",
        "all displacement",
    )
    elites = bootstrap_elites(counts, resamples=2, draws=2, **SHORT)
    assert (elites.kind, elites.fits) == ("bootstrap over elites", ())


def test_the_prior_matters_less_the_more_births_there_are():
    few, many = (prior_sensitivity(_born(n, 4, seed=2), **SHORT) for n in (2, 200))
    assert np.mean(many.high - many.low) < 0.5 * np.mean(few.high - few.low)


def test_one_elite_in_each_niche_leaves_nothing_to_resample():
    band = bootstrap_elites(_born(1, 10, seed=3), resamples=5, **SHORT)
    np.testing.assert_allclose(band.high - band.low, 0.0, atol=1e-12)


def test_births_of_unknown_parents_are_resampled_one_by_one():
    known = _born(1, 10, seed=3)
    parent = np.repeat(0, 40)
    counts = known + TransitionCounts.from_pairs(parent, np.arange(40) % N, GRID)
    band = bootstrap_elites(counts, resamples=20, **SHORT)
    assert band.high[0] - band.low[0] > 0.05


def test_the_bootstrap_spreads_as_new_births_do():
    options = {"l": 1, "lineages": 5}
    again = [
        niche_evolvability(estimate(_born(30, 6, seed)), draws=10, **options).value for seed in range(40)
    ]
    # What a niche's value varies by between worlds, and the bootstrap's guess of it from one world.
    truth = np.quantile(again, 0.95, axis=0) - np.quantile(again, 0.05, axis=0)
    bands = [bootstrap_elites(_born(30, 6, seed), draws=10, **options) for seed in (100, 101)]
    guess = np.mean([band.high - band.low for band in bands])
    assert 0.7 < guess / truth.mean() < 1.4


@pytest.mark.parametrize(
    ("band", "options", "said"),
    [
        (prior_sensitivity, {"factor": 1.0}, "factor is 1, but must be a number greater than 1"),
        (prior_sensitivity, {"factor": float("nan")}, "factor is nan"),
        (prior_sensitivity, {"draws": 0}, "draws is 0"),
        (prior_sensitivity, {"l": 0}, "l is 0"),
        (bootstrap_elites, {"resamples": 1}, "resamples is 1, but must be at least 2"),
        (bootstrap_elites, {"draws": 0}, "draws is 0"),
        (bootstrap_elites, {"convention": "mine"}, "convention is 'mine'"),
    ],
)
def test_bad_arguments(band, options, said):
    with pytest.raises(NichechainError, match=said):
        band(_born(2, 3, seed=0), **options)


def test_births_that_do_not_say_whose_they_are():
    counts = TransitionCounts.from_pairs([0, 1], [1, 2], GRID)
    with pytest.raises(NichechainError, match="do not say whose children they are"):
        bootstrap_elites(counts)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("uncertainty") / "arm"
    options = ["--evaluations", "1500", "--grid", "6x6", "--scale", "0.3", "--seed", "5"]
    assert main(["build", "arm", *options, "--out", str(folder)]) == 0
    return folder


def _ask(capsys, *arguments):
    capsys.readouterr()
    assert main(["evolvability", *map(str, arguments), "--l", "2", "--lineages", "10", "--draws", "7"]) == 0
    return capsys.readouterr().out


LABELS = {"posterior": "90 % interval", "prior": "prior band", "bootstrap": "90 % bootstrap"}


@pytest.mark.parametrize("uncertainty", LABELS)
def test_the_command_says_which_band_it_shows(built, capsys, uncertainty):
    shown = _ask(capsys, built, "--top", 2, "--uncertainty", uncertainty)
    assert [label for label in LABELS.values() if label in shown] == [LABELS[uncertainty]]
    rows = json.loads(_ask(capsys, built, "--top", 2, "--uncertainty", uncertainty, "--format", "json"))
    plain = json.loads(_ask(capsys, built, "--top", 2, "--format", "json"))
    assert [row["uncertainty"] for row in rows] == [uncertainty] * 2
    assert [row["value"] for row in rows] == [row["value"] for row in plain]
    assert all(row["low"] <= row["value"] <= row["high"] for row in rows)
    assert ([row["low"] for row in rows] == [row["low"] for row in plain]) == (uncertainty == "posterior")
    chosen = rows[1]["niche"]
    options = ["--niche", chosen, "--uncertainty", uncertainty, "--format", "json"]
    (one,) = json.loads(_ask(capsys, built, *options))
    assert [one["low"], one["high"]] == pytest.approx([rows[1]["low"], rows[1]["high"]])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--elite", "0,0"], "--uncertainty prior is of niches, but --elite asks for a genotype"),
        (["--estimator", "mle"], "--uncertainty prior belongs to empirical-bayes, not to mle"),
        (["--method", "monte-carlo"], "--uncertainty prior is not computed by monte-carlo"),
    ],
)
def test_bands_that_the_command_has_not(built, capsys, options, said):
    capsys.readouterr()
    assert main(["evolvability", str(built), "--uncertainty", "prior", *options]) == 2
    assert said in capsys.readouterr().err
