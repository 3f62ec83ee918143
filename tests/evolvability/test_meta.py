"""Meta-evolvability against both generations made by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from nichechain import Threads, variation
from nichechain.core.intervals import mean_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability import meta_evolvability
from nichechain.niches import GridNiches

from ..arms import BrittleArm
from ..choices import mean_distinct

MUTATE = variation.gaussian(0.3)

DOMAIN = BrittleArm()
NICHES = GridNiches((4, 4), ((-0.5, 1.0), (-1.0, 1.0)))
ARCHIVE = SimpleNamespace(domain=DOMAIN, mutate=MUTATE, niches=NICHES)
ELITE = SimpleNamespace(genotype=DOMAIN.sample(1, seed=3)[0] * 0.2)


def landed(genotypes):
    evaluation = DOMAIN.evaluate(np.stack(genotypes))
    return [
        None if failed else int(NICHES.of(behavior[None])[0])
        for behavior, failed in zip(evaluation.behavior, evaluation.failed, strict=True)
    ]


def rarefied(states, size):
    """None is nowhere, 16 is outside."""
    return mean_distinct(states, size, nowhere=(None, 16))


@pytest.mark.parametrize("lineages", [None, 2])
def test_children_and_grandchildren_are_those_of_the_seed(lineages):
    children = [MUTATE(ELITE.genotype, keyed(5, Purpose.OFFSPRING, i)) for i in range(8)]
    born = landed(children)
    assert None in born
    expected = []
    for i, (child, state) in enumerate(zip(children, born, strict=True)):
        theirs = [MUTATE(child, keyed(5, Purpose.GRANDCHILD, 6 * i + j)) for j in range(6)]
        expected.append(0.0 if state is None else rarefied(landed(theirs), lineages or 6))
    found = meta_evolvability(ARCHIVE, ELITE, children=8, offspring=6, lineages=lineages, seed=5)
    np.testing.assert_allclose(found.of_children, expected)
    mean, low, high = mean_interval(expected)
    np.testing.assert_allclose((found.value, found.low, found.high), (mean, max(0.0, low), high))
    assert found.own == pytest.approx(rarefied(born, lineages or 6))
    assert (found.failed, found.lineages) == (born.count(None), lineages or 6)


def test_workers_and_more_children_change_no_child():
    with Threads(2) as executor:
        more = meta_evolvability(ARCHIVE, ELITE, children=20, offspring=6, executor=executor)
    few = meta_evolvability(ARCHIVE, ELITE, children=8, offspring=6)
    assert more.of_children[:8] == few.of_children


def test_one_offspring_each_reaches_a_niche_or_none():
    """The share of grandchildren that land in a niche."""
    found = meta_evolvability(ARCHIVE, ELITE, children=30, offspring=4, lineages=1)
    quarters = 4.0 * np.array(found.of_children)
    np.testing.assert_allclose(quarters, quarters.round(), atol=1e-9)
    assert 0.0 < found.value < 1.0


def test_where_all_children_fail_there_is_nothing_to_come():
    archive = SimpleNamespace(domain=DOMAIN, mutate=lambda parent, _: parent + 9.0, niches=NICHES)
    found = meta_evolvability(archive, ELITE, children=4, offspring=3)
    assert (found.value, found.own, found.failed) == (0.0, 0.0, 4)
