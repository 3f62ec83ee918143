"""Long questions tell how far they are: one call for each draw, fit or resample that is done."""

import numpy as np
import pytest

import nichechain as nc
from nichechain.evolvability import elite_evolvability, genotype_evolvability, prior_sensitivity
from nichechain.evolvability.by_generation import evolvability_table
from nichechain.evolvability.niches import answer
from nichechain.evolvability.question import Question, Root
from nichechain.evolvability.reach import reach

FEW = {"l": 2, "lineages": 3, "draws": 4}


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    config = nc.BuildConfig("arm", (4, 4), ((-1, 1), (-1, 1)), evaluations=600, scale=0.3)
    with nc.Threads(1) as threads:
        return nc.build(config, tmp_path_factory.mktemp("told") / "arm", threads)


@pytest.mark.parametrize(
    ("ask", "calls"),
    [
        (lambda a, tell: reach(a.chain(), niche=5, **FEW, on_done=tell), 4),
        (lambda a, tell: answer(a.chain(), Root(a.chain(), niche=5), Question(2, 3, draws=4), tell), 4),
        (lambda a, tell: elite_evolvability(a, **FEW, on_done=tell), 4),
        (lambda a, tell: genotype_evolvability(a, a.elite(5), **FEW, on_done=tell), 4),
        (lambda a, tell: evolvability_table(a.chain(), 2, [3], draws=4, on_done=tell), 4),
        (lambda a, tell: nc.bootstrap_elites(a.counts, resamples=3, **FEW, on_done=tell), 3),
        (lambda a, tell: prior_sensitivity(a.counts, **FEW, on_done=tell), 5),
    ],
)
def test_each_is_told_and_changes_nothing(archive, ask, calls):
    told = []
    found = ask(archive, told.append)
    assert told == [1] * calls
    same = ask(archive, None)
    value = getattr(found, "at_least_one", getattr(found, "value", found))
    other = getattr(same, "at_least_one", getattr(same, "value", same))
    assert np.array_equal(np.asarray(value), np.asarray(other))
