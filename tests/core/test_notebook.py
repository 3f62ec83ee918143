import nichechain as nc
from nichechain.core.notebook import facts_table


def test_texts_are_escaped():
    shown = facts_table("<b>", {"a<script>": "x & y", "number": 1.23456})
    assert "<script>" not in shown
    assert "x &amp; y" in shown
    assert "1.235" in shown


def test_what_a_notebook_shows_of_the_shipped_archive():
    archive = nc.load("fetch-pick-and-place")
    shown = archive._repr_html_()
    assert f"{archive.filled} of 400" in shown
    assert "42000, " in shown
    chain = archive.chain()
    shown = chain._repr_html_()
    # All births but the 100 initial ones have a parent; 1,800 of these are of lineages.
    assert f"<td style='text-align:left'>{42000 - 100 - 1800}</td>" in shown
    assert chain.estimator in shown


def test_what_a_notebook_shows_of_an_answer():
    chain = nc.NicheChain([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])
    assert "T is given" in nc.l_evolvability(chain, niche=0, l=2, lineages=10)._repr_html_()
    assert "2-evolvability: 2.94 niches" in nc.l_evolvability(chain, niche=0, l=2, lineages=10)._repr_html_()
    assert "of 3 niches" in nc.niche_evolvability(chain, l=2, lineages=10)._repr_html_()
    assert "none" in chain._repr_html_()


def test_counts_are_short():
    counts = nc.load("fetch-pick-and-place").counts
    for shown in (repr(counts), counts._repr_html_()):
        assert str(42000 - 100 - 1800) in shown
        assert f"{counts.rows_observed} of 400" in shown
        assert len(shown) < 1000
