"""Chains that several test modules look at."""

from fractions import Fraction

import numpy as np
from hypothesis import strategies as st
from scipy import sparse

# 0 ⇄ 1 lead to the pair 3 ⇄ 4 and to 2, which nobody leaves; 5 leads to 0 only.
MIXED = np.array(
    [
        [0.5, 0.3, 0.2, 0.0, 0.0, 0.0],
        [0.4, 0.2, 0.0, 0.4, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.25, 0.75, 0.0],
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ]
)


@st.composite
def transitions(draw, largest=7):
    n = draw(st.integers(1, largest))
    row = st.lists(st.integers(0, 3), min_size=n, max_size=n).filter(any)
    weights = np.array(draw(st.lists(row, min_size=n, max_size=n)), float)
    return weights / weights.sum(axis=1, keepdims=True)


def ladder(top, up):
    """Birth and death on 0 … top: up with this probability, else down, held at both ends; sparse."""
    i = np.arange(top + 1)
    where = np.tile(i, 2), np.concatenate([np.minimum(i + 1, top), np.maximum(i - 1, 0)])
    data = np.concatenate([np.full(top + 1, up), np.full(top + 1, 1 - up)])
    return sparse.csr_array((data, where), shape=(top + 1, top + 1))


@st.composite
def graded(draw, largest=6):
    """Transitions between all states, of probabilities from 1 down to 1e-30."""
    n = draw(st.integers(2, largest))
    exponents = draw(st.lists(st.floats(-30.0, 0.0), min_size=n * n, max_size=n * n))
    weights = 10.0 ** np.reshape(exponents, (n, n))
    return weights / weights.sum(axis=1, keepdims=True)


def exact_system(transition, states):
    """I − Q of some states in rational numbers, and the probability of leaving them to each other state.

    The diagonal is 1 less all else, as the floats off the diagonal say.
    """
    exact = [[Fraction(float(x)) for x in row] for row in np.asarray(transition)]
    matrix = [[-exact[i][j] for j in states] for i in states]
    for k, i in enumerate(states):
        matrix[k][k] = sum((x for j, x in enumerate(exact[i]) if j != i), Fraction(0))
    return matrix


def exact_solution(matrix, right):
    """Gauss-Jordan elimination in rational numbers."""
    size = len(matrix)
    rows = [[*row, b] for row, b in zip(matrix, right, strict=True)]
    for k in range(size):
        pivot = next(i for i in range(k, size) if rows[i][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(size):
            if i != k and rows[i][k]:
                rows[i] = [x - rows[i][k] * y for x, y in zip(rows[i], rows[k], strict=True)]
    return [row[-1] for row in rows]


def exact_stationary(transition):
    """π of a chain of one class, by rational arithmetic."""
    size = len(transition)
    matrix = exact_system(transition, range(size))
    columns = [[matrix[j][i] for j in range(size)] for i in range(size)]
    columns[-1] = [Fraction(1)] * size
    return [float(x) for x in exact_solution(columns, [Fraction(0)] * (size - 1) + [Fraction(1)])]
