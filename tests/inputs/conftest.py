from __future__ import annotations

import itertools
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import nichechain as nc
from nichechain import domains, studies, validation, variation
from nichechain.archive import read
from nichechain.archive.imported import import_births
from nichechain.archive.merge import merge
from nichechain.chain.counts import TransitionCounts
from nichechain.domains.policies.controllers import MLP
from nichechain.evolvability.reach import reach
from nichechain.landscape import measure_archive
from nichechain.niches import CVTNiches, GridNiches
from nichechain.studies.searches import SelectionStudy, run_searches
from nichechain.walks import WalkConfig


def _counts(rng: np.random.Generator) -> TransitionCounts:
    """Births of a few elites in each of six niches and outside."""
    niches = GridNiches((3, 2), ((0.0, 3.0), (0.0, 2.0)))
    parent = np.repeat(np.arange(7), 40)
    elite = parent * 10 + np.tile(np.arange(40) // 8, 7)
    child = (parent + rng.integers(0, 3, parent.size)) % 7
    return TransitionCounts.from_births(parent, child, niches, elite=elite)


class _Here:
    """An executor without workers."""

    def evaluate(self, domain: Any, genotypes: Any, on_done: Any = None) -> Any:  # noqa: ARG002
        return domain.evaluate(genotypes)


class _Stopped(_Here):
    """One that is stopped at its second call."""

    calls = 0

    def evaluate(self, domain: Any, genotypes: Any, on_done: Any = None) -> Any:
        self.calls += 1
        if self.calls == 2:
            raise KeyboardInterrupt
        return super().evaluate(domain, genotypes, on_done)


def _scheduler() -> Any:
    from ribs.archives import GridArchive
    from ribs.emitters import GaussianEmitter
    from ribs.schedulers import Scheduler

    archive = GridArchive(solution_dim=3, dims=(4, 4), ranges=((0, 1), (0, 1)))
    return Scheduler(archive, [GaussianEmitter(archive, sigma=0.1, x0=[0.0] * 3, batch_size=2)])


@pytest.fixture(scope="session")
def world(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """Small objects of every kind, to call public functions with."""
    folder: Path = tmp_path_factory.mktemp("inputs")
    arm = domains.make("arm")
    config = nc.BuildConfig("arm", (5, 5), arm.bounds, evaluations=400, scale=0.2)
    with nc.Threads(1) as threads:
        nc.build(config, folder / "arm", threads)
    archive = nc.load(folder / "arm")
    counts = _counts(np.random.default_rng(0))
    given = nc.NicheChain(np.array([[0.5, 0.5, 0.0], [0.1, 0.6, 0.3], [0.0, 0.2, 0.8]]))
    for name, other in (
        ("again", nc.BuildConfig("arm", (5, 5), arm.bounds, evaluations=400, scale=0.2, seed=1)),
        ("spare", config),
        ("other", nc.BuildConfig("arm", (4, 5), arm.bounds, evaluations=400, scale=0.2, seed=2)),
    ):
        with nc.Threads(1) as threads:
            nc.build(other, folder / name, threads)
    (folder / "log.csv").write_text("parent_niche,child_niche\n0,1\n1,2\n")
    import_births(folder / "log.csv", folder / "imported", counts.niches)
    merge((folder / "arm", folder / "again"), folder / "merged")
    with suppress(KeyboardInterrupt):
        nc.build(config, folder / "unfinished", _Stopped())
    study = studies.Study(
        "pressure", "arm", (studies.Condition("a", offspring=2),), 1, 0, (2, 2), ((0, 1), (0, 1))
    )
    here = _Here()
    studies.run(study, folder / "study", here)
    small = nc.BuildConfig("arm", (3, 3), arm.bounds, evaluations=60, initial=30, scale=0.2)
    selection_study = SelectionStudy(small, ("uniform", "reach"), runs=2, elites=1, offspring=2)
    run_searches(selection_study, folder / "selections", here)
    chain = archive.chain()
    filled = archive.elites.niche[archive.elites.niche < len(archive.niches)]
    lineages = validation.run_lineages(archive, filled[:4], here, l=2, lineages=3, offspring=2)
    number = itertools.count()
    walk = WalkConfig(offspring=3)
    return SimpleNamespace(
        axes=lambda: Figure().subplots(),
        records=studies.read_records(folder / "study").to_pandas(),
        archive_scores=nc.niche_evolvability(chain, l=1, lineages=2, draws=2),
        reached=reach(chain, niche=0, l=1, draws=2),
        check=validation.compare(chain, lineages, archive.niches, draws=2),
        here=here,
        again=folder / "again",
        other=folder / "other",
        spare=folder / "spare",
        imported=folder / "imported",
        merged=folder / "merged",
        unfinished=folder / "unfinished",
        other_config=other,
        log=folder / "log.csv",
        study=folder / "study",
        selection_study=selection_study,
        selections=folder / "selections",
        fresh=lambda: folder / f"fresh-{next(number)}",
        scheduler=_scheduler,
        chain=chain,
        filled=filled,
        lineages=lineages,
        triples=validation.Triples.from_births(archive.births()),
        walk=walk,
        linear=domains.make("linear"),
        noise=domains.Noise(action=0.1),
        noisy=domains.Noisy(arm, domains.Noise(action=0.1)),
        cvt=CVTNiches([[0.2, 0.3], [0.7, 1.1], [0.5, 0.5]], ((0.0, 1.0), (0.0, 2.0))),
        mlp=MLP((3, 4, 2)),
        walked=nc.walk(arm, variation.cauchy(0.2), walk, runs=1, steps=0),
        scores=nc.niche_evolvability(given, l=1, lineages=2),
        landscape=measure_archive(archive, 2, elites=3),
        folder=folder,
        arm=arm,
        mutate=variation.cauchy(0.2),
        config=config,
        archive=archive,
        elite=archive.elite(archive.niches.index(int(archive.elites.niche[0]))),
        births=archive.births(),
        table=read.read_births(archive.folder, archive.meta),
        counts=counts,
        estimated=nc.estimate(counts),
        given=given,
        niches=counts.niches,
        rng=np.random.default_rng(0),
        genotypes=arm.sample(4, seed=0),
    )
