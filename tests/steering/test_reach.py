"""Parents by reach: the forecast against the chain's own answers, the record, and whole builds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nichechain import BuildConfig, GridNiches, Threads, build, estimate, load, verify
from nichechain.chain.counts import TransitionCounts
from nichechain.evolvability.coverage import at_least_once, visit_probabilities
from nichechain.execution import Processes
from nichechain.search.selection import Told
from nichechain.steering.online import OnlineChain
from nichechain.steering.reach import ReachParents, many_lineages, one_lineage

CONFIG = BuildConfig(
    "arm",
    (12, 12),
    ((-1.0, 1.0), (-1.0, 1.0)),
    evaluations=1500,
    initial=50,
    batch=40,
    scale=0.1,
    seed=3,
    selection="reach",
)
NICHES = GridNiches((4, 5), ((0.0, 1.0), (0.0, 1.0)))


def births(size: int = 300) -> Told:
    """Births in the first half of the niches, near their parents."""
    rng = np.random.default_rng(4)
    parent = rng.integers(10, size=size)
    child = np.clip(parent + rng.integers(-2, 3, size), 0, 9)
    none = np.zeros(size, np.int64)
    return Told(parent + 100, parent, child, none.astype(bool), none + 1, none, none.astype(bool))


@pytest.fixture(scope="module")
def online():
    chain = OnlineChain(NICHES)
    chain.tell(births())
    chain.settle()
    return chain


@pytest.fixture(scope="module")
def matrix(online):
    given = births()
    counts = TransitionCounts.from_births(
        given.parent_niche, given.child_niche, NICHES, elite=given.parent_uid
    )
    return estimate(counts, strength=online.strength).T


@pytest.mark.parametrize(("l", "lineages"), [(1, 1), (1, 20), (3, 1), (4, 50)])
def test_niches_that_lineages_would_fill_are_those_of_the_chain(online, matrix, l, lineages):
    open_ = np.arange(10, 20)
    whole = np.zeros(21)
    for targets, visit in visit_probabilities(matrix, matrix, l, 20):
        (some,) = at_least_once(visit, [lineages])
        whole += some[:, np.isin(targets, open_)].sum(axis=1)
    np.testing.assert_allclose(many_lineages(online, open_, l, lineages), whole, rtol=1e-9)


@pytest.mark.parametrize(("l", "off"), [(1, 1e-9), (2, 1e-9), (3, 0.05)])
def test_one_lineage_costs_only_products_with_a_vector(online, l, off):
    open_ = np.zeros(21)
    open_[10:20] = 1.0
    found = one_lineage(online, open_, online @ open_, l)
    filled = np.arange(10)
    np.testing.assert_allclose(
        found[filled], many_lineages(online, np.arange(10, 20), l, 1)[filled], rtol=off
    )


def test_an_elite_s_record_corrects_the_forecast(online):
    parents = ReachParents(NICHES, 40)
    niche, uid = np.array([4, 4, 9]), np.array([104, 1, 109])
    assert parents.weights(niche, uid) is None
    parents.tell(births())
    parents.begin(1)
    open_ = np.zeros(21)
    open_[10:20] = 1.0
    forecast = online @ open_
    # Found when nothing was expected yet: of each niche's first child, its parent has the credit.
    given = births()
    _, first = np.unique(given.child_niche, return_index=True)
    credit = np.bincount(given.parent_uid[first], minlength=200)
    expected = forecast[niche] * (credit[uid] + 1.0)
    np.testing.assert_allclose(parents.weights(niche, uid), expected, rtol=1e-9)
    # Ten children of one elite, of which one is the first in its niche.
    one = np.ones(10, np.int64)
    child = np.array([15] + [3] * 9)
    parents.tell(Told(one * 9, one * 9, child, one.astype(bool), one, one, one < 0))
    told = parents.weights(np.array([9, 9]), np.array([9, 8]))
    np.testing.assert_allclose(told[0] / told[1], 2.0 / (1.0 + 10 * forecast[9]), rtol=1e-9)


def test_nobody_is_preferred_once_all_niches_are_filled():
    parents = ReachParents(NICHES, 40)
    every = np.arange(20)
    parents.tell(Told(every, every, every, every == every, np.ones(20, np.int64), every, every < 0))
    parents.begin(1)
    assert parents.weights(every, every) is None


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"selection": "reach:0.6,curiosity:0.3,uniform:0.1", "temperature": 0.7},
        {"selection_l": 3},
        {"selection_l": 2, "selection_lineages": 8, "outside": "absorb", "lineage_share": 0.2},
        {"niches": "cvt", "shape": (60,), "replacement": "objective"},
        {"selection": "l-evolvability", "selection_lineages": 30},
        {"selection": "information:0.8,uniform:0.2", "selection_l": 3},
    ],
)
def test_a_build_that_was_interrupted_has_the_same_births(values, tmp_path):
    config = replace(CONFIG, **values)
    with Threads(1) as executor:
        build(config, tmp_path / "once", executor)
        for evaluations in (30, 51, 700, 1499, 1500):
            build(replace(config, evaluations=evaluations), tmp_path / "often", executor)
    once, often = load(tmp_path / "once"), load(tmp_path / "often")
    assert once.births().equals(often.births())
    np.testing.assert_array_equal(once.elites.genotype, often.elites.genotype)
    assert verify(once, sample=20).ok


def test_workers_change_nothing(tmp_path):
    for name, executor in (("one", Threads(1)), ("two", Threads(2)), ("processes", Processes(2))):
        with executor:
            build(CONFIG, tmp_path / name, executor)
    births = [load(tmp_path / name).births() for name in ("one", "two", "processes")]
    assert births[0].equals(births[1])
    assert births[0].equals(births[2])


def test_it_fills_more_niches_than_uniform_parents(tmp_path):
    filled = {}
    with Threads(1) as executor:
        for selection in ("uniform", "reach"):
            for seed in range(3):
                folder = tmp_path / f"{selection}{seed}"
                build(replace(CONFIG, selection=selection, seed=seed), folder, executor)
                filled[selection, seed] = load(folder).filled
    assert all(filled["reach", seed] > filled["uniform", seed] for seed in range(3))


def test_parents_of_the_first_step_are_drawn_uniformly(tmp_path):
    with Threads(1) as executor:
        for selection in ("uniform", "reach"):
            build(replace(CONFIG, selection=selection, evaluations=90), tmp_path / selection, executor)
    births = [load(tmp_path / name).births() for name in ("uniform", "reach")]
    assert births[0].equals(births[1])
