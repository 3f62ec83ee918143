"""Chains and births in the formats of other programs.

Files are replaced whole: whoever reads one meanwhile sees the old file or the new one.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nichechain.births.joins import across_runs, parent_rows
from nichechain.births.table import NONE, check_columns
from nichechain.core.files import as_path, replace_file
from nichechain.niches import Niches

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd

# Points, of which 72 are an inch.
_DOT_SPAN = 720.0


def write_graphml(graph: nx.DiGraph, path: str | Path) -> None:
    """Write a graph of niches as GraphML, for Gephi, Cytoscape, igraph, yEd or networkx.

    Parameters
    ----------
    graph : networkx.DiGraph
        Such as :meth:`nichechain.NicheChain.graph`. A position becomes attributes ``x``, ``y``,
        ``z`` (``x3``, ``x4``, … for further axes).
    path : str or Path

    Raises
    ------
    NichechainError
        If the file cannot be written.
    """
    import networkx as nx

    buffer = io.BytesIO()
    nx.write_graphml(graph, buffer, named_key_ids=True)
    replace_file(path, buffer.getvalue())


def write_gexf(graph: nx.DiGraph, path: str | Path) -> None:
    """Write a graph of niches as GEXF, Gephi's own format, where positions place the nodes.

    Parameters and errors are those of :func:`write_graphml`.
    """
    import networkx as nx

    flat = graph.copy()
    for _, node in flat.nodes(data=True):
        if "x" in node:
            node["viz"] = {"position": {"x": node["x"], "y": node.get("y", 0.0), "z": node.get("z", 0.0)}}
    for _, _, edge in flat.edges(data=True):
        edge["weight"] = edge["probability"]
    buffer = io.BytesIO()
    nx.write_gexf(flat, buffer)
    replace_file(path, buffer.getvalue())


def write_dot(graph: nx.DiGraph, path: str | Path) -> None:
    """Write a graph of niches in Graphviz's language DOT.

    Positions are scaled to ten inches, for ``neato -n`` to draw the niches where they are. Other
    parameters and errors are those of :func:`write_graphml`.
    """
    flat = graph.copy()
    places = [(node["x"], node.get("y", 0.0)) for _, node in flat.nodes(data=True) if "x" in node]
    span = float(np.ptp(places, axis=0).max()) if places else 0.0
    for _, node in flat.nodes(data=True):
        if "x" in node:
            at = _DOT_SPAN / (span or 1.0) * np.array([node["x"], node.get("y", 0.0)])
            node["pos"] = f"{at[0]:.2f},{at[1]:.2f}"
    lines = ["digraph niches {"]
    lines += [f"  {node} {_dot_attributes(attributes)};" for node, attributes in flat.nodes(data=True)]
    lines += [f"  {i} -> {j} {_dot_attributes(edge)};" for i, j, edge in flat.edges(data=True)]
    replace_file(path, "\n".join([*lines, "}", ""]).encode())


def write_edges(graph: nx.DiGraph, path: str | Path) -> None:
    """Write the edges of a graph of niches as CSV: source, target, and all that is known of each.

    Parameters and errors are those of :func:`write_graphml`.
    """
    edges = [{"source": i, "target": j, **edge} for i, j, edge in graph.edges(data=True)]
    names = ["source", "target", "probability", "count", "distance", "long_jump"]
    replace_file(path, _csv(names, ([_cell(edge[name]) for name in names] for edge in edges)))


def write_stn(births: pd.DataFrame, niches: Niches, path: str | Path) -> None:
    """Write births as the input of Search Trajectory Networks: one line per step of the search.

    Parameters
    ----------
    births : pandas.DataFrame
        The columns of :mod:`nichechain.births.table`, such as ``archive.births()``.
    niches : Niches
        What the locations of the network are; they are called by their grid index, as in
        ``7_11``.
    path : str or Path
        A name that ends in ``.csv`` gets commas, as in the data that come with the tools; any
        other gets spaces, which is what their script ``create.R`` reads.

    Raises
    ------
    NichechainError
        If a column is missing or the file cannot be written.

    Notes
    -----
    Columns Run, Fitness1, Solution1, Fitness2, Solution2; Ochoa, Malan and Blum (2021), "Search
    trajectory networks". Runs count from 1. A step leads from a parent's niche to its child's, so
    that a run is a tree, not one trajectory. A location has one fitness, as the tools demand: the
    largest objective that was ever born there; tell them to maximise. Births without a parent, or
    without a niche because they failed, are no steps.
    """
    check_columns(births, "run", "parent_niche", "child_niche", "objective")
    best = births.dropna(subset=["child_niche"]).groupby("child_niche")["objective"].max()
    fitness = {int(niche): float(value) for niche, value in best.items()}
    moved = births.dropna(subset=["parent_niche", "child_niche"])
    rows = (
        [
            run + 1,
            fitness.get(parent, math.nan),
            niches.label(parent).replace(",", "_"),
            fitness[child],
            niches.label(child).replace(",", "_"),
        ]
        for run, parent, child in zip(
            *(moved[name].astype(int).tolist() for name in ("run", "parent_niche", "child_niche")),
            strict=True,
        )
    )
    separator = "," if as_path("path", path).suffix.lower() == ".csv" else " "
    names = ["Run", "Fitness1", "Solution1", "Fitness2", "Solution2"]
    replace_file(path, _csv(names, rows, separator))


def write_phylogeny(births: pd.DataFrame, niches: Niches, path: str | Path) -> None:
    """Write who descends from whom in the ALife data standard, for phylotrackpy and its kin.

    Parameters
    ----------
    births : pandas.DataFrame
        The columns of :mod:`nichechain.births.table`, such as ``archive.births()``.
    niches : Niches
    path : str or Path

    Raises
    ------
    NichechainError
        If a column is missing, a parent is not among the births, or the file cannot be written.

    Notes
    -----
    The phylogeny standard of Lalejini et al. (2019), "Data standards for artificial life
    software": ``id``, ``ancestor_list`` (``[none]`` for a root), ``origin_time`` (step of the
    search); beside it ``info`` (grid index of the niche, the taxon that phylotrackpy asks for;
    ``failed`` for none), ``run``, ``uid``, ``depth`` and ``objective``. Ids are uids, those of
    later runs being counted on from those of earlier ones.
    """
    import pandas as pd

    check_columns(births, "run", "uid", "parent_uid", "step", "child_niche", "depth", "objective")
    number, parents = _numbered(births)
    rows = (
        [
            own,
            "[none]" if parent is None else f"[{parent}]",
            step,
            "failed" if pd.isna(niche) else niches.label(int(niche)),
            run,
            uid,
            depth,
            "" if pd.isna(objective) else objective,
        ]
        for own, parent, step, niche, run, uid, depth, objective in zip(
            number,
            parents,
            *(births[name] for name in ("step", "child_niche", "run", "uid", "depth", "objective")),
            strict=True,
        )
    )
    names = ["id", "ancestor_list", "origin_time", "info", "run", "uid", "depth", "objective"]
    replace_file(path, _csv(names, rows))


def genealogy(births: pd.DataFrame) -> dict[int, tuple[int, ...]]:
    """Who descends from whom, as ``deap.tools.History`` keeps it.

    Parameters
    ----------
    births : pandas.DataFrame
        The columns of :mod:`nichechain.births.table`.

    Returns
    -------
    dict
        From the number of each birth to those of its parents, none or one: fit to be the
        ``genealogy_tree`` of a History, or the argument of ``networkx.DiGraph``. Numbers count
        from 1 as in DEAP: uid + 1, those of later runs counted on.

    Raises
    ------
    NichechainError
        If a column is missing or a parent is not among the births.
    """
    check_columns(births, "run", "uid", "parent_uid")
    number, parents = _numbered(births)
    return {
        own + 1: () if parent is None else (parent + 1,) for own, parent in zip(number, parents, strict=True)
    }


def write_genealogy(births: pd.DataFrame, path: str | Path) -> None:
    """Write :func:`genealogy` as CSV pairs ``child,parent``; a root has an empty parent.

    Raises
    ------
    NichechainError
        If a column is missing, a parent is not among the births, or the file cannot be written.
    """
    pairs = ([child, *(parents or ("",))] for child, parents in genealogy(births).items())
    replace_file(path, _csv(["child", "parent"], pairs))


def _dot_attributes(attributes: dict[str, Any]) -> str:
    return "[" + ", ".join(f"{name}={_dot_value(value)}" for name, value in attributes.items()) + "]"


def _dot_value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    text = str(value)
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _numbered(births: pd.DataFrame) -> tuple[list[int], list[int | None]]:
    """One number for each birth of all runs, and that of its parent."""
    run, uid, parent_uid = (
        births[name].fillna(NONE).to_numpy(np.int64) for name in ("run", "uid", "parent_uid")
    )
    # Refuses a parent that is not there.
    parent_rows(run, uid, parent_uid)
    number, parents = across_runs(run, uid, parent_uid)
    return number.tolist(), [None if parent == NONE else parent for parent in parents.tolist()]


def _cell(value: Any) -> Any:
    """A value of a table; what there is not is empty."""
    return "" if isinstance(value, float) and np.isnan(value) else value


def _csv(names: Sequence[str], rows: Iterable[Sequence[Any]], separator: str = ",") -> bytes:
    text = io.StringIO(newline="")
    writer = csv.writer(text, delimiter=separator, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return text.getvalue().encode()
