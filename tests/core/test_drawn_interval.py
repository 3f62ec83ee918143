import numpy as np

from nichechain.core.intervals import drawn_interval


def test_another_draw_falls_within_nine_times_of_ten():
    # Of 19 uniform draws, the first and the last have 1/20 and 19/20 below them in expectation.
    draws = np.arange(1, 20)
    low, high = drawn_interval(draws)
    assert (low, high) == (1.0, 19.0)


def test_axis_is_taken_out():
    low, high = drawn_interval(np.zeros((3, 50, 2)), axis=1)
    assert low.shape == high.shape == (3, 2)
