from dataclasses import dataclass

import numpy as np

from nichechain.core.columns import Columnar


@dataclass(frozen=True)
class Points(Columnar):
    place: np.ndarray
    weight: np.ndarray


def test_rows_are_taken_from_every_column():
    points = Points(np.arange(6.0).reshape(3, 2), np.array([1, 2, 3]))
    assert len(points) == 3
    for rows in (slice(1, 3), np.array([1, 2]), np.array([False, True, True])):
        some = points[rows]
        assert isinstance(some, Points)
        assert some.place.tolist() == [[2.0, 3.0], [4.0, 5.0]]
        assert some.weight.tolist() == [2, 3]


def test_parts_are_put_one_after_the_other():
    first = Points(np.zeros((1, 2)), np.array([1]))
    both = Points.concatenate([first, Points(np.ones((2, 2)), np.array([2, 3]))])
    assert both.place.tolist() == [[0.0, 0.0], [1.0, 1.0], [1.0, 1.0]]
    assert both.weight.tolist() == [1, 2, 3]
