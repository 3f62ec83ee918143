"""Controllers: the genotype's layout, its arithmetic, and its initialisation."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError
from nichechain.domains.engine import policy
from nichechain.domains.policies.controllers import MLP, tanh

PAPER = (25, 32, 32, 4)


def compiled(mlp: MLP, genotype: NDArray[np.float32], observations: NDArray[np.float64]) -> Any:
    """Actions of the engine's policy, row by row."""
    sizes = np.array(mlp.sizes)
    hidden = np.empty((2, sizes.max()), np.float32)
    actions = np.empty((len(observations), sizes[-1]), np.float32)
    for observation, action in zip(observations, actions, strict=True):
        policy.forward(mlp.parameters(genotype), sizes, mlp.activations, hidden, observation, action)
    return actions


def random_genotype(mlp: MLP, scale: float, seed: int) -> NDArray[np.float32]:
    """Cauchy weights; every third is 0 and some are tiny, so that signs of zero occur."""
    rng = np.random.default_rng(seed)
    weights = scale * rng.standard_cauchy(mlp.genotype_length)
    weights[::3] = 0
    weights[1::17] *= 1e-30
    return weights.astype(np.float32)


@pytest.mark.parametrize(
    ("sizes", "evolve_biases", "length"),
    [
        (PAPER, False, 1952),
        (PAPER, True, 2020),
        ((3, 2), False, 6),
        ((3, 2), True, 8),
        ((10, 32, 32, 4), False, 1472),
    ],
)
def test_genotype_length(sizes: tuple[int, ...], evolve_biases: bool, length: int) -> None:
    mlp = MLP(sizes, evolve_biases=evolve_biases)
    assert mlp.genotype_length == length
    # torch counts the biases in any case.
    module = mlp.module(np.zeros(length, np.float32))
    assert sum(p.numel() for p in module.parameters()) == length + (0 if evolve_biases else sum(sizes[1:]))


def test_one_layer_by_hand() -> None:
    mlp = MLP((2, 2), output="identity", evolve_biases=True)
    # Weights row after row, then biases: [[1, 2], [3, 4]] x + [10, 20].
    actions = mlp.actions([1, 2, 3, 4, 10, 20], [[5, 6], [0, -1]])
    np.testing.assert_array_equal(actions, [[27, 59], [8, 16]])
    assert actions.dtype == np.float32


@pytest.mark.parametrize("evolve_biases", [False, True])
@pytest.mark.parametrize(
    ("hidden", "output"), list(itertools.product(["relu", "tanh", "identity"], repeat=2))
)
def test_actions_agree_with_the_torch_module(hidden: str, output: str, evolve_biases: bool) -> None:
    mlp = MLP((25, 32, 16, 4), hidden, output, evolve_biases)
    genotype = mlp.sample(1, seed=1)[0]
    if evolve_biases:
        genotype += np.random.default_rng(2).normal(0, 0.1, genotype.size).astype(np.float32)
    observations = np.random.default_rng(3).normal(0, 1, (64, 25)).astype(np.float32)
    with torch.no_grad():
        expected = mlp.module(genotype)(torch.from_numpy(observations)).numpy()
    np.testing.assert_allclose(mlp.actions(genotype, observations), expected, rtol=1e-5, atol=1e-5)


def test_paper_controller_agrees_with_torch() -> None:
    """25-32-32-4, ReLU, tanh; the module is one that torch users know."""
    mlp = MLP()
    observations = np.random.default_rng(0).normal(0, 1, (50, 25)).astype(np.float32)
    for genotype in mlp.sample(5, seed=4):
        module = mlp.module(genotype)
        kinds = [type(layer).__name__ for layer in module]
        assert kinds == ["Linear", "ReLU", "Linear", "ReLU", "Linear", "Tanh"]
        with torch.no_grad():
            expected = module(torch.from_numpy(observations)).numpy()
        np.testing.assert_allclose(mlp.actions(genotype, observations), expected, rtol=0, atol=1e-5)


def test_module_owns_its_weights() -> None:
    """Training the module must not change the genotype."""
    mlp = MLP((3, 2), evolve_biases=True)
    genotype = np.arange(8, dtype=np.float32)
    module = mlp.module(genotype)
    flat = torch.nn.utils.parameters_to_vector(module.parameters())
    np.testing.assert_array_equal(flat.detach().numpy(), genotype)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.add_(1)
    np.testing.assert_array_equal(genotype, np.arange(8))


@pytest.mark.parametrize("scale", [0.1, 1.0, 1e4, 1e8])
@pytest.mark.parametrize("hidden", ["relu", "tanh", "identity"])
@pytest.mark.parametrize("evolve_biases", [False, True])
def test_compiled_policy_has_the_same_bits(scale: float, hidden: str, evolve_biases: bool) -> None:
    for sizes, output in ((PAPER, "tanh"), ((7, 5), "identity"), ((1, 3, 9, 2), "relu")):
        mlp = MLP(sizes, hidden, output, evolve_biases)
        genotype = random_genotype(mlp, scale, seed=sizes[0])
        observations = np.random.default_rng(5).normal(0, 2, (40, sizes[0]))
        observations[0] = 0
        observations[1] = -0.0
        observations[2] *= 1e6
        actions = mlp.actions(genotype, observations)
        assert np.isfinite(actions).all()
        np.testing.assert_array_equal(
            compiled(mlp, genotype, observations).view(np.int32), actions.view(np.int32)
        )


def test_compiled_policy_overflows_alike() -> None:
    """Weights that overflow a float32 sum give infinities and NaN in the same places."""
    mlp = MLP()
    overflown = 0
    for seed in range(10):
        genotype = random_genotype(mlp, 1e25, seed)
        observations = np.random.default_rng(seed).normal(0, 10, (20, 25))
        with np.errstate(all="ignore"):
            actions = mlp.actions(genotype, observations)
        np.testing.assert_array_equal(compiled(mlp, genotype, observations), actions)
        overflown += np.isnan(actions).sum()
    assert overflown


def test_a_rows_bits_do_not_depend_on_the_batch() -> None:
    mlp = MLP()
    genotype = random_genotype(mlp, 1.0, seed=1)
    observations = np.random.default_rng(1).normal(0, 1, (33, 25))
    whole = mlp.actions(genotype, observations)
    for size in (1, 2, 16):
        parts = [mlp.actions(genotype, observations[i : i + size]) for i in range(0, 33, size)]
        np.testing.assert_array_equal(np.concatenate(parts).view(np.int32), whole.view(np.int32))


def test_sums_run_over_the_inputs_in_order() -> None:
    """Float32 rounds these to 0 from the left, to 1 from the right."""
    mlp = MLP((3, 1), output="identity")
    assert mlp.actions([1e8, -1e8, 1], [[1, 1, 1]])[0, 0] == 1
    assert mlp.actions([1, 1e8, -1e8], [[1, 1, 1]])[0, 0] == 0


def ulps(first: NDArray[np.float32], second: NDArray[np.float32]) -> NDArray[np.int64]:
    """How many float32 lie between two arrays of equal signs."""
    return np.abs(first.view(np.int32).astype(np.int64) - second.view(np.int32).astype(np.int64))


def float32_grid() -> NDArray[np.float32]:
    """Positive float32 from 1e-7 to 30, every 997th, and all that surround the two thresholds."""
    low, high = np.array([1e-7, 30], np.float32).view(np.int32)
    bits = [np.arange(low, high, 997)]
    thresholds = np.array([1e-4, 9.0, 9.5], np.float32).view(np.int32)
    bits += [np.arange(threshold - 500, threshold + 500) for threshold in thresholds]
    return np.concatenate(bits).astype(np.int32).view(np.float32)


def test_tanh_is_off_by_at_most_one_unit() -> None:
    values = float32_grid()
    exact = np.array([math.tanh(x) for x in values.tolist()]).astype(np.float32)
    errors = ulps(tanh(values), exact)
    assert errors.max() <= 1
    # A function with its own rounding of the last bit would be off far more often.
    assert errors.mean() < 1e-3


def test_tanh_is_odd_and_bounded() -> None:
    values = float32_grid()
    np.testing.assert_array_equal(tanh(-values).view(np.int32), (-tanh(values)).view(np.int32))
    assert np.abs(tanh(values)).max() == 1
    # Monotonic to within the unit that it may be off.
    ordered = tanh(np.sort(values))
    assert (np.diff(ordered) >= -np.spacing(ordered[1:])).all()


@pytest.mark.parametrize(
    ("value", "result"),
    [
        (0.0, 0.0),
        (-0.0, -0.0),
        (np.inf, 1.0),
        (-np.inf, -1.0),
        (np.nan, np.nan),
        (1e-45, 1e-45),
        (-1e-40, -1e-40),
        (3e38, 1.0),
        (9.5, 1.0),
        (-20.0, -1.0),
    ],
)
def test_tanh_of_special_values(value: float, result: float) -> None:
    expected = np.array([result], np.float32)
    both = (tanh(np.array([value], np.float32)), np.array([policy._tanh(np.float32(value))], np.float32))
    for found in both:
        assert found.dtype == np.float32
        np.testing.assert_array_equal(found, expected)
        assert np.isnan(result) or np.signbit(found) == np.signbit(expected)


def test_compiled_tanh_has_the_same_bits() -> None:
    values = np.concatenate([float32_grid()[::7], -float32_grid()[::11]])
    compiled_values = np.array([policy._tanh(x) for x in values], np.float32)
    np.testing.assert_array_equal(compiled_values.view(np.int32), tanh(values).view(np.int32))


@pytest.mark.parametrize("evolve_biases", [False, True])
def test_first_of_a_larger_sample_are_the_smaller_one(evolve_biases: bool) -> None:
    mlp = MLP(evolve_biases=evolve_biases)
    sample = mlp.sample(7, seed=3)
    assert sample.shape == (7, mlp.genotype_length)
    assert sample.dtype == np.float32
    np.testing.assert_array_equal(mlp.sample(3, seed=3), sample[:3])
    assert len(np.unique(sample, axis=0)) == 7
    assert not np.array_equal(mlp.sample(3, seed=4), sample[:3])


def test_sample_follows_the_generator() -> None:
    mlp = MLP((4, 3))
    rng = np.random.default_rng(8)
    first, second = mlp.sample(2, rng), mlp.sample(2, rng)
    assert not np.array_equal(first, second)
    np.testing.assert_array_equal(first, mlp.sample(2, 8))


def test_sample_leaves_torchs_own_generator_alone() -> None:
    torch.manual_seed(1)
    expected = torch.rand(3)
    torch.manual_seed(1)
    MLP((4, 3)).sample(2, seed=0)
    assert torch.equal(torch.rand(3), expected)


def test_sample_is_xavier_normal() -> None:
    """Variance 2/(fan in + fan out) for every layer, mean 0, normal tails."""
    mlp = MLP()
    sample = mlp.sample(300, seed=9)
    start = 0
    for inputs, outputs in itertools.pairwise(mlp.sizes):
        weights = sample[:, start : start + inputs * outputs].astype(np.float64).ravel()
        start += inputs * outputs
        variance = 2 / (inputs + outputs)
        # Five standard errors: of a variance sqrt(2/n), of a fourth moment sqrt(96/n), relative.
        np.testing.assert_allclose(weights.var(), variance, rtol=5 * math.sqrt(2 / weights.size))
        assert abs(weights.mean()) < 5 * math.sqrt(variance / weights.size)
        kurtosis = (weights**4).mean() / variance**2
        assert abs(kurtosis - 3) < 5 * math.sqrt(96 / weights.size)
    assert start == sample.shape[1]


def test_sampled_biases_are_zero() -> None:
    mlp = MLP(evolve_biases=True)
    for module in (mlp.module(genotype) for genotype in mlp.sample(3, seed=0)):
        for name, parameter in module.named_parameters():
            assert bool((parameter == 0).all()) == name.endswith("bias")


def test_fixed_biases_stay_zero() -> None:
    mlp = MLP()
    genotype = random_genotype(mlp, 1.0, seed=2)
    for name, parameter in mlp.module(genotype).named_parameters():
        if name.endswith("bias"):
            assert bool((parameter == 0).all())
    np.testing.assert_array_equal(mlp.actions(genotype, np.zeros((1, 25))), np.zeros((1, 4)))


@pytest.mark.parametrize("shape", [(1951,), (2020,), (1, 1952), (0,), ()])
def test_genotypes_that_do_not_fit(shape: tuple[int, ...]) -> None:
    mlp = MLP()
    for method in (mlp.parameters, mlp.module):
        with pytest.raises(
            NichechainError, match=r"genotype has shape .* but this controller's has \(1952,\)"
        ):
            method(np.zeros(shape, np.float32))


@pytest.mark.parametrize("shape", [(25,), (1, 24), (2, 26), (1, 1, 25)])
def test_observations_that_do_not_fit(shape: tuple[int, ...]) -> None:
    with pytest.raises(NichechainError, match=r"but must be \(N, 25\)"):
        MLP().actions(np.zeros(1952), np.zeros(shape))


@pytest.mark.parametrize("sizes", [(), (3,), (3, 0), (3, -1, 2)])
def test_sizes_that_are_none(sizes: tuple[int, ...]) -> None:
    with pytest.raises(NichechainError, match="layer sizes are"):
        MLP(sizes)


@pytest.mark.parametrize("names", [("gelu", "tanh"), ("relu", "softmax")])
def test_activations_that_are_none(names: tuple[str, str]) -> None:
    with pytest.raises(NichechainError, match="must be one of identity, relu, tanh"):
        MLP(PAPER, *names)
