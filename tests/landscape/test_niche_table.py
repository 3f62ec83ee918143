"""The table of niches says what each room says on its own."""

import numpy as np
import pytest

import nichechain as nc
from nichechain.chain.structure import wormholes
from nichechain.landscape import find_dissimila, niche_table

ASKED = {"l": 2, "lineages": 10, "draws": 3}


@pytest.fixture(scope="module")
def table(arm_archive):
    return niche_table(arm_archive, **ASKED, children=4).set_index("niche")


def test_births_of_every_niche_that_was_visited(arm_archive, table):
    births = arm_archive.births()
    visits = births["child_niche"].value_counts()
    inside = visits[visits.index < len(arm_archive.niches)]
    assert table["visits"].to_dict() == inside.to_dict()
    assert table["births"].sum() == arm_archive.counts.births[table.index].sum()
    assert table["index"].tolist() == [arm_archive.niches.label(int(niche)) for niche in table.index]


def test_evolvability_is_that_of_niches(arm_archive, table):
    scores = nc.niche_evolvability(arm_archive.chain(), **ASKED)
    for column, values in {"evolvability": scores.value, "low": scores.low, "high": scores.high}.items():
        np.testing.assert_allclose(table[column], values[table.index], rtol=1e-12)


def test_curiosity_is_that_of_selected_parents(arm_archive, table):
    births = arm_archive.births()
    found = nc.curiosity(births[~births["lineage"].astype(bool)], by="niche").set_index("niche")
    known = table["curiosity"].dropna()
    assert known.to_dict() == found["score"].reindex(known.index).to_dict()
    assert known.index.isin(found.index).all()


def test_wormholes_have_two_ends(arm_archive, table):
    found = wormholes(arm_archive.chain(), beyond="both")
    flagged = found[found["wormhole"]]
    assert table["wormholes_out"].sum() == table["wormholes_in"].sum() == len(flagged)


def test_ratios_are_those_of_recorded_children(arm_archive, table):
    births = arm_archive.births()
    axes = [f"behavior_{name}" for name in arm_archive.meta.facts.behavior_names]
    niche = int(table["elite_children"].astype(int).idxmax())
    elite = arm_archive.elite(niche)
    own = births[(births["parent_uid"] == elite.uid) & births["failed"].isna()][axes].to_numpy()
    assert table.loc[niche, "elite_children"] == len(own) >= 4
    pairs = np.linalg.norm(own[:, None] - own, axis=2)[np.triu_indices(len(own), 1)]
    away = np.linalg.norm(own - elite.behavior, axis=1)
    assert table.loc[niche, "expected_ratio"] == pytest.approx(pairs.mean() / away.mean())
    known = table.dropna(subset=["expected_ratio"])
    assert (known["elite_children"] >= 4).all()
    expected = find_dissimila(known["expected_ratio"], np.ones(len(known))).dissimila
    assert known["dissimilum"].tolist() == expected.tolist()


def test_a_window_of_steps(arm_archive):
    births = arm_archive.births()
    end = int(births["step"].max())
    early = niche_table(arm_archive.during((0, end)), **ASKED)
    inside = births[(births["step"] < end) & (births["child_niche"] < len(arm_archive.niches))]
    assert early["visits"].sum() == len(inside)


def test_what_a_chain_without_a_posterior_does_not_tell(arm_archive):
    table = niche_table(arm_archive, **ASKED, estimator="mle")
    assert table["wormholes_out"].isna().all()
    assert table["evolvability"].notna().all()
