import base64
import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import nichechain as nc
from nichechain.chain.counts import TransitionCounts
from nichechain.core.errors import NichechainError
from nichechain.evolvability.returns import all_return_probabilities
from nichechain.niches import CVTNiches, GridNiches
from nichechain.plots.explorer import transitions as kept
from nichechain.plots.explorer import write_explorer
from nichechain.plots.explorer.page import explorer_page
from nichechain.plots.explorer.transitions import rounded_transition


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("explorer") / "arm"
    config = nc.BuildConfig("arm", (6, 9), ((-0.9, 0.9), (-1, 1)), evaluations=900, scale=0.3)
    with nc.Threads(1) as threads:
        nc.build(config, folder, threads)
    return nc.load(folder)


@pytest.fixture(scope="module")
def page(archive):
    return explorer_page(archive, archive.chain(), l=3, lineages=20, draws=4, seed=1)


def embedded(page):
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    return json.loads(text)


def numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), np.dtype(kind).newbyteorder("<"))


def dense(chain):
    return chain.T if isinstance(chain.T, np.ndarray) else chain.T.toarray()


@pytest.mark.parametrize("outside", ["state", "absorb", "clip"])
@pytest.mark.parametrize("estimator", ["empirical-bayes", "dirichlet", "mle"])
def test_what_is_kept_is_the_whole_matrix(outside, estimator):
    niches = GridNiches((4, 7), ((0, 1), (0, 2)), outside)
    rng = np.random.default_rng(3)
    parent = rng.integers(0, niches.states - 4, 600)
    child = np.minimum(parent + rng.geometric(0.3, 600) - 1, niches.states - 1)
    if outside == "absorb":
        parent, child = parent[parent < 28], child[parent < 28]
    elite = parent * 3 + rng.integers(0, 3, parent.size)
    counts = TransitionCounts.from_births(parent, child, niches, elite=elite)
    chain = nc.estimate(counts, estimator)
    whole, each = rounded_transition(chain)
    assert each == 0
    whole = whole.toarray()
    np.testing.assert_allclose(whole, dense(chain), atol=1e-7)
    powers = [np.diagonal(np.linalg.matrix_power(whole, k)) for k in range(1, 10)]
    np.testing.assert_allclose(all_return_probabilities(whole, 9), powers, atol=1e-13)


def test_page_needs_no_network(page):
    assert "default-src 'none'" in page
    assert re.findall(r"https?://[^\"' ]*", page) == ["http://www.w3.org/2000/svg"] * 3
    assert not re.search(
        r"\b(src|href)\s*=|@import|url\(https?",
        page.replace("http-equiv", "").replace("image.src = `data:", ""),
    )
    assert "/*" + "DATA" not in page


def test_page_holds_what_the_archive_does(archive, page):
    data = embedded(page)
    n = len(archive.niches)
    assert data["filled"] == archive.filled
    assert (numbers(data["visits"], np.uint32) == archive.counts.visits).all()
    assert (numbers(data["children"], np.uint32) == archive.counts.births).all()
    elites = numbers(data["elites"], np.float64).reshape(5, n)
    elite = archive.elite(int(archive.elites.niche[2]))
    expected = [elite.objective, elite.depth, elite.uid, *elite.behavior]
    assert elites[:, elite.state].tolist() == expected
    assert np.isfinite(elites[0]).sum() == archive.filled
    index = data["countStart"], data["countColumn"], data["count"]
    start, column, count = (numbers(x, k) for x, k in zip(index, ("u4", "u2", "u4"), strict=True))
    births = archive.births().dropna(subset=["parent_niche"])
    row = int(births["parent_niche"].iloc[7])
    pairs = births[births["parent_niche"] == row]["child_niche"].value_counts().to_dict()
    assert dict(zip(column[start[row] :], count[start[row] : start[row + 1]], strict=False)) == pairs


def test_every_stop_has_the_numbers_of_the_library(archive, page):
    data = embedded(page)
    assert data["sizes"] == [1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 300, 500, 1000]
    scale = numbers(data["scoreScale"], np.float32).reshape(3, 13, 10, 1)
    scores = numbers(data["scores"], np.uint16).reshape(3, 13, 10, len(archive.niches)) * scale / 65535
    for u, lineages in enumerate(data["sizes"]):
        for l in (1, 3, 10):
            expected = nc.niche_evolvability(archive.chain(), l=l, lineages=lineages, draws=4, seed=1)
            # To half a step of the largest number.
            found = scores[:, u, l - 1]
            np.testing.assert_allclose(found, [expected.value, expected.low, expected.high], atol=54 / 1e5)


def test_number_of_a_niche_is_the_one_of_the_command_line(archive):
    data = embedded(explorer_page(archive, archive.chain()))
    scale = numbers(data["scoreScale"], np.float32).reshape(3, 13, 10, 1)
    scores = numbers(data["scores"], np.uint16).reshape(3, 13, 10, -1) * scale / 65535
    expected = nc.l_evolvability(archive.chain(), niche=(3, 4), l=5, lineages=100)
    found = scores[:, data["sizes"].index(100), 4, archive.niches.flat((3, 4))]
    assert found == pytest.approx([expected.value, expected.low, expected.high], abs=1e-3)


def test_stages_are_births_so_far(archive, page):
    data = embedded(page)
    births, n = archive.births(), len(archive.niches)
    assert len(data["stages"]) == 20
    assert data["stages"][-1] == len(births)
    visits = numbers(data["visitsAt"], np.uint32).reshape(20, n)
    children = numbers(data["childrenAt"], np.uint32).reshape(20, n)
    early = births.head(data["stages"][6])
    assert visits[6].tolist() == [int((early["child_niche"] == niche).sum()) for niche in range(n)]
    assert children[6].tolist() == [int((early["parent_niche"] == niche).sum()) for niche in range(n)]
    assert (visits[-1] == archive.counts.visits[:n]).all()
    first = numbers(data["firstBirth"], np.uint32)
    niche = int(births["child_niche"].iloc[300])
    assert first[niche] == int(np.flatnonzero(births["child_niche"] == niche)[0]) + 1
    assert ((first > 0) == (archive.counts.visits[:n] > 0)).all()


def test_lineage_of_an_elite_is_its_ancestry(archive, page):
    data = embedded(page)
    parent, niche = numbers(data["ancestorParent"], np.int32), numbers(data["ancestorNiche"], np.uint16)
    place = numbers(data["eliteBirth"], np.int32)
    births = archive.births().set_index("uid")
    deepest = int(archive.elites.niche[np.argmax(archive.elites.depth)])
    found, here = [], place[deepest]
    while here >= 0:
        found.append(int(niche[here]))
        here = parent[here]
    uid, expected = archive.elite(deepest).uid, []
    while uid is not None:
        row = births.loc[uid]
        expected.append(int(row["child_niche"]))
        uid = None if row["parent_uid"] is pd.NA else int(row["parent_uid"])
    assert found == expected
    assert len(found) == archive.elite(deepest).depth + 1


def test_of_many_entries_the_strongest_are_kept(archive, monkeypatch):
    monkeypatch.setattr(kept, "_MOST_ENTRIES", 220)
    chain = archive.chain()
    some, each = rounded_transition(chain)
    whole = chain.operator
    assert each == 220 // chain.states
    assert np.diff(some.kept.indptr).max() == each
    np.testing.assert_allclose(some.kept.sum(axis=1), whole.kept.sum(axis=1), rtol=1e-6)
    row = int(np.argmax(np.diff(whole.kept.indptr)))
    strongest = np.sort(whole.kept[[row]].data)[-each:]
    np.testing.assert_allclose(
        np.sort(some.kept[[row]].data), strongest * whole.kept[[row]].sum() / strongest.sum(), rtol=1e-5
    )


def test_voronoi_cells_cover_the_box(tmp_path):
    config = nc.BuildConfig(
        "arm", (30,), ((-1, 1), (-1, 1)), niches="cvt", evaluations=400, scale=0.3, outside="clip"
    )
    with nc.Threads(1) as threads:
        nc.build(config, tmp_path / "voronoi", threads)
    archive = nc.load(tmp_path / "voronoi")
    assert isinstance(archive.niches, CVTNiches)
    chain = archive.chain()
    data = embedded(explorer_page(archive, chain, draws=2))
    assert data["shape"] is None
    start = numbers(data["cornerStart"], np.uint32)
    corners = numbers(data["corners"], np.float32).reshape(-1, 2)
    areas = []
    for k in range(30):
        x, y = corners[start[k] : start[k + 1]].T.astype(float)
        areas.append(abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2)
    assert sum(areas) == pytest.approx(4.0, rel=1e-5)
    np.testing.assert_allclose(rounded_transition(chain)[0].toarray(), dense(chain), atol=1e-7)


def test_films_are_of_niches(archive, tmp_path):
    label = archive.niches.label(int(archive.elites.niche[0]))
    (tmp_path / f"{label}.gif").write_bytes(b"GIF89a")
    (tmp_path / "notes.txt").write_text("left alone")
    data = embedded(explorer_page(archive, archive.chain("mle"), films=tmp_path))
    assert data["films"] == {str(archive.elites.niche[0]): "data:image/gif;base64,R0lGODlh"}
    (tmp_path / "99,99.png").write_bytes(b"")
    with pytest.raises(NichechainError, match="is named after no niche"):
        explorer_page(archive, archive.chain("mle"), films=tmp_path)
    (tmp_path / "99,99.png").unlink()
    (tmp_path / f"{label}.gif").write_bytes(bytes(2_000_001))
    with pytest.raises(NichechainError, match="over 2 MB"):
        explorer_page(archive, archive.chain("mle"), films=tmp_path)
    with pytest.raises(NichechainError, match="must be a folder"):
        explorer_page(archive, archive.chain("mle"), films=tmp_path / "none")


def test_a_given_matrix_has_no_intervals_and_no_wormholes(archive):
    data = embedded(explorer_page(archive, archive.chain("mle")))
    assert data["draws"] == 0
    assert data["wormholes"] is None


def test_words_of_an_archive_cannot_become_a_program(archive):
    hostile = "</script><script>document.title = 'taken'</script><!--"
    odd = nc.load(archive.folder)
    odd.meta = dataclasses.replace(
        odd.meta, facts=dataclasses.replace(odd.meta.facts, objective_name=hostile, unit="/*PROGRAM*/")
    )
    page = explorer_page(odd, odd.chain("mle"))
    assert page.count("<script") == 2
    assert hostile not in page
    assert embedded(page)["objectiveName"] == hostile
    assert embedded(page)["unit"] == "/*PROGRAM*/"


def test_page_appears_whole_or_not_at_all(archive, tmp_path, monkeypatch):
    out = tmp_path / "explore.html"
    out.write_text("before")

    def fails(*_):
        raise OSError("disk is full")

    chain = archive.chain("mle")
    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", fails)
        with pytest.raises(NichechainError, match="disk is full"):
            write_explorer(archive, chain, out)
    assert out.read_text() == "before"
    assert [path.name for path in tmp_path.iterdir()] == ["explore.html"]
    write_explorer(archive, chain, out)
    assert out.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert [path.name for path in tmp_path.iterdir()] == ["explore.html"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"l": 0}, "l is 0"),
        ({"l": 11}, "l is 11, but the page goes up to 10"),
        ({"lineages": 0}, "lineages is 0"),
        ({"lineages": 10_001}, "lineages is 10001, but the page goes up to 10000"),
        ({"draws": 0}, "draws is 0"),
    ],
)
def test_bad_options(archive, options, said):
    with pytest.raises(NichechainError, match=said):
        explorer_page(archive, archive.chain("mle"), **options)


def test_chain_of_other_niches(archive):
    with pytest.raises(NichechainError, match="not over the niches"):
        explorer_page(archive, nc.NicheChain(np.eye(3)))
