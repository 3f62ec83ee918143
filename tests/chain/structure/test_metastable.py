import numpy as np
import pytest

import nichechain as nc
from nichechain.chain.structure.metastable import metastable_sets
from nichechain.core.errors import NichechainError

pytest.importorskip("pygpcca")
# Two pairs of niches; one lineage in a hundred leaves its pair.
PAIRS = nc.NicheChain(
    [[0.80, 0.19, 0.01, 0.00], [0.20, 0.79, 0.00, 0.01], [0.01, 0.00, 0.70, 0.29], [0.00, 0.01, 0.30, 0.69]]
)


def test_two_pairs() -> None:
    found = metastable_sets(PAIRS, 2)
    assert found.group[0] == found.group[1] != found.group[2] == found.group[3]
    np.testing.assert_allclose(found.membership.sum(axis=1), 1.0)
    # Both pairs lose exactly one in a hundred, whichever of their niches a lineage is in.
    order = [found.group[0], found.group[2]]
    np.testing.assert_allclose(
        found.transition[np.ix_(order, order)], [[0.99, 0.01], [0.01, 0.99]], atol=1e-9
    )
    assert found.crispness == pytest.approx(1.0)


def test_a_given_chain_is_left_alone() -> None:
    before = np.array(PAIRS.T)
    metastable_sets(PAIRS, 3)
    np.testing.assert_array_equal(PAIRS.T, before)


@pytest.mark.parametrize("groups", [0, 1, 4, -2, 1.5, "two"])
def test_number_of_groups(groups: object) -> None:
    with pytest.raises(NichechainError, match="groups is"):
        metastable_sets(PAIRS, groups)  # type: ignore[arg-type]


def test_a_pair_of_complex_eigenvalues_is_not_split() -> None:
    # A cycle: its eigenvalues are the cube roots of 1, and a fourth niche feeds it.
    cycle = nc.NicheChain([[0, 1.0, 0, 0], [0, 0, 1.0, 0], [1.0, 0, 0, 0], [0.5, 0, 0, 0.5]])
    with pytest.raises(NichechainError, match="does not divide this chain"):
        metastable_sets(cycle, 2)
