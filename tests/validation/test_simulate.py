import numpy as np
import pytest
from scipy import stats

import nichechain as nc
from nichechain.core.errors import NichechainError
from nichechain.validation import Triples, simulate_births, simulate_lineages

from .conftest import local_chain, scattered_chain


def test_children_follow_the_row_of_their_parent():
    chain = scattered_chain(np.random.default_rng(0), 6)
    births = simulate_births(chain, 20_000, np.random.default_rng(1))
    moved = births.dropna()
    for i in range(6):
        landed = np.bincount(moved.loc[moved["parent_niche"] == i, "child_niche"].astype(int), minlength=6)
        common = chain.T[i] * landed.sum() > 5
        observed, expected = landed[common], chain.T[i][common] * landed.sum()
        assert stats.chisquare(observed, expected * observed.sum() / expected.sum()).pvalue > 1e-4


def test_parents_are_elites_of_the_time():
    births = simulate_births(local_chain(), 3000, np.random.default_rng(2), start=[0, 4], batch=32)
    assert births["parent_uid"].isna().sum() == 2
    moved = births.dropna().astype(int)
    parents = births.iloc[moved["parent_uid"]]
    np.testing.assert_array_equal(parents["child_niche"], moved["parent_niche"])
    np.testing.assert_array_equal(parents["depth"].to_numpy() + 1, moved["depth"])
    assert (parents["step"].to_numpy() < moved["step"]).all()
    # A niche has one elite at a time.
    assert (moved.groupby(["step", "parent_niche"])["parent_uid"].nunique() == 1).all()


def test_the_elite_is_a_uniform_sample_of_its_niche():
    chain = nc.NicheChain([[1.0]])
    last = []
    for seed in range(200):
        births = simulate_births(chain, 41, np.random.default_rng(seed), batch=8)
        last.append(births["parent_uid"].iloc[-1])
    # Before the last step, 33 births fell into the niche.
    assert stats.kstest(np.array(last, float) + 0.5, stats.uniform(0, 33).cdf).pvalue > 1e-3


@pytest.mark.parametrize(("replacement", "parent"), [("first", 0), ("newest", 32)])
def test_the_first_or_the_last_birth_stays(replacement, parent):
    births = simulate_births(
        nc.NicheChain([[1.0]]), 41, np.random.default_rng(0), batch=8, replacement=replacement
    )
    assert births["parent_uid"].iloc[-1] == parent


def test_the_best_birth_has_the_best_parents():
    # Where a child is as good as its parent and some noise, those that stay go back to few ancestors.
    chain = nc.NicheChain(np.full((5, 5), 0.2))
    depth = {
        rule: simulate_births(chain, 4000, np.random.default_rng(0), batch=8, replacement=rule)[
            "depth"
        ].mean()
        for rule in ("random", "first", "objective")
    }
    assert depth["first"] < depth["random"] < depth["objective"]


def test_memory_returns_children_to_their_grandparents():
    births = simulate_births(local_chain(), 4000, np.random.default_rng(3), memory=1.0)
    triples = Triples.from_births(births).with_grandparent
    np.testing.assert_array_equal(triples.child, triples.grandparent[triples.elite])


def test_selection_makes_even_a_perfect_chain_break_the_square_of_t():
    chain = scattered_chain(np.random.default_rng(5), 12)
    births = simulate_births(chain, 60_000, np.random.default_rng(6))
    triples = Triples.from_births(births).with_grandparent
    of = triples.elite
    seen, middle = np.zeros((12, 12)), np.zeros((12, 12))
    np.add.at(seen, (triples.grandparent[of], triples.child), 1)
    np.add.at(middle, (triples.grandparent[of], triples.niche[of]), 1)
    # Few elites ever replace others, so that some states are hardly anyone's grandparent's.
    met = seen.sum(axis=1) > 2000
    assert met.sum() > 6
    seen, middle = (count[met] / count[met].sum(axis=1, keepdims=True) for count in (seen, middle))
    square = np.abs(seen - chain.T[met] @ chain.T).sum(axis=1).mean() / 2
    weighted = np.abs(seen - middle @ chain.T).sum(axis=1).mean() / 2
    assert square > 0.1
    assert weighted < 0.03


def test_lineages_follow_powers_of_t():
    chain = scattered_chain(np.random.default_rng(7), 5)
    states = simulate_lineages(chain.T, np.full((100, 200), 3), 4, np.random.default_rng(8))
    assert states.shape == (100, 200, 4)
    assert (states[:, :, 0] == 3).all()
    for k in range(1, 4):
        observed = np.bincount(states[:, :, k].ravel(), minlength=5)
        expected = np.linalg.matrix_power(chain.T, k)[3] * observed.sum()
        assert stats.chisquare(observed, expected).pvalue > 1e-4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"start": 20}, "start is"),
        ({"start": []}, "start is"),
        ({"batch": 0}, "batches of 0"),
        ({"births": 0}, "births are 0"),
        ({"memory": 1.5}, "memory is 1.5"),
    ],
)
def test_bad_input_is_one_sentence(options, said):
    with pytest.raises(NichechainError, match=said):
        simulate_births(local_chain(), **{"births": 10, "rng": np.random.default_rng(), **options})
    with pytest.raises(NichechainError, match="generations is 0"):
        simulate_lineages(np.eye(2), [0], 0, np.random.default_rng())
