import math
from fractions import Fraction

import numpy as np
import pytest

from nichechain.core.checks import (
    check_at_least,
    check_choice,
    check_lineages,
    check_numbers,
    check_positive,
    check_share,
    check_whole,
    shown,
)
from nichechain.core.errors import NichechainError


@pytest.mark.parametrize(
    ("check", "message"),
    [
        (lambda: check_at_least(1, draws=0), "draws is 0, but must be at least 1"),
        (lambda: check_at_least(2, folds=5, resamples=1), "resamples is 1, but must be at least 2"),
        (lambda: check_at_least(0, seed=-1), "seed is -1, but must not be negative"),
        (lambda: check_at_least(1, draws=2.0), "draws is 2.0, but must be a whole number"),
        (lambda: check_lineages(5, lineages=0), "lineages is 0, but must be at least 1"),
        (lambda: check_lineages(5, lineages=2.0), "lineages is 2.0, but must be a whole number"),
        (
            lambda: check_lineages(5, lineages=6),
            "lineages is 6, but must be at most 5: each begins with a child of its own",
        ),
        (lambda: check_positive(scale=0), "scale is 0, but must be a positive number"),
        (lambda: check_positive(scale=math.inf), "scale is inf, but must be a positive number"),
        (lambda: check_positive(scale=math.nan), "scale is nan, but must be a positive number"),
        (lambda: check_positive(scale="1"), "scale is '1', but must be a number"),
        (lambda: check_share(share=0.0), "share is 0.0, but must be above 0 and at most 1"),
        (lambda: check_share(share=1.5), "share is 1.5, but must be above 0 and at most 1"),
        (lambda: check_share(share=math.nan), "share is nan, but must be above 0 and at most 1"),
        (lambda: check_choice("mode", "c", ("a", "b")), "mode is 'c', but must be one of a, b"),
        (lambda: check_choice("mode", ["a"], {"a": 1}), r"mode is \['a'\], but must be one of a"),
        (lambda: check_choice("mode", None, ("a",)), "mode is None, but must be one of a"),
    ],
)
def test_what_is_out_of_range_is_named_with_what_is_allowed(check, message):
    with pytest.raises(NichechainError, match=f"^{message}$"):
        check()


def test_what_is_in_range_passes():
    check_at_least(1, draws=1, folds=np.int64(7))
    check_at_least(-1, place=-1)
    check_positive(scale=np.float32(0.5), size=3)
    check_lineages(5, lineages=5, objective_lineages=None)
    check_share(share=1)
    check_choice("mode", "b", iter(("a", "b")))


def test_what_only_counts_among_numbers_is_refused():
    span = np.timedelta64(3, "D")
    for check in (check_whole, check_numbers):
        with pytest.raises(NichechainError, match=r"it is .*must be a"):
            check(it=span)
    with pytest.raises(NichechainError, match="must be a number"):
        check_numbers(it=Fraction(1, 3))
    check_whole(it=np.uint8(3))
    check_numbers(it=np.float32(0.5), other=True)


def test_a_large_value_is_shown_in_part_and_on_one_line():
    text = shown(np.full((6, 6), 2**63, np.uint64))
    assert len(text) == 80
    assert text.startswith("array([[9223372036854775808,")
    assert text.endswith("...")
    assert "\n" not in text
    assert shown("three") == "'three'"
