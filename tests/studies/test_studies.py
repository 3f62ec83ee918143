import dataclasses
import json
from typing import Any

import pytest

from nichechain import domains
from nichechain.core.errors import NichechainError
from nichechain.studies import (
    LEVELS,
    METRICS,
    VARIATIONS,
    Condition,
    Study,
    metric_conditions,
    pressure_conditions,
    variations,
)

BASE = Condition("base", k=4)
STUDY = Study(
    "pressure",
    "arm",
    pressure_conditions(LEVELS, BASE),
    runs=50,
    steps=50,
    shape=(20, 20),
    bounds=domains.make("arm").bounds,
)


def test_the_papers_pressure_study() -> None:
    assert [condition.level for condition in STUDY.conditions] == [
        "selective",
        "0.1",
        "0.25",
        "0.5",
        "0.75",
        "random",
    ]
    # 51 states of 30 offspring each, and the start.
    assert STUDY.evaluations == 6 * 50 * (1 + 51 * 30)


def test_conditions_differ_in_what_is_compared_alone() -> None:
    for condition, metric in zip(metric_conditions(METRICS, BASE), METRICS, strict=True):
        assert dataclasses.replace(condition, label="base", metric="knn") == BASE
        assert condition.metric == metric


@pytest.mark.parametrize("name", VARIATIONS)
def test_a_variation_varies_one_field(name: str) -> None:
    conditions = variations(name, BASE)
    values = [dataclasses.asdict(condition) for condition in conditions]
    changed = {key for key in values[0] if len({str(value[key]) for value in values}) > 1}
    assert changed == {"label", *VARIATIONS[name]}


def test_through_json_and_back() -> None:
    assert Study.from_json(json.loads(json.dumps(STUDY.to_json()))) == STUDY


def test_json_of_an_earlier_version_and_of_a_later_one() -> None:
    values = STUDY.to_json()
    del values["paired"]
    assert Study.from_json(values) == STUDY
    with pytest.raises(NichechainError, match="missing or unknown values: colour"):
        Study.from_json({**values, "colour": 1})
    with pytest.raises(NichechainError, match="missing or unknown values: runs"):
        Study.from_json({name: value for name, value in values.items() if name != "runs"})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"runs": 0}, "runs is 0"),
        ({"steps": -1}, "steps is -1"),
        ({"seed": -1}, "seed is -1"),
        ({"kind": "speed"}, "kind is 'speed'"),
        ({"conditions": ()}, "at least 1 condition"),
        ({"conditions": (Condition("a b"), Condition("a-b"))}, "'a b' is given twice"),
        ({"conditions": (Condition("a", level="better"),)}, "lets no fixed share"),
        ({"shape": (0, 5)}, r"grid shape is \(0, 5\)"),
        ({"bounds": ((1.0, 0.0), (0.0, 1.0))}, "bounds are 1 to 0"),
    ],
)
def test_values_out_of_range(change: dict[str, Any], message: str) -> None:
    with pytest.raises(NichechainError, match=message):
        dataclasses.replace(STUDY, **change)


def test_no_such_variation() -> None:
    with pytest.raises(NichechainError, match="study is 'colour'"):
        variations("colour", BASE)
