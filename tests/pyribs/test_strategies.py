"""Parents of what strategies emit: the birth nearest to their mean, the elite that they restart from."""

from __future__ import annotations

import numpy as np
import pytest
from ribs.emitters import EvolutionStrategyEmitter, GradientArborescenceEmitter
from ribs.schedulers import Scheduler

from nichechain.pyribs import record

from .searches import check_table, evaluate, gaussian, grid, search


@pytest.mark.parametrize("strategy", ["cma_es", "openai_es"])
def test_a_strategys_parent_is_the_birth_nearest_to_its_mean(strategy):
    archive = grid()
    options = {"mirror_sampling": False} if strategy == "openai_es" else {}
    emitter = EvolutionStrategyEmitter(
        archive,
        x0=np.zeros(5),
        sigma0=0.3,
        es=strategy,
        es_kwargs=options,
        restart_rule="basic",
        batch_size=12,
        seed=2,
    )
    recording = record(search(archive, gaussian(archive, 0.2), emitter))
    scheduler = Scheduler(archive, recording.emitters)
    added, mine = [], {}
    for step in range(5):
        optimizer = emitter._opt
        mean = optimizer.adam_opt.theta.copy() if strategy == "openai_es" else optimizer.mean.copy()
        solutions = scheduler.ask()
        first = sum(map(len, added)) + len(solutions) - 12
        added.append(solutions.copy())
        mine[step] = (np.arange(first, first + 12), mean)
        scheduler.tell(*evaluate(solutions))
    assert emitter.restarts == 0
    everything = np.concatenate(added)
    births = recording.births().to_pandas()
    for step, (uid, mean) in mine.items():
        parents = births["parent_uid"][uid]
        if step == 0:
            assert parents.isna().all()
            continue
        last = mine[step - 1][0]
        nearest = last[np.argmin(np.linalg.norm(everything[last] - mean, axis=1))]
        assert (parents == nearest).all()
    assert recording.conventions()[1]["parent"].startswith("the birth of its last batch nearest to its mean")


@pytest.mark.parametrize("convention", ["mean", "restart"])
def test_a_strategy_that_restarts_comes_from_the_elite_it_restarts_from(convention):
    archive = grid()
    emitter = EvolutionStrategyEmitter(
        archive, x0=np.zeros(5), sigma0=0.3, restart_rule=2, batch_size=12, seed=2
    )
    recording = record(search(archive, emitter), strategy_parent=convention)
    scheduler = Scheduler(archive, [emitter])
    added = []
    for _ in range(9):
        mean, restarted = emitter._opt.mean.copy(), emitter.itrs > 0 and emitter.itrs % 2 == 0
        added.append((scheduler.ask().copy(), mean, restarted))
        scheduler.tell(*evaluate(added[-1][0]))
    everything = np.concatenate([solutions for solutions, _, _ in added])
    parents = recording.births().to_pandas()["parent_uid"].to_numpy().reshape(9, 12)
    assert emitter.restarts == 4
    elite = np.nan
    for row, (_, mean, restarted) in zip(parents, added, strict=True):
        assert len(np.unique(row)) == 1
        if restarted:
            elite = row[0]
            np.testing.assert_array_equal(everything[int(elite)], mean)
        if convention == "restart":
            np.testing.assert_equal(row[0], elite)
    check_table(recording.births().to_pandas(), archive)


def test_branches_of_a_gradient_come_from_the_solution_they_branch_at():
    archive = grid()
    emitter = GradientArborescenceEmitter(
        archive, x0=np.full(5, 0.1), sigma0=0.5, lr=0.1, batch_size=8, seed=1
    )
    recording = record(search(archive, emitter))
    scheduler = Scheduler(archive, [emitter])
    rng = np.random.default_rng(0)
    for _ in range(4):
        point = scheduler.ask_dqd()
        objective, measures = evaluate(point)
        scheduler.tell_dqd(objective, measures, rng.normal(size=(1, 3, 5)))
        branches = scheduler.ask()
        scheduler.tell(*evaluate(branches))
    births = recording.births().to_pandas()
    assert len(births) == 4 * 9
    for k in range(4):
        assert (births["parent_uid"][9 * k + 1 : 9 * k + 9] == 9 * k).all()
    check_table(births, archive)
