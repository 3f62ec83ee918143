"""Genotypes grown from their roots, against growing them all."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from nichechain import variation
from nichechain.births.table import NONE
from nichechain.core.randomness import Purpose, keyed
from nichechain.verification.replay import ancestry, replayed


@st.composite
def family_trees(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Parents of some births, and which of them are asked for."""
    initial = draw(st.integers(1, 5))
    children = draw(st.lists(st.integers(0, 10**6), max_size=40))
    parents = [NONE] * initial + [choice % (initial + k) for k, choice in enumerate(children)]
    asked = draw(st.lists(st.integers(0, len(parents) - 1), max_size=10))
    return np.array(parents, np.int64), np.array(sorted(asked), np.int64)


@settings(deadline=None, max_examples=60)
@given(family_trees())
def test_any_births_are_those_of_growing_the_whole_tree(tree: tuple[np.ndarray, np.ndarray]) -> None:
    parents, asked = tree
    mutate = variation.cauchy(0.5)
    roots = keyed(3, Purpose.INITIAL).random((5, 4)).astype(np.float32)
    whole: list[np.ndarray] = []
    for uid, parent in enumerate(parents.tolist()):
        grown = roots[uid] if parent == NONE else mutate(whole[parent], keyed(3, Purpose.MUTATION, uid))
        whole.append(grown)
    made: list[int] = []
    found = dict(replayed(asked, parents, roots=lambda: roots, mutate=mutate, seed=3, on_done=made.append))
    assert sorted(found) == sorted(set(asked.tolist()))
    for uid, genotype in found.items():
        assert genotype.tobytes() == whole[uid].tobytes()
    # Nothing is made that is not needed, and nothing twice.
    lineages = set()
    for uid in asked.tolist():
        while uid != NONE:
            lineages.add(uid)
            uid = int(parents[uid])
    assert sum(made) == len(lineages)
    assert set(np.flatnonzero(ancestry(asked, parents)).tolist()) == lineages


def test_nothing_asked_for_is_nothing_made() -> None:
    none = np.empty(0, np.int64)
    parents = np.array([NONE, 0, 1])
    assert not list(
        replayed(none, parents, roots=lambda: np.zeros((1, 2), np.float32), mutate=variation.cauchy(), seed=0)
    )
