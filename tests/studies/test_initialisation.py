from pathlib import Path

import numpy as np
import pytest

from nichechain import domains
from nichechain.core.errors import NichechainError
from nichechain.studies import initialise
from nichechain.studies.initialisation import NETWORK_SCHEMES

FETCH = domains.make("fetch")
ARM = domains.make("arm")
FIRST_LAYER = 25 * 32


def test_domain_is_the_domains_own() -> None:
    np.testing.assert_array_equal(initialise(ARM, "domain", 5, seed=3), ARM.sample(5, seed=3))
    np.testing.assert_array_equal(
        initialise(ARM, "domain:3", 5, seed=3), (3 * ARM.sample(5, seed=3).astype(float)).astype(np.float32)
    )


# Standard deviation of a weight of the first layer, 25 inputs to 32 outputs, from each scheme's paper.
@pytest.mark.parametrize(
    ("scheme", "deviation"),
    [
        ("xavier-normal", np.sqrt(2 / (25 + 32))),
        ("xavier-uniform", np.sqrt(2 / (25 + 32))),
        ("kaiming-normal", np.sqrt(2 / 25)),
        ("kaiming-uniform", np.sqrt(2 / 25)),
        ("normal:0.1", 0.1),
        ("uniform:0.3", 0.3 / np.sqrt(3)),
    ],
)
def test_spread_of_the_first_layer(scheme: str, deviation: float) -> None:
    weights = initialise(FETCH, scheme, 40, seed=0)[:, :FIRST_LAYER]
    # The standard error of a standard deviation from 32,000 values is 0.4 %.
    assert weights.std() == pytest.approx(deviation, rel=0.02)
    assert abs(weights.mean()) < 4 * deviation / np.sqrt(weights.size)


def test_orthogonal_layers_are() -> None:
    weight = initialise(FETCH, "orthogonal", 1, seed=0)[0, :FIRST_LAYER].reshape(32, 25).astype(float)
    np.testing.assert_allclose(weight.T @ weight, np.eye(25), atol=1e-5)


@pytest.mark.parametrize("scheme", [*NETWORK_SCHEMES, "domain:0.3", "normal:1", "uniform:1"])
def test_first_of_many_are_the_same(scheme: str) -> None:
    np.testing.assert_array_equal(
        initialise(FETCH, scheme, 3, seed=9)[:2], initialise(FETCH, scheme, 2, seed=9)
    )


def test_elites_of_an_archive(archive_folder: Path) -> None:
    from nichechain import load

    elites = load(archive_folder).elites.genotype
    drawn = initialise(ARM, f"elites:{archive_folder}", 200, seed=0)
    rows = [np.flatnonzero((elites == row).all(axis=1)) for row in drawn]
    assert all(len(row) == 1 for row in rows)
    assert len({int(row[0]) for row in rows}) > len(elites) / 2


def test_elites_of_another_domain(archive_folder: Path) -> None:
    with pytest.raises(NichechainError, match="have 10 parameters, but fetch has 1952"):
        initialise(FETCH, f"elites:{archive_folder}", 1, seed=0)


def test_network_schemes_need_a_network() -> None:
    with pytest.raises(NichechainError, match="arm has no fully connected network"):
        initialise(ARM, "orthogonal", 1, seed=0)
