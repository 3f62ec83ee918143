"""Exports: what is written is read back by the programs that it is written for."""

from __future__ import annotations

import csv

import networkx as nx
import numpy as np
import pandas as pd
import pytest

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate
from nichechain.archive.exports import (
    genealogy,
    write_dot,
    write_edges,
    write_genealogy,
    write_gexf,
    write_graphml,
    write_phylogeny,
    write_stn,
)

NICHES = GridNiches((3, 2), ((0.0, 3.0), (0.0, 1.0)))


def _graph():
    rng = np.random.default_rng(0)
    counts = TransitionCounts.from_pairs(rng.integers(7, size=90), rng.integers(7, size=90), NICHES)
    graph = estimate(counts).graph(0.02)
    assert graph.number_of_edges() > 20
    return graph


def _births():
    """Two runs, the second with a failed child and a grandchild; nulls as archives have them."""
    frame = pd.DataFrame(
        {
            "run": [0, 0, 0, 1, 1, 1, 1],
            "uid": [0, 1, 2, 0, 1, 2, 3],
            "parent_uid": [None, 0, 1, None, 0, 0, 2],
            "depth": [0, 1, 2, 0, 1, 1, 2],
            "parent_niche": [None, 0, 3, None, 3, 3, 6],
            "child_niche": [0, 3, 3, 3, None, 6, 5],
            "objective": [1.0, 0.5, 2.0, -1.0, None, 0.25, 4.0],
            "step": [0, 1, 2, 0, 1, 1, 2],
        }
    )
    whole = ["parent_uid", "parent_niche", "child_niche"]
    return frame.astype(dict.fromkeys(whole, "Int64"))


@pytest.mark.parametrize(
    ("write", "read", "name"),
    [
        (write_graphml, nx.read_graphml, "chain.graphml"),
        (write_gexf, nx.read_gexf, "chain.gexf"),
    ],
)
def test_graphs_come_back(write, read, name, tmp_path):
    graph = _graph()
    write(graph, tmp_path / name)
    back = read(tmp_path / name, node_type=int)
    assert back.is_directed()
    assert set(back) == set(graph)
    assert set(back.edges) == set(graph.edges)
    for node, attributes in graph.nodes(data=True):
        for key in ("label", "stay", "visits", "births"):
            assert back.nodes[node][key] == attributes[key]
        for axis in ("x", "y"):
            assert back.nodes[node].get(axis) == attributes.get(axis)
    for i, j, attributes in graph.edges(data=True):
        for key, value in attributes.items():
            assert back.edges[i, j][key] == value or (np.isnan(value) and np.isnan(back.edges[i, j][key]))
    # What is exported is a copy.
    assert "viz" not in graph.nodes[0]


def test_gexf_places_and_weighs(tmp_path):
    graph = _graph()
    write_gexf(graph, tmp_path / "chain.gexf")
    back = nx.read_gexf(tmp_path / "chain.gexf", node_type=int)
    assert back.nodes[5]["viz"]["position"] == {"x": 2.5, "y": 0.75, "z": 0.0}
    assert "viz" not in back.nodes[6]
    for i, j, probability in graph.edges(data="probability"):
        assert back.edges[i, j]["weight"] == probability


def test_dot_comes_back(tmp_path):
    pydot = pytest.importorskip("pydot")
    graph = _graph()
    graph.nodes[0]["label"] = 'a "quoted" \\ name; -> {'
    write_dot(graph, tmp_path / "chain.dot")
    (back,) = pydot.graph_from_dot_file(tmp_path / "chain.dot")
    edges = {(int(e.get_source()), int(e.get_destination())): e for e in back.get_edges()}
    assert set(edges) == set(graph.edges)
    for edge, probability in nx.get_edge_attributes(graph, "probability").items():
        assert float(edges[edge].get("probability").strip('"')) == probability
    nodes = {int(node.get_name()): node for node in back.get_nodes()}
    assert set(nodes) == set(graph)
    assert nodes[0].get("label") == r'"a \"quoted\" \\ name; -> {"'
    # Niche centres are 2 apart in x at most, which becomes ten inches.
    assert nodes[5].get("pos") == '"900.00,270.00"'


def test_a_chain_without_a_grid_is_written_too(tmp_path):
    graph = NicheChain([[0.5, 0.5], [1.0, 0.0]]).graph()
    write_dot(graph, tmp_path / "a.dot")
    write_graphml(graph, tmp_path / "a.graphml")
    assert set(nx.read_graphml(tmp_path / "a.graphml", node_type=int).edges) == {(0, 1), (1, 0)}
    assert "0 -> 1" in (tmp_path / "a.dot").read_text()


def test_axes_beyond_three_have_names(tmp_path):
    niches = GridNiches((1,) * 3 + (2,), ((0.0, 1.0),) * 3 + ((0.0, 4.0),), "clip")
    graph = NicheChain([[0.5, 0.5], [0.5, 0.5]], niches=niches).graph()
    write_graphml(graph, tmp_path / "a.graphml")
    node = nx.read_graphml(tmp_path / "a.graphml", node_type=int).nodes[1]
    assert [node[axis] for axis in ("x", "y", "z", "x3")] == [0.5, 0.5, 0.5, 3.0]


def test_edges_come_back(tmp_path):
    graph = _graph()
    write_edges(graph, tmp_path / "edges.csv")
    frame = pd.read_csv(tmp_path / "edges.csv")
    back = nx.from_pandas_edgelist(frame, edge_attr=True, create_using=nx.DiGraph)
    assert set(back.edges) == set(graph.edges)
    for i, j, attributes in graph.edges(data=True):
        assert back.edges[i, j]["probability"] == attributes["probability"]
        assert back.edges[i, j]["count"] == attributes["count"]


@pytest.mark.parametrize(("name", "separator"), [("run.csv", ","), ("run.txt", " ")])
def test_search_trajectory_network(name, separator, tmp_path):
    write_stn(_births(), NICHES, tmp_path / name)
    rows = list(csv.reader((tmp_path / name).open(newline=""), delimiter=separator))
    assert rows == [
        ["Run", "Fitness1", "Solution1", "Fitness2", "Solution2"],
        # The best of a niche over all births: niche 3 once had 2.
        ["1", "1.0", "0_0", "2.0", "1_1"],
        ["1", "2.0", "1_1", "2.0", "1_1"],
        ["2", "2.0", "1_1", "0.25", "outside"],
        ["2", "0.25", "outside", "4.0", "2_1"],
    ]
    frame = pd.read_csv(tmp_path / name, sep=separator)
    # A network needs one fitness a node.
    nodes = pd.concat(
        [
            frame[["Solution1", "Fitness1"]],
            frame[["Solution2", "Fitness2"]].set_axis(["Solution1", "Fitness1"], axis=1),
        ]
    )
    assert (nodes.groupby("Solution1")["Fitness1"].nunique() == 1).all()


def test_phylogeny_columns(tmp_path):
    write_phylogeny(_births(), NICHES, tmp_path / "lineage.csv")
    frame = pd.read_csv(tmp_path / "lineage.csv")
    assert frame["id"].tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert frame["ancestor_list"].tolist() == ["[none]", "[0]", "[1]", "[none]", "[3]", "[3]", "[5]"]
    assert frame["origin_time"].tolist() == [0, 1, 2, 0, 1, 1, 2]
    assert frame["info"].tolist() == ["0,0", "1,1", "1,1", "1,1", "failed", "outside", "2,1"]
    assert frame["uid"].tolist() == [0, 1, 2, 0, 1, 2, 3]
    assert np.isnan(frame["objective"][4])


def test_phylotrackpy_reads_the_phylogeny(tmp_path):
    systematics = pytest.importorskip("phylotrackpy.systematics")
    write_phylogeny(_births(), NICHES, tmp_path / "lineage.csv")
    tree = systematics.Systematics(lambda taxon: taxon)
    tree.load_from_file(str(tmp_path / "lineage.csv"), "info", True, True)
    assert tree.get_num_roots() == 2
    assert tree.get_num_taxa() == 7
    assert tree.get_max_depth() == 2
    leaves = {taxon.get_id(): taxon for taxon in tree.get_active_taxa()}
    assert sorted(leaves) == [2, 4, 6]
    assert leaves[6].get_info() == "2,1"
    assert leaves[6].get_parent().get_id() == 5
    assert leaves[6].get_origination_time() == 2


def test_genealogy_is_that_of_a_deap_history(tmp_path):
    births = _births()
    tree = genealogy(births)
    assert tree == {1: (), 2: (1,), 3: (2,), 4: (), 5: (4,), 6: (4,), 7: (6,)}
    assert set(nx.DiGraph(tree).edges) == {(2, 1), (3, 2), (5, 4), (6, 4), (7, 6)}
    write_genealogy(births, tmp_path / "pairs.csv")
    rows = list(csv.reader((tmp_path / "pairs.csv").open(newline="")))
    assert rows[0] == ["child", "parent"]
    assert {int(child): (int(parent),) if parent else () for child, parent in rows[1:]} == tree


def test_deap_walks_the_genealogy():
    tools = pytest.importorskip("deap.tools")
    history = tools.History()
    history.genealogy_tree = genealogy(_births())

    class Individual:
        history_index = 7

    assert history.getGenealogy(Individual()) == {7: (6,), 6: (4,), 4: ()}


def test_missing_columns_and_parents(tmp_path):
    births = _births()
    for write in (
        lambda frame: write_stn(frame, NICHES, tmp_path / "a"),
        lambda frame: write_phylogeny(frame, NICHES, tmp_path / "a"),
        genealogy,
    ):
        with pytest.raises(NichechainError, match="births have no column run"):
            write(births.drop(columns="run"))
    for write in (lambda frame: write_phylogeny(frame, NICHES, tmp_path / "a"), genealogy):
        with pytest.raises(NichechainError, match="birth 2 of run 0 has parent 1, but there is no such"):
            write(births.drop(index=1))
    assert list(tmp_path.iterdir()) == []


def test_no_births_at_all(tmp_path):
    none = _births().iloc[:0]
    assert genealogy(none) == {}
    write_phylogeny(none, NICHES, tmp_path / "p.csv")
    write_stn(none, NICHES, tmp_path / "s.csv")
    assert (tmp_path / "s.csv").read_text() == "Run,Fitness1,Solution1,Fitness2,Solution2\n"
    assert len((tmp_path / "p.csv").read_text().splitlines()) == 1


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "edges.csv"
    write_edges(_graph(), path)
    before = path.read_bytes()
    with pytest.raises(NichechainError, match="cannot be written: No such file or directory"):
        write_edges(_graph(), tmp_path / "nowhere" / "edges.csv")
    with pytest.raises(NichechainError, match="cannot be written"):
        write_edges(_graph(), tmp_path)

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("nichechain.core.files.os.fsync", full)
    with pytest.raises(NichechainError, match="cannot be written: No space left on device"):
        write_edges(nx.DiGraph(), path)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["edges.csv"]
