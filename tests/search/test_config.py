"""The configuration: there and back through JSON, and values it refuses."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from nichechain.core.errors import NichechainError
from nichechain.search.config import BuildConfig

ARM = BuildConfig("arm", (7, 9), ((-1.0, 1.0), (-0.5, 1.5)))
OTHER = BuildConfig(
    "fetch",
    (3, 4, 5),
    ((0.0, 1.0), (2.0, 3.5), (-1e-9, 1e9)),
    domain_seed=3,
    evaluations=10**9,
    outside="absorb",
    initial=1,
    batch=7,
    mutation="student-t",
    scale=0.1,
    replacement="objective",
    seed=2**63,
)


@pytest.mark.parametrize("config", [ARM, OTHER])
def test_there_and_back_through_json(config: BuildConfig) -> None:
    back = BuildConfig.from_json(json.loads(json.dumps(config.to_json())))
    assert back == config
    assert hash(back) == hash(config)
    assert isinstance(back.bounds[0], tuple)


def test_json_names_every_field() -> None:
    names = {field.name for field in dataclasses.fields(BuildConfig)}
    # The usual epsilon is left out, as before there was one.
    assert set(ARM.to_json()) == names - {"epsilon"}
    assert set(dataclasses.replace(ARM, epsilon=1e-3).to_json()) == names


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"evaluations": 0}, "evaluations is 0, but must be at least 1"),
        ({"evaluations": -5}, "evaluations is -5"),
        ({"initial": 0}, "initial is 0, but must be at least 1"),
        ({"batch": 0}, "batch is 0, but must be at least 1"),
        ({"seed": -1}, "seed is -1, but must not be negative"),
        ({"lineage_share": 1.0}, "lineage_share is 1, but must be a share of births, from 0 to below 1"),
        ({"lineage_length": 1}, "lineage_length is 1, but must be at least 2"),
        ({"lineage_brood": 0}, "lineage_brood is 0, but must be at least 1"),
        ({"domain_seed": -1}, "domain_seed is -1, but must not be negative"),
        (
            {"replacement": "best"},
            "replacement is 'best', but must be one of random, first, newest, objective",
        ),
    ],
)
def test_values_out_of_range(change: dict[str, Any], message: str) -> None:
    with pytest.raises(NichechainError, match=message):
        dataclasses.replace(ARM, **change)


def test_json_with_values_missing_or_unknown() -> None:
    values = ARM.to_json()
    del values["domain"]
    with pytest.raises(NichechainError, match="missing or unknown values: domain"):
        BuildConfig.from_json(values)
    with pytest.raises(NichechainError, match="missing or unknown values: speed"):
        BuildConfig.from_json({**ARM.to_json(), "speed": 1})


def test_a_value_that_an_earlier_version_did_not_know_is_its_default() -> None:
    values = dataclasses.replace(ARM, seed=BuildConfig.seed).to_json()
    del values["seed"]
    assert BuildConfig.from_json(values) == dataclasses.replace(ARM, seed=BuildConfig.seed)


def test_a_build_of_before_there_were_lineages_has_none() -> None:
    values = ARM.to_json()
    del values["lineage_share"], values["lineage_length"], values["lineage_brood"]
    assert BuildConfig.from_json(values) == dataclasses.replace(ARM, lineage_share=0.0, lineage_brood=1)


def test_lineages_of_a_build_of_before_there_were_broods_begin_alone() -> None:
    values = ARM.to_json()
    del values["lineage_brood"]
    assert BuildConfig.from_json(values) == dataclasses.replace(ARM, lineage_brood=1)


def test_is_immutable() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        ARM.seed = 3  # type: ignore[misc]
