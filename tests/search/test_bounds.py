import numpy as np

from nichechain.search.bounds import FirstLook, bounds_holding


def test_bounds_hold_what_they_say():
    behavior = np.random.default_rng(0).standard_cauchy((2000, 3))
    (lower, upper) = np.array(bounds_holding(behavior, 0.9)).T
    assert ((behavior >= lower) & (behavior <= upper)).all(axis=1).mean() >= 0.9
    assert bounds_holding(np.array([[1.0], [3.0]])) == ((1.0, 3.0),)


def test_the_first_look_speaks_once():
    look = FirstLook(state=4)
    far, outside = np.full((600, 1), 9.0), np.full(600, 4)
    assert look.tell(far, outside, last=False) is None
    said = look.tell(far, outside, last=False)
    assert said == "1200 of 1200 births fell outside the bounds; bounds of 9 to 9 would hold 99% of them"
    assert look.tell(far, outside, last=True) is None


def test_half_inside_is_nothing_to_say():
    look = FirstLook(state=4)
    assert look.tell(np.zeros((10, 1)), np.repeat([0, 4], 5), last=True) is None
