"""The reachability graph of chains made by hand."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate
from nichechain.chain.structure import transitions
from nichechain.chain.structure.graph import betweenness, reachability_graph

# Niches 0 1 2 3 in a row, centres at x = 1, 3, 5, 7, all at y = 0.5; the outside is state 4.
ROW = GridNiches((4, 1), ((0.0, 8.0), (0.0, 1.0)))


def _by_hand(form=np.array):
    transition = form(
        [
            [0.70, 0.20, 0.00, 0.06, 0.04],
            [0.00, 0.25, 0.50, 0.00, 0.25],
            [0.00, 0.00, 1.00, 0.00, 0.00],
            [0.05, 0.00, 0.00, 0.95, 0.00],
            [0.90, 0.00, 0.00, 0.00, 0.10],
        ]
    )
    return NicheChain(transition, niches=ROW, outside=4)


@pytest.mark.parametrize("form", [np.array, sparse.csr_array])
def test_edges_of_a_given_chain(form):
    graph = reachability_graph(_by_hand(form))
    # 0.05 is at the threshold and stays; 0.04 goes.
    assert {(i, j): attributes["probability"] for i, j, attributes in graph.edges(data=True)} == {
        (0, 1): 0.20,
        (0, 3): 0.06,
        (1, 2): 0.50,
        (1, 4): 0.25,
        (3, 0): 0.05,
        (4, 0): 0.90,
    }
    assert {count for _, _, count in graph.edges(data="count")} == {0}


def test_lengths_of_edges():
    edges = reachability_graph(_by_hand()).edges
    # A jump is long from a quarter of the diagonal on: √65 / 4 = 2.02.
    assert edges[0, 1]["distance"] == pytest.approx(2.0)
    assert edges[0, 1]["long_jump"] is False
    assert edges[0, 3]["distance"] == pytest.approx(6.0)
    assert edges[0, 3]["long_jump"] is True
    # The outside is nowhere, so nothing is far from it.
    assert math.isnan(edges[1, 4]["distance"])
    assert edges[4, 0]["long_jump"] is False
    # Edges are alike, whatever they join.
    assert {tuple(sorted(edge)) for edge in edges.values()} == {
        ("count", "distance", "long_jump", "probability")
    }


@pytest.mark.parametrize(("cells", "far"), [(4, True), (5, False)])
def test_a_jump_of_just_a_quarter_of_the_diagonal_is_long(cells, far):
    # On a line the diagonal is its length: neighbours are a quarter of it apart, or a fifth.
    chain = NicheChain(np.roll(np.eye(cells), 1, axis=1), niches=GridNiches((cells,), ((0.0, 8.0),)))
    assert reachability_graph(chain).edges[0, 1]["long_jump"] is far


def test_nodes_of_a_given_chain():
    graph = reachability_graph(_by_hand())
    assert sorted(graph) == [0, 1, 2, 3, 4]
    assert graph.nodes[0] == {"label": "0,0", "stay": 0.7, "visits": 0, "births": 0, "x": 1.0, "y": 0.5}
    assert (graph.nodes[3]["x"], graph.nodes[3]["y"]) == pytest.approx((7.0, 0.5))
    assert graph.nodes[4] == {"label": "outside", "stay": 0.1, "visits": 0, "births": 0}
    assert [graph.nodes[i]["stay"] for i in range(5)] == [0.7, 0.25, 1.0, 0.95, 0.1]


@pytest.mark.parametrize(
    ("threshold", "edges"), [(0.0, 7), (0.05, 6), (0.2, 4), (0.5, 2), (0.91, 0), (1.0, 0)]
)
def test_thresholds(threshold, edges):
    graph = reachability_graph(_by_hand(), threshold)
    assert graph.number_of_edges() == edges
    assert sorted(graph) == [0, 1, 2, 3, 4]
    assert _by_hand().graph(threshold).edges == graph.edges


@pytest.mark.parametrize("threshold", [-0.01, 1.01, math.nan])
def test_a_threshold_that_is_no_probability(threshold):
    with pytest.raises(NichechainError, match="threshold is"):
        reachability_graph(_by_hand(), threshold)


def test_a_chain_without_a_grid_has_no_positions():
    graph = reachability_graph(NicheChain([[0.5, 0.5], [1.0, 0.0]]))
    assert graph.nodes[0] == {"label": "0", "stay": 0.5, "visits": 0, "births": 0}
    edge = graph.edges[1, 0]
    assert (edge["probability"], edge["count"], edge["long_jump"]) == (1.0, 0, False)
    assert math.isnan(edge["distance"])


def test_births_behind_an_estimated_chain():
    # Niche 0: three births at home, one in 1. Niche 1: filled, never a parent. Niches 2, 3: empty.
    counts = TransitionCounts.from_births([-1, 0, 0, 0, 0, 4], [0, 0, 0, 0, 1, 0], ROW)
    for chain in (estimate(counts, "mle", unvisited="uniform"), estimate(counts, strength=0.5)):
        graph = reachability_graph(chain)
        # Rows without births have no edges, niches nobody was born in no nodes, unless edges lead there.
        assert {i for i, _ in graph.edges} <= {0, 4}
        assert graph.edges[0, 1]["count"] == 1
        assert graph.edges[4, 0]["count"] == 1
        assert (graph.nodes[0]["visits"], graph.nodes[0]["births"]) == (5, 4)
        assert (graph.nodes[1]["visits"], graph.nodes[1]["births"]) == (1, 0)
        assert (graph.nodes[4]["visits"], graph.nodes[4]["births"]) == (0, 1)
        transition = chain.T if isinstance(chain.T, np.ndarray) else chain.T.toarray()
        for i, j, probability in graph.edges(data="probability"):
            assert probability == pytest.approx(transition[i, j], rel=1e-12)
            assert probability >= 0.05
    mle = reachability_graph(estimate(counts, "mle"))
    assert mle.edges[0, 1]["probability"] == 0.25
    assert mle.nodes[0]["stay"] == 0.75
    assert sorted(mle) == [0, 1, 4]


def test_attributes_are_plain_values_that_can_be_written(tmp_path):
    import networkx as nx

    graph = reachability_graph(_by_hand())
    for _, attributes in graph.nodes(data=True):
        assert {type(value) for value in attributes.values()} <= {str, float, int}
    for _, _, attributes in graph.edges(data=True):
        assert {type(value) for value in attributes.values()} <= {float, int, bool}
    for write, read in ((nx.write_graphml, nx.read_graphml), (nx.write_gexf, nx.read_gexf)):
        write(graph, tmp_path / "chain")
        assert set(read(tmp_path / "chain", node_type=int).edges) == set(graph.edges)


def _most_probable_paths(transition, i, j):
    """All simple paths from i to j of the largest probability, by enumeration."""
    best, found = 0.0, []
    others = [k for k in range(len(transition)) if k not in (i, j)]
    for size in range(len(others) + 1):
        for middle in itertools.permutations(others, size):
            path = (i, *middle, j)
            probability = np.prod([transition[a, b] for a, b in itertools.pairwise(path)])
            if probability > best * (1 + 1e-12):
                best, found = probability, [path]
            elif probability > 0 and probability > best * (1 - 1e-12):
                found.append(path)
    return found


def test_betweenness_equals_enumeration_of_paths():
    rng = np.random.default_rng(4)
    n = 5
    transition = rng.dirichlet(np.full(n, 0.5), n)
    expected = np.zeros(n)
    for i, j in itertools.permutations(range(n), 2):
        paths = _most_probable_paths(transition, i, j)
        for path in paths:
            expected[list(path[1:-1])] += 1.0 / len(paths)
    found = betweenness(NicheChain(transition), threshold=0.0)
    np.testing.assert_allclose(found, expected / ((n - 1) * (n - 2)))


def test_betweenness_of_certain_steps_and_of_lonely_states():
    # A one-way street 0 → 1 → 2 → 3 of certain steps: 1 and 2 lie on two of six ordered pairs of others.
    street = NicheChain(np.eye(4, k=1) + np.diag([0, 0, 0, 1.0]))
    np.testing.assert_allclose(betweenness(street), [0.0, 2 / 6, 2 / 6, 0.0])
    assert betweenness(NicheChain(np.eye(3))).tolist() == [0.0, 0.0, 0.0]
    assert betweenness(NicheChain([[1.0]])).tolist() == [0.0]
    with pytest.raises(NichechainError, match="threshold"):
        betweenness(street, threshold=2.0)


def test_betweenness_counts_states_that_the_graph_leaves_out():
    niches = GridNiches((5,), ((0.0, 1.0),))
    counts = TransitionCounts.from_births([-1, 0, 1], [0, 1, 2], niches)
    found = betweenness(estimate(counts, "mle"))
    # Only the path 0 → 1 → 2 exists, among 5 · 4 ordered pairs of the other five states.
    assert found.shape == (6,)
    np.testing.assert_allclose(found, [0, 1 / 20, 0, 0, 0, 0])


def test_transitions_above_a_threshold_where_t_is_kept_in_parts(monkeypatch):
    niches = GridNiches((12, 12), ((0.0, 1.0), (0.0, 1.0)))
    rng = np.random.default_rng(0)
    place = rng.random((2000, 2))
    child = niches.of(place + 0.1 * rng.standard_cauchy((2000, 2)))
    chain = estimate(TransitionCounts.from_pairs(niches.of(place), child, niches))
    whole = [transitions.entries_above(chain, t).toarray() for t in (0.003, 0.02, 0.2)]
    stay = transitions.staying(chain)
    monkeypatch.setattr(transitions, "_WHOLE", 10)
    for threshold, expected in zip((0.003, 0.02, 0.2), whole, strict=True):
        np.testing.assert_allclose(
            transitions.entries_above(chain, threshold).toarray(), expected, rtol=1e-12
        )
    np.testing.assert_allclose(transitions.staying(chain), stay, rtol=1e-12)
