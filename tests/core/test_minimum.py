"""The least value of a function of one variable, against closed forms and SciPy."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from nichechain.core.minimum import minimum


@pytest.mark.parametrize("place", [-6.9, -1.0, 0.3, 8.7])
@pytest.mark.parametrize(
    "valley",
    [
        np.square,
        np.abs,
        np.cosh,
        lambda x: -np.exp(-0.5 * x**2 / 4.0),
        lambda x: np.logaddexp(0.0, x) - 0.5 * x,
    ],
    ids=["parabola", "kink", "cosh", "bell", "logistic"],
)
def test_the_bottom_of_a_valley(valley, place):
    assert minimum(lambda x: float(valley(x - place)), -7.0, 9.0) == pytest.approx(place, abs=1e-4)


@pytest.mark.parametrize(("place", "end"), [(-20.0, -7.0), (30.0, 9.0)])
def test_a_slope_ends_at_a_bound(place, end):
    assert minimum(lambda x: (x - place) ** 2, -7.0, 9.0) == pytest.approx(end, abs=1e-5)


def test_needs_no_more_values_than_scipy():
    rng = np.random.default_rng(0)
    ours = theirs = 0
    for place, width in zip(rng.uniform(-7.0, 9.0, 50), rng.uniform(0.5, 3.0, 50), strict=True):
        asked = []

        def value(x, place=place, width=width, asked=asked):
            asked.append(x)
            return float(np.logaddexp((x - place) / width, (place - x) / (2.0 * width)))

        minimum(value, -7.0, 9.0)
        ours += len(asked)
        theirs += minimize_scalar(value, bounds=(-7.0, 9.0), method="bounded", options={"xatol": 1e-6}).nfev
    assert ours <= 1.2 * theirs
