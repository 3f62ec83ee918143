"""Archives as their users see them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from nichechain import Archive, NicheChain, build, l_evolvability, load
from nichechain.archive.building import BuildProgress
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.domains import FetchPickAndPlace, PlanarArm
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig

ARM = BuildConfig(
    "arm", (6, 5), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=800, initial=50, batch=32, scale=0.5, seed=2
)
FETCH = BuildConfig(
    "fetch", (4, 4), FetchPickAndPlace.bounds, domain_seed=1, evaluations=12, initial=8, batch=4, seed=3
)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    folder = tmp_path_factory.mktemp("arm")
    with Threads(1) as executor:
        build(ARM, folder, executor)
    return load(folder)


@pytest.fixture(scope="module")
def fetch(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    folder = tmp_path_factory.mktemp("fetch")
    with Threads(2) as executor:
        build(FETCH, folder, executor)
    return load(str(folder))


def test_says_what_it_is(arm: Archive) -> None:
    assert arm.config == ARM
    assert (arm.niches.shape, arm.niches.bounds, arm.niches.outside) == (ARM.shape, ARM.bounds, "state")
    assert arm.filled == sum(arm.elites.niche < 30) == len(arm.elites) - 1
    assert repr(arm) == f"Archive({str(arm.folder)!r}: {arm.filled} of 30 niches filled by 800 births)"
    assert isinstance(arm.domain, PlanarArm)
    parent = np.zeros(4, np.float32)
    noise = np.random.default_rng(0).standard_cauchy(4)
    np.testing.assert_array_equal(
        arm.mutate(parent, np.random.default_rng(0)), (0.5 * noise).astype(np.float32)
    )


def test_elite_of_a_niche(arm: Archive) -> None:
    births = arm.births().set_index("uid")
    for row, state in enumerate(arm.elites.niche[:-1].tolist()):
        elite = arm.elite(state)
        assert elite.state == state
        assert elite.niche == (state // 5, state % 5)
        birth = births.loc[elite.uid]
        assert birth["child_niche"] == state
        assert (birth["depth"], birth["objective"]) == (elite.depth, elite.objective)
        assert elite.behavior.tolist() == [birth["behavior_x"], birth["behavior_y"]]
        np.testing.assert_array_equal(elite.genotype, arm.elites.genotype[row])
        # By grid index it is the same elite, and the domain agrees about its behavior.
        assert arm.elite(elite.niche).uid == elite.uid
        np.testing.assert_array_equal(arm.domain.evaluate(elite.genotype[None]).behavior[0], elite.behavior)


def test_niches_without_an_elite(arm: Archive) -> None:
    empty = sorted(set(range(30)) - set(arm.elites.niche.tolist()))
    # Corners of the box that are out of the arm's reach.
    assert empty
    for state in empty:
        with pytest.raises(
            NichechainError,
            match=f"niche {state // 5},{state % 5} is empty: {arm.filled} of 30 have an elite",
        ):
            arm.elite(state)


@pytest.mark.parametrize(
    ("niche", "message"),
    [
        (31, "niche is 31, but the grid has niches 0 to 29"),
        (-1, "niche is -1"),
        ((6, 0), "this grid runs from 0,0 to 5,4"),
        ((0, -1), "this grid runs from"),
        ((1, 2, 3), "has 2 indices"),
    ],
)
def test_niches_that_do_not_exist(arm: Archive, niche: int | tuple[int, ...], message: str) -> None:
    with pytest.raises(NichechainError, match=message):
        arm.elite(niche)


def test_births_as_a_data_frame(arm: Archive) -> None:
    births = arm.births()
    assert {name: str(dtype) for name, dtype in births.dtypes.items()} == {
        "run": "Int32",
        "uid": "Int64",
        "parent_uid": "Int64",
        "depth": "Int32",
        "parent_niche": "Int32",
        "child_niche": "Int32",
        "behavior_x": "float64",
        "behavior_y": "float64",
        "objective": "float64",
        "accepted": "boolean",
        "failed": "string",
        "step": "Int32",
        "lineage": "boolean",
    }
    assert births["uid"].tolist() == list(range(800))
    initial = births["uid"] < 50
    for name in ("parent_uid", "parent_niche"):
        assert births[name].isna().equals(initial.astype(bool))
    # An arm never fails.
    assert births["failed"].isna().all()
    assert births["child_niche"].notna().all()
    assert births["child_niche"].max() == 30


class FragileArm(PlanarArm):
    """An arm whose first joint may not be bent at all to the left."""

    name = "fragile"

    def evaluate(self, genotypes):  # type: ignore[no-untyped-def]
        angles = np.array(genotypes)
        angles[angles[:, 0] > 0.05, 0] = np.nan
        return super().evaluate(angles)


def test_births_that_failed_are_null(tmp_path: Path) -> None:
    config = replace(ARM, domain="fragile", evaluations=200)
    seen: list[BuildProgress] = []
    with Threads(1) as executor:
        build(config, tmp_path, executor, domain=FragileArm(), on_progress=seen.append)
    archive = load(tmp_path, domain=FragileArm())
    births = archive.births()
    failed = births["failed"].notna()
    assert 20 < failed.sum() == seen[-1].failed < 180
    assert set(births["failed"][failed]) == {"genotype is not finite"}
    for name in ("child_niche", "behavior_x", "behavior_y", "objective"):
        assert births[name].isna().equals(failed)
    assert not births["accepted"][failed].any()
    assert archive.counts.visits.sum() == (~failed).sum()
    assert archive.counts.matrix.sum() == (births["parent_niche"].notna() & ~failed).sum()
    assert isinstance(archive.domain, FragileArm)


def test_domain_that_nobody_knows_by_name(tmp_path: Path) -> None:
    config = replace(ARM, domain="fragile", evaluations=60)
    with Threads(1) as executor:
        build(config, tmp_path, executor, domain=FragileArm())
    archive = load(tmp_path)
    # All but what needs the domain is there.
    assert len(archive.births()) == 60
    assert archive.elite(int(archive.elites.niche[0])).genotype.shape == (10,)
    with pytest.raises(NichechainError, match="domain is 'fragile'"):
        archive.domain  # noqa: B018


def test_counts_are_a_cross_table_of_the_births(arm: Archive) -> None:
    births = arm.births()
    # Births of lineages are kept apart.
    selected = births[~births["lineage"]]
    table = pd.crosstab(selected["parent_niche"], selected["child_niche"])
    expected = table.reindex(index=range(31), columns=range(31), fill_value=0).to_numpy()
    np.testing.assert_array_equal(arm.counts.matrix.toarray(), expected)
    assert expected.sum() + (arm.counts.lineages[:, 2] > 1).sum() == 750
    visits = births["child_niche"].value_counts().reindex(range(31), fill_value=0)
    np.testing.assert_array_equal(arm.counts.visits, visits)
    assert arm.counts.niches == arm.niches


def test_chain_is_estimated_from_all_births(arm: Archive) -> None:
    chain = arm.chain("mle")
    assert isinstance(chain, NicheChain)
    assert (chain.states, chain.n_niches, chain.outside) == (31, 30, 30)
    counts = arm.counts.matrix.toarray()
    dense = np.asarray(chain.T.toarray() if hasattr(chain.T, "toarray") else chain.T)
    observed = counts.sum(axis=1) > 0
    np.testing.assert_allclose(dense[observed], counts[observed] / counts[observed].sum(1, keepdims=True))
    default = arm.chain()
    assert default.estimator.startswith("empirical-bayes")
    assert default.counts is arm.counts
    with pytest.raises(NichechainError, match="estimator is 'magic'"):
        arm.chain("magic")


def test_an_arm_has_no_controller(arm: Archive) -> None:
    with pytest.raises((TypeError, NichechainError), match="not a controller"):
        arm.controller(int(arm.elites.niche[0]))


def test_controller_of_an_elite_acts_like_it(fetch: Archive) -> None:
    import torch

    assert fetch.domain.seed == 1
    domain = FetchPickAndPlace(seed=1)
    observations = np.random.default_rng(0).normal(0, 1, (20, 25)).astype(np.float32)
    for state in fetch.elites.niche[fetch.elites.niche < 16].tolist():
        elite = fetch.elite(state)
        with torch.no_grad():
            actions = fetch.controller(state)(torch.from_numpy(observations)).numpy()
        expected = domain.actions(elite.genotype, observations)
        # Cauchy weights are large, so a sum's rounding is relative to its largest terms.
        tolerance = 1e-5 if elite.depth == 0 else 1e-2
        np.testing.assert_allclose(actions, expected, atol=tolerance)
        np.testing.assert_array_equal(domain.evaluate(elite.genotype[None]).behavior[0], elite.behavior)


def test_fetch_births(fetch: Archive) -> None:
    births = fetch.births()
    assert len(births) == 12
    assert births["depth"].tolist() == [0] * 8 + [1] * 4
    assert births["parent_uid"][8:].isin(range(8)).all()
    # The first births have the genotypes that the domain itself would start with.
    sample = FetchPickAndPlace().sample(
        8, seed=np.random.default_rng(np.random.SeedSequence(3, spawn_key=(0, 0)))
    )
    for uid, genotype in zip(fetch.elites.uid, fetch.elites.genotype, strict=True):
        if uid < 8:
            np.testing.assert_array_equal(genotype, sample[uid])


def test_paths_without_an_archive(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "file", tmp_path / "nowhere"):
        with pytest.raises(ArchiveError, match=f"{path} is no archive"):
            load(path)
    with pytest.raises(ArchiveError, match="no-such-archive"):
        load("no-such-archive")
    with pytest.raises(ArchiveError, match="no-such-archive"):
        load("archives/no-such-archive")


def test_an_archive_is_its_last_commit(tmp_path: Path) -> None:
    with Threads(1) as executor:
        build(replace(ARM, evaluations=60), tmp_path, executor)
        first = load(tmp_path)
        build(replace(ARM, evaluations=90), tmp_path, executor)
    assert first.meta.births == 60
    assert load(tmp_path).meta.births == len(load(tmp_path).births()) == 90


def test_the_outside_state_can_be_asked():
    """Its elite, its row and its l-evolvability (spec 1.2)."""
    archive = load("fetch-pick-and-place")
    elite = archive.elite("outside")
    assert elite.state == 400
    assert elite.niche is None
    assert elite.uid == archive.elite(400).uid == int(archive.elites.uid[-1])
    assert int(archive.births().set_index("uid").loc[elite.uid, "child_niche"]) == 400
    chain = archive.chain(estimator="mle", unvisited="self")
    value = l_evolvability(chain, niche="outside", l=1, lineages=1).value
    row = chain.T[[400]].toarray()[0]
    assert value == pytest.approx(row[:400].sum(), abs=1e-12)
    with pytest.raises(NichechainError, match="'elsewhere', but must be an index, a number, or 'outside'"):
        archive.elite("elsewhere")
