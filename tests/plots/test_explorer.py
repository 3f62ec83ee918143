import base64
import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

import nichechain as nc
from nichechain.chain.counts import TransitionCounts
from nichechain.core.errors import NichechainError
from nichechain.evolvability.returns import all_return_probabilities
from nichechain.niches import GridNiches
from nichechain.plots.explorer import explorer_page, rounded_transition, write_explorer


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
    whole = rounded_transition(chain).toarray()
    np.testing.assert_allclose(whole, dense(chain), atol=1e-7)
    powers = [np.diagonal(np.linalg.matrix_power(whole, k)) for k in range(1, 10)]
    np.testing.assert_allclose(all_return_probabilities(whole, 9), powers, atol=1e-13)


def test_page_needs_no_network(page):
    assert "default-src 'none'" in page
    assert re.findall(r"https?://[^\"' ]*", page) == ["http://www.w3.org/2000/svg"] * 2
    assert not re.search(r"\b(src|href)\s*=|@import|url\(https?", page.replace("http-equiv", ""))
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


def test_intervals_are_those_of_the_library(archive, page):
    data = embedded(page)
    assert data["sizes"] == [10, 20, 1000]
    scores = numbers(data["scores"], np.float32).reshape(3, 3, 10, len(archive.niches))
    for u, lineages in enumerate(data["sizes"]):
        for l in (1, 3, 10):
            expected = nc.niche_evolvability(archive.chain(), l=l, lineages=lineages, draws=4, seed=1)
            found = scores[:, u, l - 1]
            np.testing.assert_allclose(found, [expected.value, expected.low, expected.high], rtol=1e-5)


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
        with pytest.raises(OSError, match="disk is full"):
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
