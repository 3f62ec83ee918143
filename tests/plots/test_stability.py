import numpy as np
from matplotlib.figure import Figure

from nichechain.plots.validation import plot_stability
from nichechain.validation.stability import ENOUGH, RankStability


def test_shows_the_curve_the_halves_and_what_is_enough():
    fractions = np.array([0.25, 0.5])
    spearman = np.array([[0.5, 0.7], [0.8, 0.9]])
    found = RankStability(
        fractions, 400 * fractions, spearman, np.array([0.3, 0.4]), 40, 400, "elite", 20, 5, 100, "mle"
    )
    ax = Figure().add_subplot()
    assert plot_stability(found, ax) is ax
    curve, halves, enough = ax.lines
    np.testing.assert_allclose(curve.get_xydata(), [[100, 0.6], [200, 0.85]])
    np.testing.assert_allclose(halves.get_xydata(), [[200, 0.3], [200, 0.4]])
    assert set(enough.get_ydata()) == {ENOUGH}
    assert "40 niches by 5-evolvability" in ax.get_ylabel()
    assert "elites" in ax.get_xlabel()
