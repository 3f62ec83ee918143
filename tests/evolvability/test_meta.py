"""Meta-evolvability against both generations made by hand."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from nichechain import Threads, variation
from nichechain.core.intervals import mean_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains import PlanarArm
from nichechain.domains.base import Evaluation
from nichechain.evolvability import meta_evolvability
from nichechain.niches import GridNiches

MUTATE = variation.gaussian(0.3)


class BreakingArm(PlanarArm):
    """An arm that breaks where its first joint is far from its rest."""

    def evaluate(self, genotypes):
        """Fail there."""
        fine = super().evaluate(genotypes)
        failed = np.abs(np.asarray(genotypes)[:, 0]) > 0.4
        behavior = np.where(failed[:, None], np.nan, fine.behavior)
        reasons = tuple("broken" if bad else "" for bad in failed)
        return Evaluation(behavior, np.where(failed, np.nan, fine.objective), failed, reasons)


DOMAIN = BreakingArm()
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
    """Mean over all choices of so many; None is nowhere, 16 is outside."""
    return np.mean([len(set(some) - {None, 16}) for some in combinations(states, size)])


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
