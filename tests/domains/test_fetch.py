"""Fetch Pick and Place: a pure function of the genotype."""

from __future__ import annotations

import pickle

import gymnasium
import gymnasium_robotics
import numpy as np
import pytest
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError
from nichechain.domains import Domain, Evaluation, FetchPickAndPlace, make
from nichechain.execution import Threads

gymnasium.register_envs(gymnasium_robotics)


@pytest.fixture(scope="module")
def domain() -> FetchPickAndPlace:
    return FetchPickAndPlace()


@pytest.fixture(scope="module")
def genotypes(domain: FetchPickAndPlace) -> NDArray[np.float32]:
    rng = np.random.default_rng(0)
    sample = domain.sample(8, seed=1)
    return (sample + rng.choice([0.1, 1.0], (8, 1)) * rng.standard_cauchy(sample.shape)).astype(np.float32)


def assert_same(first: Evaluation, second: Evaluation) -> None:
    np.testing.assert_array_equal(first.behavior.view(np.int64), second.behavior.view(np.int64))
    np.testing.assert_array_equal(first.objective.view(np.int64), second.objective.view(np.int64))
    np.testing.assert_array_equal(first.failed, second.failed)
    assert first.reasons == second.reasons


def test_is_a_domain(domain: FetchPickAndPlace) -> None:
    assert isinstance(domain, Domain)
    assert domain.genotype_length == 1952
    assert FetchPickAndPlace(evolve_biases=True).genotype_length == 2020
    assert (domain.behavior_names, domain.unit) == (("x", "y"), "m")


def test_bits_do_not_depend_on_the_batch(domain: FetchPickAndPlace, genotypes: NDArray[np.float32]) -> None:
    whole = domain.evaluate(genotypes)
    one_by_one = Evaluation.concatenate([domain.evaluate(row[None]) for row in genotypes])
    assert_same(whole, one_by_one)
    backwards = domain.evaluate(genotypes[::-1])
    np.testing.assert_array_equal(backwards.behavior[::-1], whole.behavior)
    # Eight policies whose results were all alike would show nothing.
    assert len(np.unique(whole.behavior, axis=0)) > 1


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_bits_do_not_depend_on_the_threads(
    domain: FetchPickAndPlace, genotypes: NDArray[np.float32], workers: int
) -> None:
    with Threads(workers) as executor:
        assert_same(executor.evaluate(domain, genotypes), domain.evaluate(genotypes))


def test_threads_may_share_a_domain_that_has_not_started(genotypes: NDArray[np.float32]) -> None:
    """The model is loaded once, by whoever comes first."""
    fresh = FetchPickAndPlace()
    with Threads(4) as executor:
        evaluation = executor.evaluate(fresh, genotypes)
    assert_same(evaluation, FetchPickAndPlace().evaluate(genotypes))


def test_pickles_without_its_physics(domain: FetchPickAndPlace, genotypes: NDArray[np.float32]) -> None:
    before = domain.evaluate(genotypes[:2])
    content = pickle.dumps(domain)
    assert len(content) < 1000
    copy = pickle.loads(content)
    assert repr(copy) == repr(domain) == "FetchPickAndPlace(seed=0, 1952 parameters)"
    assert_same(copy.evaluate(genotypes[:2]), before)
    other = pickle.loads(pickle.dumps(FetchPickAndPlace(seed=5, evolve_biases=True)))
    assert (other.seed, other.genotype_length) == (5, 2020)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_genotype_that_is_not_finite_fails_alone(
    domain: FetchPickAndPlace, genotypes: NDArray[np.float32], bad: float
) -> None:
    rows = genotypes[:3].copy()
    rows[1, 700] = bad
    evaluation = domain.evaluate(rows)
    assert evaluation.failed.tolist() == [False, True, False]
    assert evaluation.reasons == ("", "genotype is not finite", "")
    assert np.isnan(evaluation.behavior[1]).all()
    assert np.isnan(evaluation.objective[1])
    good = domain.evaluate(genotypes[[0, 2]])
    np.testing.assert_array_equal(evaluation.behavior[[0, 2]], good.behavior)


@pytest.mark.parametrize("seed", [0, 3])
def test_objective_is_the_dense_reward_of_the_last_step(seed: int, genotypes: NDArray[np.float32]) -> None:
    domain = FetchPickAndPlace(seed=seed)
    env = gymnasium.make(domain.env_id, reward_type="dense")
    evaluation = domain.evaluate(genotypes)
    for genotype, objective in zip(genotypes, evaluation.objective, strict=True):
        observation, _ = env.reset(seed=seed)
        for _ in range(domain.steps):
            action = domain.actions(genotype, observation["observation"][None])[0]
            observation, reward, *_ = env.step(action)
        assert objective == reward
    env.close()


@pytest.mark.parametrize("seed", [0, 3])
def test_start_is_where_the_reset_puts_the_block(seed: int) -> None:
    env = gymnasium.make("FetchPickAndPlace-v4")
    observation, _ = env.reset(seed=seed)
    env.close()
    start = FetchPickAndPlace(seed=seed).start
    np.testing.assert_array_equal(start, observation["observation"][3:5])
    np.testing.assert_array_equal(start, observation["achieved_goal"][:2])


def test_block_stays_near_where_it_stands_if_nobody_acts(domain: FetchPickAndPlace) -> None:
    evaluation = domain.evaluate(np.zeros((1, 1952), np.float32))
    np.testing.assert_allclose(evaluation.behavior[0], domain.start, atol=1e-3)


def test_actions_are_those_of_the_episode(domain: FetchPickAndPlace, genotypes: NDArray[np.float32]) -> None:
    episode = domain.episode(genotypes[0])
    assert episode.observations.shape == (51, 25)
    actions = domain.actions(genotypes[0], episode.observations[:-1])
    assert actions.dtype == np.float32
    np.testing.assert_array_equal(actions.view(np.int32), episode.actions.view(np.int32))
    assert (np.abs(actions) <= 1).all()


def test_controller_agrees_with_the_actions(
    domain: FetchPickAndPlace, genotypes: NDArray[np.float32]
) -> None:
    import torch

    sample = domain.sample(1, seed=3)[0]
    observations = domain.episode(genotypes[0]).observations
    with torch.no_grad():
        actions = domain.controller(sample)(torch.from_numpy(observations.astype(np.float32)))
    np.testing.assert_allclose(actions.numpy(), domain.actions(sample, observations), atol=1e-5)


@pytest.mark.parametrize("shape", [(1952,), (1, 1951), (2, 2020), (1, 1, 1952), (0, 0)])
def test_shapes_that_do_not_fit(domain: FetchPickAndPlace, shape: tuple[int, ...]) -> None:
    with pytest.raises(NichechainError, match="genotypes have shape"):
        domain.evaluate(np.zeros(shape, np.float32))


def test_names_of_domains() -> None:
    assert make("fetch", seed=4).seed == 4
    assert make("arm").name == "arm"
    with pytest.raises(NichechainError, match="domain is 'ant', but must be one of arm, "):
        make("ant")
