from typing import Any

import pytest

from nichechain.core.errors import NichechainError
from nichechain.studies import Condition, condition_seed, pressure_of, selection_of
from nichechain.walks import BetterThanParent, Selective, TopFraction, Uniform
from nichechain.walks.diversity import (
    AncestorDistance,
    KernelDensity,
    KNearest,
    OffspringNiches,
    ParentDistance,
)


def test_defaults_are_the_papers() -> None:
    config = Condition("paper").walk_config(0)
    assert config.offspring == 30
    assert config.metric == KNearest(15)
    assert (config.archive.limit, config.archive.chance, config.archive.scope) == (1200, 0.1, "walk")
    assert Condition("paper", metric="kde").walk_config(0).metric == KernelDensity(0.5, "factor", 1.0)


@pytest.mark.parametrize(
    ("metric", "expected"),
    [
        ("knn", KNearest(7)),
        ("knn-no-archive", KNearest(7, archive=False)),
        ("parent", ParentDistance()),
        ("ancestors", AncestorDistance()),
        ("kde", KernelDensity(0.2, "length", 0.9)),
        ("evolvability", OffspringNiches(4)),
    ],
)
def test_a_metric_takes_the_parameters_that_are_its_own(metric: Any, expected: object) -> None:
    condition = Condition("x", metric=metric, k=7, bandwidth=0.2, mode="length", decay=0.9, litter=4)
    assert condition.walk_config(0).metric == expected


@pytest.mark.parametrize(
    ("level", "selection", "share"),
    [("selective", Selective(), 0.0), ("0.25", TopFraction(0.25), 0.25), ("random", Uniform(), 1.0)],
)
def test_levels(level: str, selection: object, share: float) -> None:
    assert selection_of(level) == selection
    assert pressure_of(level) == share


def test_better_lets_no_fixed_share_pass() -> None:
    assert selection_of("better") == BetterThanParent()
    with pytest.raises(NichechainError, match="no fixed share"):
        pressure_of("better")


def test_seed_of_a_condition_depends_on_its_label_and_the_study_alone() -> None:
    seeds = {condition_seed(seed, label) for seed in (0, 1) for label in ("0.1", "0.25", "knn")}
    assert len(seeds) == 6
    assert Condition("0.1", k=3).walk_config(4).seed == Condition("0.1", k=5).walk_config(4).seed


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"level": "0"}, "level is '0', but must be selective, better, random, or a fraction"),
        ({"level": "1.5"}, "level is '1.5'"),
        ({"level": "nan"}, "level is 'nan'"),
        ({"level": "hard"}, "level is 'hard'"),
        ({"metric": "euclid"}, "metric is 'euclid'"),
        ({"mode": "matrix"}, "mode is 'matrix'"),
        ({"k": 0}, "k is 0"),
        ({"metric": "kde", "bandwidth": 0.0}, "bandwidth is 0.0"),
        ({"metric": "kde", "decay": 1.5}, "decay is 1.5"),
        ({"offspring": 0}, "offspring is 0"),
        ({"states": 0}, "states is 0"),
        ({"metric": "evolvability", "litter": 0}, "litter is 0"),
        ({"mutation": "jump"}, "mutation is 'jump'"),
        ({"scale": -1.0}, "scale is -1.0"),
        ({"archive_limit": 0}, "archive_limit is 0"),
        ({"archive_scope": "world"}, "archive scope is 'world'"),
        ({"initialisation": "zeros"}, "initialisation is 'zeros'"),
        ({"initialisation": "normal:-1"}, "initialisation is 'normal:-1'"),
        ({"label": "--"}, "label is '--'"),
    ],
)
def test_values_out_of_range(values: dict[str, Any], message: str) -> None:
    with pytest.raises(NichechainError, match=message):
        Condition(**{"label": "x", **values})
