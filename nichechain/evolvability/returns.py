"""Probabilities of being back, which tell a first visit from a later one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.core.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def return_probabilities(transition: sparse.csr_array, states: Ints, longest: Ints) -> Floats:
    """Probabilities of being back in a state after 1, 2, … steps.

    Parameters
    ----------
    transition : (S, S) row-stochastic scipy.sparse.csr_array
    states : (c,) int64 array
    longest : (c,) int64 array
        Number of steps wanted for each state, at least 1.

    Returns
    -------
    (m, c) float64 array
        (T^k)_jj in row k − 1, for the longest m; zero beyond what is wanted of a state.

    Notes
    -----
    A return after a + b steps is a way out of a steps that meets a way back of b steps, so walks
    of half the length suffice; from one state they see few others while T is sparse.
    """
    returns = np.zeros((int(longest.max(initial=0)), states.size))
    _fill(_arrays(transition), _arrays(transition.T.tocsr()), states, longest, returns)
    return returns


def all_return_probabilities(transition: Floats, steps: int) -> Floats:
    """Probabilities of being back in every state, by products of whole matrices.

    Parameters
    ----------
    transition : (S, S) row-stochastic array
    steps : int
        At least 1.

    Returns
    -------
    (steps, S) float64 array
        (T^k)_jj in row k − 1.
    """
    powers = [np.eye(len(transition)), transition]
    for _ in range(2, (steps + 1) // 2 + 1):
        powers.append(powers[-1] @ transition)
    # (T^(a+b))_jj = Σ_i (T^a)_ji (T^b)_ij: half the powers are enough.
    return np.array(
        [np.einsum("ij,ji->i", powers[(k + 1) // 2], powers[k // 2]) for k in range(1, steps + 1)]
    )


def _arrays(matrix: sparse.csr_array) -> tuple[Ints, Ints, Floats]:
    """A sparse matrix as the kernel takes it, of one type whatever its indices are."""
    return matrix.indptr.astype(np.int64), matrix.indices.astype(np.int64), matrix.data


@compiled
def _fill(out_rows: Any, back_rows: Any, states: Any, longest: Any, returns: Any) -> None:
    """Write the probabilities of :func:`return_probabilities`, state by state."""
    size = out_rows[0].size - 1
    out, back, spare = np.zeros(size), np.zeros(size), np.zeros(size)
    out_at, back_at = np.empty(size, np.int64), np.empty(size, np.int64)
    spare_at = np.empty(size, np.int64)
    for column in range(states.size):
        state = states[column]
        out[state], back[state] = 1.0, 1.0
        out_at[0], back_at[0] = state, state
        outs, backs = 1, 1
        last = longest[column]
        for step in range(1, last):
            # Ways out and back grow in turns; neither is ever more than a step longer.
            if step % 2 == 1:
                outs = _advance(out_rows, out, out_at, outs, spare, spare_at)
                out, spare = spare, out
                out_at, spare_at = spare_at, out_at
            else:
                backs = _advance(back_rows, back, back_at, backs, spare, spare_at)
                back, spare = spare, back
                back_at, spare_at = spare_at, back_at
            meeting = 0.0
            for k in range(outs):
                meeting += out[out_at[k]] * back[out_at[k]]
            returns[step - 1, column] = meeting
        # Nobody walks on from the last meeting, so one side need not move to meet the other.
        if outs <= backs:
            returns[last - 1, column] = _meet_next(out_rows, out, out_at, outs, back)
        else:
            returns[last - 1, column] = _meet_next(back_rows, back, back_at, backs, out)
        out[out_at[:outs]] = 0.0
        back[back_at[:backs]] = 0.0


@compiled
def _advance(rows: Any, here: Any, here_at: Any, count: Any, there: Any, there_at: Any) -> Any:
    """Move all probability from ``here`` one step on, to ``there``, and leave ``here`` zero."""
    pointer, column, probability = rows
    landed = 0
    for k in range(count):
        state = here_at[k]
        share = here[state]
        here[state] = 0.0
        for entry in range(pointer[state], pointer[state + 1]):
            moved = share * probability[entry]
            # What is rounded to zero must not enter the list, or it would enter it twice.
            if moved > 0.0:
                target = column[entry]
                if there[target] == 0.0:
                    there_at[landed] = target
                    landed += 1
                there[target] += moved
    return landed


@compiled
def _meet_next(rows: Any, here: Any, here_at: Any, count: Any, other: Any) -> Any:
    """Probability that one step on from ``here`` meets ``other``."""
    pointer, column, probability = rows
    meeting = 0.0
    for k in range(count):
        state = here_at[k]
        onward = 0.0
        for entry in range(pointer[state], pointer[state + 1]):
            onward += probability[entry] * other[column[entry]]
        meeting += here[state] * onward
    return meeting
