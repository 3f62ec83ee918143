"""Curiosity scores against a plain account of the births, and the draw that follows them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from nichechain import BuildConfig, NichechainError, Threads, build, load, variation
from nichechain.domains import PlanarArm
from nichechain.niches import GridNiches
from nichechain.search.map_elites import MapElites
from nichechain.search.parents import FLOOR, CuriousParents, curiosity
from nichechain.search.selection import Told, draw_parents

CONFIG = BuildConfig(
    "arm",
    (9, 7),
    ((-0.7, 1.0), (-0.9, 0.8)),
    evaluations=1200,
    initial=60,
    batch=40,
    scale=0.3,
    seed=5,
    selection="curiosity",
    lineage_brood=1,
)


def built(folder: Path, *budgets: int, config: BuildConfig = CONFIG):
    for evaluations in budgets or (config.evaluations,):
        with Threads(1) as executor:
            build(replace(config, evaluations=evaluations), folder, executor)
    return load(folder)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    return built(tmp_path_factory.mktemp("curious"))


def plain_scores(births: pd.DataFrame) -> dict[int, float]:
    scores: dict[int, float] = {}
    for row in births.itertuples():
        if not pd.isna(row.parent_uid):
            scores[row.parent_uid] = scores.get(row.parent_uid, 0.0) + (1.0 if row.accepted else -0.5)
    return scores


def test_parents_are_drawn_by_the_scores_of_the_elites_before_them(archive):
    births = archive.births()
    elite_of: dict[int, int] = {}
    for step, rows in births.groupby("step"):
        if step:
            niches = sorted(elite_of)
            scores = plain_scores(births[births["step"] < step])
            weights = np.array([max(scores.get(elite_of[niche], 0.0), FLOOR) for niche in niches])
            # SELECTION is stream 1 of the archive format.
            stream = np.random.SeedSequence(CONFIG.seed, spawn_key=(1, step))
            drawn = np.random.default_rng(stream).choice(
                len(niches), size=CONFIG.batch, p=weights / weights.sum()
            )
            # The budget ends within the last step.
            expected = np.array([niches[k] for k in drawn[: len(rows)]])
            # Whoever is born of a lineage has its latest birth for a parent.
            own = ~rows["lineage"].to_numpy(bool)
            assert rows["parent_niche"][own].tolist() == expected[own].tolist()
            assert rows["parent_uid"][own].tolist() == [elite_of[niche] for niche in expected[own]]
        for row in rows.itertuples():
            if row.accepted:
                elite_of[row.child_niche] = row.uid


@pytest.mark.parametrize("replacement", ["random", "objective"])
def test_a_build_that_was_interrupted_has_the_same_births(replacement, tmp_path):
    config = replace(CONFIG, replacement=replacement)
    once = built(tmp_path / "once", config=config)
    often = built(tmp_path / "often", 30, 61, 500, 501, 1200, config=config)
    assert once.births().equals(often.births())
    np.testing.assert_array_equal(once.elites.genotype, often.elites.genotype)


def test_curious_parents_have_children_that_enter_more_often(archive, tmp_path):
    uniform = built(tmp_path, config=replace(CONFIG, selection="uniform"))
    entered = [one.births().query("step > 5")["accepted"].mean() for one in (archive, uniform)]
    assert entered[0] > entered[1]


def test_a_search_cannot_go_on_without_its_scores():
    niches = GridNiches(CONFIG.shape, CONFIG.bounds)
    search = MapElites(PlanarArm(), niches, variation.cauchy(), CONFIG, selection=CuriousParents())
    with pytest.raises(NichechainError, match="selection is missing: the configuration asks for curiosity"):
        MapElites(PlanarArm(), niches, variation.cauchy(), CONFIG, search.state)


@given(
    st.lists(st.tuples(st.integers(-1, 4), st.booleans()), max_size=60),
    st.randoms(use_true_random=False),
)
@settings(max_examples=60, deadline=None)
def test_scores_are_a_fold_over_births_in_any_order(births, random):
    shuffled = list(births)
    random.shuffle(shuffled)
    found = []
    for rows in (births, shuffled):
        parents = CuriousParents()
        cut = len(rows) // 3
        for part in (rows[:cut], rows[cut:]):
            uid, none = np.array([p for p, _ in part], np.int64), np.zeros(len(part), np.int64)
            parents.tell(Told(uid, none, none, np.array([a for _, a in part], bool), none, none, none > 0))
        found.append(parents.scores(np.arange(5)))
    np.testing.assert_array_equal(*found)
    for uid in range(5):
        children = [entered for parent, entered in births if parent == uid]
        assert found[0][uid] == 1.5 * sum(children) - 0.5 * len(children)


def test_elites_are_drawn_in_proportion_to_their_score_or_the_floor():
    parents = CuriousParents()
    uid = np.array([0] * 6 + [2, 2] + [3] * 2)
    accepted = np.array([False] * 6 + [True, False] + [True] * 2)
    none = np.zeros(uid.size, np.int64)
    parents.tell(Told(uid, none, none, accepted, none, none, none > 0))
    expected = np.array([FLOOR, FLOOR, 0.5, 2.0])
    weights = parents.weights(np.zeros(4, np.int64), np.arange(4))
    np.testing.assert_array_equal(weights, expected)
    drawn = np.bincount(draw_parents(weights, 4, 100_000, np.random.default_rng(0)), minlength=4)
    assert stats.chisquare(drawn, 100_000 * expected / expected.sum()).pvalue > 1e-3


def test_scores_of_all_elites_come_from_a_table_of_births(archive):
    table = curiosity(archive.births())
    assert dict(zip(table["uid"], table["score"], strict=True)) == plain_scores(archive.births())
    assert (table["rate"] == table["entered"] / table["children"]).all()
    np.testing.assert_allclose(table["score"] / table["children"], 1.5 * table["rate"] - 0.5)
    # An elite is born once, in the niche that its children have for their parent.
    born = archive.births().set_index("uid")["child_niche"]
    assert table["niche"].tolist() == born.loc[table["uid"]].tolist()


def test_scores_of_niches_are_those_of_all_their_elites(archive):
    elites, niches = curiosity(archive.births()), curiosity(archive.births(), by="niche")
    sums = elites.groupby("niche")[["children", "entered", "score"]].sum()
    pd.testing.assert_frame_equal(sums.reset_index(), niches[["niche", "children", "entered", "score"]])
    assert niches["children"].sum() == CONFIG.evaluations - CONFIG.initial


def test_births_that_do_not_tell_are_refused(archive):
    births = archive.births()
    nobody = births.assign(parent_uid=pd.Series([None] * len(births), dtype="Int64"))
    assert len(curiosity(nobody, by="niche"))
    with pytest.raises(NichechainError, match="do not say who had them: column parent_uid"):
        curiosity(nobody)
    unknown = births.assign(accepted=pd.Series([None] * len(births), dtype="boolean"))
    with pytest.raises(NichechainError, match="which children entered the archive: column accepted"):
        curiosity(unknown, by="niche")
    with pytest.raises(NichechainError, match="by is 'cell', but must be one of elite, niche"):
        curiosity(births, by="cell")
