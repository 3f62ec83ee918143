"""How much elites of one niche differ: recovered from births of a known truth, and by brute force."""

import math

import numpy as np
import pytest

from nichechain.chain.counts import TransitionCounts
from nichechain.chain.elites import elite_concentration
from nichechain.chain.estimators import estimate
from nichechain.niches import GridNiches

GRID = GridNiches((6, 6), ((0.0, 1.0),) * 2)
# Over seeds 0 to 9 the fitted concentration is from .86 to 1.27 times the true one.
ERROR = 0.3


def _births(concentration, elites, children, seed):
    """Births of elites with Dirichlet(concentration T_i) of their own; alike where it is None."""
    rng = np.random.default_rng(seed)
    states = GRID.states
    rows = rng.dirichlet(np.full(states, 0.5), states)
    parent = np.repeat(np.arange(states), elites)
    laws = rows[parent]
    if concentration is not None:
        laws = rng.standard_gamma(concentration * laws + 1e-12)
        laws /= laws.sum(axis=1, keepdims=True)
    table = np.array([rng.multinomial(children, law) for law in laws])
    elite, child = np.nonzero(table)
    born = table[elite, child]
    elite, child = np.repeat(elite, born), np.repeat(child, born)
    return TransitionCounts.from_births(parent[elite], child, GRID, elite=elite)


def _concentration(counts):
    posterior = estimate(counts).posterior
    return elite_concentration(
        counts, posterior.base.probability, posterior.strength, posterior.design_effect
    )


@pytest.mark.parametrize("concentration", [10.0, 50.0, 200.0])
def test_the_concentration_behind_births_is_recovered(concentration):
    assert _concentration(_births(concentration, 10, 40, seed=1)) == pytest.approx(concentration, rel=ERROR)


@pytest.mark.parametrize(("elites", "children"), [(10, 40), (3, 10)])
def test_elites_that_are_alike_are_found_to_be_so_however_little_is_known_of_rows(elites, children):
    # So large that an elite's own children hardly move it away from the row of its niche.
    assert _concentration(_births(None, elites, children, seed=2)) > 20 * children


def test_each_child_is_foretold_from_its_siblings_and_the_row_of_the_others():
    counts = _births(20.0, 3, 8, seed=3)
    strength, effect = 5.0, np.linspace(1.0, 3.0, GRID.states)
    states = GRID.states

    def uniform(parent, _):
        return np.full(parent.size, 1.0 / states)

    found = elite_concentration(counts, uniform, strength, effect)

    families = {}
    for state, elite, child, number in counts.families.tolist():
        families.setdefault((state, elite), {})[child] = number
    dense = counts.matrix.toarray()

    def logarithm(concentration):
        total = 0.0
        for (state, _), children in families.items():
            size = sum(children.values())
            told = (dense[state].sum() - size) / effect[state] + strength
            t = 1.0 / (1.0 / concentration + 1.0 / told)
            for child, number in children.items():
                row = ((dense[state, child] - number) / effect[state] + strength / states) / told
                total += number * math.log((number - 1 + t * row) / (size - 1 + t))
        return total

    grid = np.exp(np.linspace(math.log(0.2), math.log(2e4), 400))
    best = grid[np.argmax([logarithm(c) for c in grid])]
    assert found == pytest.approx(best, rel=0.02)


@pytest.mark.parametrize(
    ("elite", "why"),
    [([0, 1, 2, 3], "no elite has two children"), ([0, 0, 0, 0], "no niche has two elites")],
)
def test_births_that_cannot_say_leave_it_to_the_strength(elite, why):
    counts = TransitionCounts.from_births([3, 3, 3, 3], [4, 4, 5, 3], GRID, elite=elite)
    posterior = estimate(counts).posterior
    assert _concentration(counts) is None, why
    assert posterior.elite_concentration == posterior.strength
