"""The planar arm against the closed form in complex numbers."""

from __future__ import annotations

import cmath
import math
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nichechain.core.errors import NichechainError
from nichechain.domains import Domain, PlanarArm
from nichechain.execution import Threads

angle = st.floats(-20, 20, width=32)


@given(st.lists(angle, min_size=1, max_size=30))
def test_hand_is_the_mean_of_unit_vectors(angles: list[float]) -> None:
    """A link's direction is the product of the rotations before it: no sums of angles."""
    evaluation = PlanarArm(len(angles)).evaluate(np.array([angles], np.float32))
    direction, tip = 1 + 0j, 0j
    for turn in angles:
        direction *= cmath.rect(1, turn)
        tip += direction / len(angles)
    np.testing.assert_allclose(evaluation.behavior[0], [tip.real, tip.imag], atol=1e-12)
    np.testing.assert_allclose(evaluation.objective[0], -statistics.pvariance(angles), atol=1e-11)
    assert abs(tip) <= 1 + 1e-12


def test_postures_known_by_geometry() -> None:
    arm = PlanarArm(4)
    quarter = math.pi / 2
    evaluation = arm.evaluate(
        np.array([[0, 0, 0, 0], [quarter, 0, 0, 0], [0, quarter, quarter, quarter], [math.pi, 0, 0, 0]])
    )
    # Stretched along x, along y, a closed square, stretched backwards.
    np.testing.assert_allclose(evaluation.behavior, [[1, 0], [0, 1], [0, 0], [-1, 0]], atol=1e-6)
    np.testing.assert_array_equal(evaluation.behavior[0], arm.start)
    assert evaluation.objective[0] == 0


def test_is_a_domain() -> None:
    assert isinstance(PlanarArm(), Domain)
    assert PlanarArm(seed=3).seed == 3
    assert repr(PlanarArm(7)) == "PlanarArm(joints=7, seed=0)"


@pytest.mark.parametrize("joints", [1, 3, 10, 33])
def test_bits_do_not_depend_on_the_batch(joints: int) -> None:
    """Long batches use vector units, single rows do not: the bits must agree."""
    arm = PlanarArm(joints)
    angles = np.random.default_rng(0).normal(0, 3, (1001, joints)).astype(np.float32)
    whole = arm.evaluate(angles)
    for size in (1, 7):
        parts = [arm.evaluate(angles[i : i + size]) for i in range(0, 1001, size)]
        np.testing.assert_array_equal(np.concatenate([p.behavior for p in parts]), whole.behavior)
        np.testing.assert_array_equal(np.concatenate([p.objective for p in parts]), whole.objective)


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_bits_do_not_depend_on_the_threads(workers: int) -> None:
    arm = PlanarArm()
    angles = np.random.default_rng(1).normal(0, 3, (3 * arm.chunk + 5, 10)).astype(np.float32)
    with Threads(workers) as executor:
        evaluation = executor.evaluate(arm, angles)
    np.testing.assert_array_equal(evaluation.behavior, arm.evaluate(angles).behavior)


def test_sample_is_a_nearly_stretched_arm() -> None:
    arm = PlanarArm()
    sample = arm.sample(500, seed=2)
    assert sample.dtype == np.float32
    assert sample.shape == (500, 10)
    assert np.abs(sample).max() <= 0.1
    # The standard deviation of a uniform variable on [-0.1, 0.1] is 0.1/sqrt(3).
    np.testing.assert_allclose(sample.std(), 0.1 / math.sqrt(3), rtol=0.03)
    np.testing.assert_array_equal(arm.sample(20, seed=2), sample[:20])


def test_angles_that_are_not_finite_fail_alone() -> None:
    angles = np.zeros((4, 10), np.float32)
    angles[1, 3], angles[2, 9] = np.nan, np.inf
    evaluation = PlanarArm().evaluate(angles)
    assert evaluation.failed.tolist() == [False, True, True, False]
    assert evaluation.reasons == ("", "genotype is not finite", "genotype is not finite", "")
    assert np.isnan(evaluation.behavior[1:3]).all()
    assert np.isnan(evaluation.objective[1:3]).all()
    np.testing.assert_array_equal(evaluation.behavior[[0, 3]], [[1, 0], [1, 0]])


@pytest.mark.parametrize("shape", [(10,), (2, 9), (2, 11), (1, 2, 10)])
def test_shapes_that_do_not_fit(shape: tuple[int, ...]) -> None:
    with pytest.raises(NichechainError, match=r"but must be \(N, 10\)"):
        PlanarArm().evaluate(np.zeros(shape))


def test_has_no_controller() -> None:
    with pytest.raises((TypeError, NichechainError), match="not a controller"):
        PlanarArm().controller(np.zeros(10))
