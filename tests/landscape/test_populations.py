"""Population evolvability of the steps of a search, against all pairs of births."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from nichechain import BuildConfig, GridNiches, NichechainError, Threads, build, load
from nichechain.landscape import population_course


def test_every_step_is_a_population(tmp_path):
    config = BuildConfig(
        "arm", (6, 6), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=91, initial=10, batch=40, scale=0.3
    )
    with Threads(1) as executor:
        build(config, tmp_path, executor)
    archive = load(tmp_path)
    births = archive.births()
    axes = [name for name in births.columns if name.startswith("behavior_")]
    births.loc[3, [*axes, "child_niche"]] = None
    course = population_course(births, archive.niches)
    assert course["births"].tolist() == [9, 40, 40, 1]
    assert course["step"].tolist() == [0, 1, 2, 3]
    made = births[births["step"] == 0].drop(index=3)
    places = made[axes].to_numpy(float)
    apart = [np.hypot(*(a - b)) for a, b in combinations(places, 2)]
    assert course["population_evolvability"][0] == pytest.approx(np.mean(apart))
    assert np.isnan(course["population_evolvability"][3])
    inside = made["child_niche"][made["child_niche"] < 36]
    assert course["one_hot_evolvability"][0] == pytest.approx(inside.nunique() / 36)


def test_births_of_other_axes_are_refused(tmp_path):
    config = BuildConfig("arm", (6, 6), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=20, initial=10)
    with Threads(1) as executor:
        build(config, tmp_path, executor)
    births = load(tmp_path).births()
    with pytest.raises(NichechainError, match="births have 2 axes of behavior, but must have 1"):
        population_course(births, GridNiches((5,), ((0.0, 1.0),)))
    with pytest.raises(NichechainError, match="births have no column step"):
        population_course(births.drop(columns="step"), load(tmp_path).niches)
