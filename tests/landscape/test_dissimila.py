"""Which points of a set are dissimila."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import NichechainError, landscape


def test_dissimila_are_the_smallest_ratios_that_are_not_neutral():
    ratio = np.array([0.0, 1.0, 0.2, 1.5, 0.4, 1.2, 0.9, 1.1, 0.8, 1.3, np.nan])
    sensitivity = np.array([0.0, *[0.1] * 10])
    found = landscape.find_dissimila(ratio, sensitivity, share=0.25)
    # Nine points are judged: a quarter of them is reached by the third.
    assert np.flatnonzero(found.dissimila).tolist() == [2, 4, 8]
    assert found.threshold == 0.8
    assert np.flatnonzero(found.neutral).tolist() == [0]
    np.testing.assert_allclose(found.quantiles, np.quantile(ratio[1:10], landscape.QUANTILES))


def test_a_set_of_neutral_points_has_no_dissimila():
    found = landscape.find_dissimila([0.0, 0.0], [0.0, 1e-12])
    assert found.neutral.all()
    assert not found.dissimila.any()
    assert np.isnan(found.threshold)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: landscape.find_dissimila([1.0], [1.0], share=0.0), "share is 0.0"),
        (lambda: landscape.find_dissimila([1.0], [1.0], share=1.5), "share is 1.5"),
        (lambda: landscape.find_dissimila([1.0], [1.0], neutral=-1.0), "neutral is -1.0"),
        (lambda: landscape.find_dissimila([1.0], [1.0, 2.0]), r"shapes \(1,\) and \(2,\)"),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()
