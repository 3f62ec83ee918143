"""The bench of truth finds what was put into it."""

import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from scipy import stats

from nichechain import GridNiches, NicheChain, TransitionCounts, estimate
from nichechain.births import NONE
from nichechain.evolvability import niche_evolvability
from nichechain.validation import Lineages, simulate_births, simulate_lineages

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import truth_models
import truth_scores
from truth_data import Truth
from truth_models import PlainChain, Steps, coverage

NICHES = GridNiches((4, 4), ((0.0, 1.0), (0.0, 1.0)))
STATES, ROOTS, LINEAGES = 17, 40, 20


@pytest.fixture(scope="module")
def matrix():
    return np.random.default_rng(0).dirichlet(np.full(STATES, 0.3), STATES)


@pytest.fixture(scope="module")
def truth(matrix):
    """Births and lineages of a chain that is known."""
    rng = np.random.default_rng(1)
    chain = NicheChain(matrix, outside=STATES - 1)
    frame = simulate_births(chain, 6_000, rng, start=np.arange(STATES))
    births = pa.Table.from_pandas(frame, preserve_index=False)
    births = births.append_column("lineage", pa.array(np.zeros(len(births), bool)))
    roots = np.arange(ROOTS) % (STATES - 1)
    states = simulate_lineages(matrix, simulate_one(matrix, roots, LINEAGES, rng), 10, rng)
    offspring = simulate_one(matrix, roots, 30, rng)
    return Truth(births, NICHES, None, np.full(ROOTS, NONE), Lineages(roots, states, offspring))


def simulate_one(matrix, roots, size, rng):
    return simulate_lineages(matrix, np.repeat(roots[:, None], size, axis=1), 2, rng)[..., 1]


class Knows:
    """The chain that births and lineages came from."""

    def __init__(self, matrix):
        self.matrix = matrix

    def __call__(self, _births, _niches):
        return self

    def forecast(self, roots, generations, lineages, seed):
        first = self.matrix[roots.niche]
        rng = np.random.default_rng(seed)
        value = coverage(self.matrix, first, generations, lineages, STATES - 1)
        checks = truth_models.simulated_coverage(
            self.matrix, first, generations, lineages, STATES - 1, 200, rng
        )
        return {"niche": truth_models.Forecast(value[None], checks)}

    def log_probability(self, steps: Steps):
        return np.log(self.matrix[steps.history[:, 0], steps.child])


def test_coverage_is_that_of_the_package(matrix):
    chain = NicheChain(matrix, outside=STATES - 1)
    for generations in (1, 2, 5):
        expected = niche_evolvability(chain, l=generations, lineages=7).value
        found = coverage(matrix, matrix, generations, 7, STATES - 1)[: STATES - 1, generations - 1]
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_true_chain_is_found_right(matrix, truth):
    scores = truth_scores.score(Knows(matrix), truth, 6_000, 0.0).set_index("generation")
    np.testing.assert_allclose(scores["level"], 1.0, atol=0.03)
    # Whole numbers are covered more often than 90 %; 40 roots give or take 3 times 5 %.
    assert (scores["covered"] > 0.75).all()
    np.testing.assert_allclose(scores["predicted"] - scores["reached"], scores["bias"])
    # The true chain's log-probability is minus the entropy of the rows that the lineages stood in.
    stood = truth.lineages.walks[:, :-1].ravel()
    entropy = stats.entropy(matrix, axis=1)[stood].mean()
    assert scores["steps_log"].iloc[0] == pytest.approx(-entropy, abs=0.05)


def test_a_chain_that_is_too_wide_is_found_out(truth):
    uniform = np.full((STATES, STATES), 1 / STATES)
    scores = truth_scores.score(Knows(uniform), truth, 6_000, 0.0).set_index("generation")
    assert scores.loc[1, "level"] > 1.2
    assert scores.loc[1, "covered"] < 0.5


def test_held_out_births_are_foretold_without_their_elites(truth):
    seen = []

    def remembering(births, niches):
        seen.append(set(births["parent_uid"].drop_null().to_pylist()))
        return PlainChain(births, niches, "dirichlet")

    value, impossible = truth_scores.held_out(remembering, truth.births, NICHES)
    everyone = set(truth.births["parent_uid"].drop_null().to_pylist())
    assert len(seen) == 3
    # Every elite is left out once.
    assert sorted(uid for fold in seen for uid in everyone - fold) == sorted(everyone)
    assert impossible == 0
    assert -np.log(STATES) < value < 0


def test_plain_chains_answer_for_the_mean_of_t(truth):
    model = PlainChain(truth.births, NICHES, "empirical-bayes")
    births = truth.births
    columns = (births[k].fill_null(NONE).to_numpy() for k in ("parent_niche", "child_niche", "parent_uid"))
    parent, child, elite = columns
    chain = estimate(TransitionCounts.from_births(parent, child, NICHES, elite=elite))
    steps = truth_scores.birth_steps(births)
    own = steps.history[:, 0] != NONE
    some = Steps(*(getattr(steps, k)[own] for k in Steps.__dataclass_fields__))
    np.testing.assert_array_equal(some.history[:, 0], parent[own])
    np.testing.assert_allclose(model.log_probability(some), np.log(chain.T[parent[own], child[own]]))


def test_histories_follow_the_parents(truth):
    steps = truth_scores.birth_steps(truth.births)
    uid = truth.births["parent_uid"].fill_null(NONE).to_numpy()
    child = truth.births["child_niche"].to_numpy()
    deep = np.flatnonzero(steps.depth >= 3)[:20]
    assert deep.size
    for birth in deep:
        path, here = [], birth
        while uid[here] != NONE and len(path) < truth_scores.HISTORY:
            here = uid[here]
            path.append(child[here])
        assert steps.history[birth, : len(path)].tolist() == path
        assert (steps.history[birth, len(path) :] == NONE).all()


def test_steps_of_lineages_begin_at_their_roots(truth):
    steps = truth_scores.lineage_steps(truth.births, truth)
    walks = truth.lineages.walks
    assert len(steps) == walks.shape[0] * 10
    last = walks.shape[0] * 9
    np.testing.assert_array_equal(steps.history[last:, :10], walks[:, 9::-1])
    np.testing.assert_array_equal(steps.child[last:], walks[:, 10])
    assert (steps.history[last:, 10:] == NONE).all()


def test_ceiling_is_the_root_of_the_reliability():
    # Two kinds of roots: lineages that all go to one niche, and lineages that each go anywhere.
    rng = np.random.default_rng(0)
    states = np.zeros((60, 40, 1), np.int64)
    states[30:] = rng.integers(0, 400, (30, 40, 1))
    found = truth_scores.ceiling(states, 400)
    # Ranks are 15.5 for the first kind, and any order of 31 to 60 for the second: variance 15**2
    # between kinds, and 30**2 / 12 of pure chance in one half of the roots.
    half = 15**2 / (15**2 + 30**2 / 12 / 2)
    assert found[0] == pytest.approx(np.sqrt(2 * half / (1 + half)), abs=0.03)


def test_a_share_of_births_buys_lineages(truth):
    extra = truth.births.slice(0, 600).append_column("births_before", pa.array(np.full(600, 100)))
    given = Truth(truth.births, NICHES, extra, truth.uid, truth.lineages).given(1_000, 0.1)
    assert len(given) == 1_000
    assert given.slice(0, 900).equals(truth.births.slice(0, 900))
    with pytest.raises(ValueError, match="there are 600 births of lineages, but 3000 are asked for"):
        Truth(truth.births, NICHES, extra, truth.uid, truth.lineages).given(6_000, 0.5)
