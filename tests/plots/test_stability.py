import numpy as np
from matplotlib.figure import Figure

from nichechain.plots.validation import plot_level, plot_stability
from nichechain.validation.drift import LevelCourse
from nichechain.validation.stability import ENOUGH, RankStability


def test_shows_the_curve_the_halves_and_what_is_enough():
    fractions = np.array([0.25, 0.5])
    spearman = np.array([[0.5, 0.7], [0.8, 0.9]])
    found = RankStability(
        fractions,
        400 * fractions,
        spearman,
        30 * spearman,
        28.0,
        np.array([0.3, 0.4]),
        40,
        400,
        "elite",
        20,
        5,
        100,
        "mle",
    )
    ax = Figure().add_subplot()
    assert plot_stability(found, ax) is ax
    curve, halves, enough = ax.lines
    np.testing.assert_allclose(curve.get_xydata(), [[100, 0.6], [200, 0.85]])
    np.testing.assert_allclose(halves.get_xydata(), [[200, 0.3], [200, 0.4]])
    assert set(enough.get_ydata()) == {ENOUGH}
    assert "40 niches by 5-evolvability" in ax.get_ylabel()
    assert "elites" in ax.get_xlabel()


def test_the_level_against_steps_and_births():
    ones = np.ones(2)
    found = LevelCourse(
        np.array([0, 10]),
        np.array([10, 20]),
        np.array([100, 110]),
        np.array([5.0, 8.0]),
        np.array([4.0, 7.0]),
        np.array([6.0, 9.0]),
        np.array([100, 210]),
        np.array([5.0, 6.0]),
        6.0 - ones,
        6.0 + ones,
        40,
        5,
        100,
    )
    ax = Figure().add_subplot()
    assert plot_level(found, ax) is ax
    alone, grown = (bars.lines[0] for bars in ax.containers)
    # Births of a part stand at the middle of it, those up to its end at its end.
    np.testing.assert_allclose(alone.get_xydata(), [[50, 5], [155, 8]])
    np.testing.assert_allclose(grown.get_xydata(), [[100, 5], [210, 6]])
    assert "5-evolvability" in ax.get_ylabel()
