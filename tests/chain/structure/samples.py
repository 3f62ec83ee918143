"""Chains that several test modules look at."""

import numpy as np
from hypothesis import strategies as st

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
