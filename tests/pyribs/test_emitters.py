"""Our operators as an emitter of pyribs."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import NichechainError, variation
from nichechain.pyribs import MutationEmitter, record
from nichechain.variation import Bound

from .searches import INITIAL, grid, run, search


def test_children_are_in_the_neighbourhood_of_their_parents():
    archive = grid()
    mutate = variation.cauchy(1.0, Bound("per-coordinate", 0.2))
    emitter = MutationEmitter(archive, mutate, initial_solutions=INITIAL, batch_size=30, seed=1)
    recording = record(search(archive, emitter))
    solutions = run(search(archive, emitter), 10)
    births = recording.births().to_pandas()
    np.testing.assert_array_equal(solutions[:40], INITIAL)
    children = births["parent_uid"].notna()
    assert children.sum() == 9 * 30
    steps = np.abs(solutions[children] - solutions[births["parent_uid"][children].astype(int)])
    assert steps.max() <= 0.2
    assert (steps > 0.1).mean() > 0.3


def test_the_same_seeds_give_the_same_search():
    found = []
    for _ in range(2):
        archive = grid()
        emitter = MutationEmitter(archive, variation.cauchy(0.1), initial_solutions=INITIAL, seed=7)
        found.append(run(search(archive, emitter), 4))
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"initial_solutions": np.zeros(5)}, r"initial solutions have shape \(5,\), but must be \(n, 5\)"),
        ({"initial_solutions": np.zeros((0, 5))}, "initial solutions have shape"),
        ({"initial_solutions": np.zeros((3, 4))}, "initial solutions have shape"),
        ({"initial_solutions": INITIAL, "batch_size": 0}, "batch_size is 0, but must be at least 1"),
    ],
)
def test_what_does_not_fit_is_named(options, message):
    with pytest.raises(NichechainError, match=message):
        MutationEmitter(grid(), variation.cauchy(), **options)
