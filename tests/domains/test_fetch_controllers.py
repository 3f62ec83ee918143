"""Controllers other than the paper's: stacks run natively, anything else step by step."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import torch
from torch import nn

from nichechain.core.errors import NichechainError
from nichechain.domains import FetchPickAndPlace
from nichechain.domains.engine.fetch import NativeFetch, SteppedFetch
from nichechain.domains.policies.controllers import MLP, ModuleController


class Residual(nn.Module):
    """No stack: it adds its input back."""

    def __init__(self) -> None:
        super().__init__()
        self.inner = nn.Linear(25, 25)
        self.outer = nn.Linear(25, 4)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.tanh(self.outer(x + torch.relu(self.inner(x))))


def stack() -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(25, 12), nn.Tanh(), nn.Linear(12, 9), nn.ReLU(), nn.Linear(9, 4), nn.Tanh()
    )


@pytest.mark.parametrize("evolve_biases", [False, True])
def test_a_stack_is_recognised_and_comes_back(evolve_biases: bool) -> None:
    mlp = MLP.of(stack(), evolve_biases=evolve_biases)
    assert mlp == MLP((25, 12, 9, 4), ("tanh", "relu"), "tanh", evolve_biases)
    genotype = mlp.sample(1, seed=3)[0] + np.float32(0.1)
    module = mlp.module(genotype)
    assert [type(layer) for layer in module] == [type(layer) for layer in stack()]
    observations = np.random.default_rng(0).normal(size=(7, 25)).astype(np.float32)
    with torch.no_grad():
        expected = module(torch.from_numpy(observations)).numpy()
    np.testing.assert_allclose(mlp.actions(genotype, observations), expected, atol=2e-6)


@pytest.mark.parametrize(
    "module",
    [
        Residual(),
        nn.Sequential(nn.Linear(25, 4), nn.Sigmoid()),
        nn.Sequential(nn.Linear(25, 4, bias=False), nn.Tanh()),
        nn.Sequential(nn.ReLU(), nn.Linear(25, 4)),
        nn.Sequential(nn.Linear(25, 4), nn.ReLU(), nn.Tanh()),
        nn.Sequential(),
    ],
)
def test_other_modules_are_not_taken_for_stacks(module: nn.Module) -> None:
    assert MLP.of(module) is None


def test_a_stack_runs_natively_with_the_bits_of_the_environment() -> None:
    domain = FetchPickAndPlace(controller=stack(), evolve_biases=True)
    assert domain.genotype_length == 25 * 12 + 12 + 12 * 9 + 9 + 9 * 4 + 4
    genotype = domain.sample(1, seed=5)[0] + np.random.default_rng(2).standard_cauchy(
        domain.genotype_length
    ).astype(np.float32)
    native = domain.episode(genotype)
    assert isinstance(domain._episodes, NativeFetch)
    stepped = SteppedFetch(domain.env_id, 0).run(domain.network, genotype, domain.steps)
    assert (native.observations == stepped.observations).all()
    assert (native.actions == stepped.actions).all()


def test_any_module_runs_step_by_step() -> None:
    domain = FetchPickAndPlace(controller=Residual())
    assert domain.genotype_length == 25 * 25 + 25 + 25 * 4 + 4
    genotypes = domain.sample(2, seed=1)
    assert (genotypes[:, 625:650] == 0).all()
    assert genotypes[:, :625].std() == pytest.approx(np.sqrt(2 / 50), rel=0.1)
    assert isinstance(domain._episodes, SteppedFetch)
    evaluation = pickle.loads(pickle.dumps(domain)).evaluate(genotypes)
    for genotype, behavior in zip(genotypes, evaluation.behavior, strict=True):
        episode = domain.episode(genotype)
        assert (episode.observations[-1, 3:5] == behavior).all()
        with torch.no_grad():
            first = domain.controller(genotype)(torch.from_numpy(np.float32(episode.observations[:1])))
        assert (first.numpy() == episode.actions[0]).all()


def test_policies_do_not_depend_on_the_batch() -> None:
    controller = ModuleController(Residual(), 25, 4)
    policy = controller.policy(controller.sample(1, seed=0)[0])
    observations = np.random.default_rng(1).normal(size=(9, 25))
    alone = np.concatenate([policy(row[None]) for row in observations])
    assert (policy(observations) == alone).all()


def test_controllers_that_do_not_fit() -> None:
    with pytest.raises(NichechainError, match="from 24 to 4 units, but must go from 25 to 4"):
        FetchPickAndPlace(controller=nn.Linear(24, 4))
    with pytest.raises(NichechainError, match="hidden has 1 activations, but there are 2 hidden layers"):
        MLP(hidden=("relu",))
    with pytest.raises(NichechainError, match=r"genotype has shape \(3,\)"):
        ModuleController(Residual(), 25, 4).module(np.zeros(3))
