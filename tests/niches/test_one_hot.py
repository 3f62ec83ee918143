"""One-hot behavior, and measures of the landscape in this form."""

import numpy as np
import pytest

from nichechain import GridNiches, NichechainError
from nichechain.landscape import evolvability, expected_evolvability, one_hot_evolvability
from nichechain.niches import CVTNiches, one_hot

GRID = GridNiches((2, 2), ((0.0, 1.0), (0.0, 1.0)))
CVT = CVTNiches(GRID.centers, GRID.bounds)
SAMPLE = np.array([[0.1, 0.1], [0.9, 0.2], [0.8, 0.1], [0.2, 0.3], [0.9, 0.9]])


@pytest.mark.parametrize("niches", [GRID, CVT])
def test_a_one_for_the_niche(niches):
    behavior = [[0.1, 0.9], [0.9, 0.1], [1.5, 0.1], [np.nan, np.nan]]
    assert one_hot(behavior, niches).tolist() == [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert one_hot(np.reshape(behavior, (2, 2, 2)), niches).shape == (2, 2, 4)
    assert one_hot([0.1, 0.9], niches).tolist() == [0, 1, 0, 0]
    assert one_hot(np.empty((0, 2)), niches).shape == (0, 4)


@pytest.mark.parametrize("niches", [GRID, CVT])
def test_measures_of_the_landscape_in_one_hot_form(niches):
    form = one_hot(SAMPLE, niches)
    assert form.any(axis=0).mean() == one_hot_evolvability(niches.of(SAMPLE), len(niches)) == 3 / 4
    # Niches 0, 2, 2, 0, 3: of 10 pairs, 2 share theirs.
    assert expected_evolvability(form) == pytest.approx(np.sqrt(2) * 8 / 10)
    assert evolvability(form) == pytest.approx(np.sqrt(2))


@pytest.mark.parametrize("behavior", [[[0.1]], 0.5, [[np.inf, 0.1]]])
def test_one_hot_refuses(behavior):
    with pytest.raises(NichechainError, match="behavior has"):
        one_hot(behavior, GRID)
