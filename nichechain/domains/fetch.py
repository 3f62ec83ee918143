"""Fetch Pick and Place, the paper's task: behavior is where the block ends up."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.controllers import MLP, Controller, ModuleController
from nichechain.domains.base import Evaluation, check_genotypes
from nichechain.errors import NichechainError

if TYPE_CHECKING:
    from torch import nn

    from nichechain.engine.fetch import Episode, FetchEpisodes


_INPUTS, _OUTPUTS = 25, 4


class FetchPickAndPlace:
    """``FetchPickAndPlace-v4`` of gymnasium-robotics from one fixed start ("Task description").

    A policy sees the 25 observations (the goal is left out) and acts 50 times at 25 Hz. Final
    positions equal those of the environment to the last bit.

    Parameters
    ----------
    seed : int
        Seed of the environment's reset, which places the block and the target.
    controller : torch.nn.Module, optional
        Architecture of the policy, from 25 observations to 4 actions in [-1, 1]; by default the
        paper's 25-32-32-4 with ReLU and tanh. A stack of linear layers with ReLU or tanh runs
        natively. Any other module runs step by step, and all of its parameters evolve.
    evolve_biases : bool
        Whether biases of a stack are evolved too: the paper's genotypes are then 2,020 long
        instead of 1,952.

    Notes
    -----
    Behavior is (x, y) of the block after the last action, in metres. The objective is the
    task's dense reward there: minus the distance from block to target, in metres.
    """

    env_id = "FetchPickAndPlace-v4"
    name = "fetch"
    behavior_names = ("x", "y")
    unit = "m"
    objective_name = "minus the distance from block to target (m)"
    bounds = ((1.05, 1.55), (0.40, 1.10))
    chunk = 1
    steps = 50

    def __init__(
        self, seed: int = 0, *, controller: nn.Module | None = None, evolve_biases: bool = False
    ) -> None:
        self.seed = int(seed)
        self.network: Controller = _network(controller, evolve_biases)
        if (self.network.inputs, self.network.outputs) != (_INPUTS, _OUTPUTS):
            raise NichechainError(
                f"the controller goes from {self.network.inputs} to {self.network.outputs} units, "
                f"but must go from {_INPUTS} to {_OUTPUTS}"
            )
        self._episodes_made: FetchEpisodes | None = None
        self._lock = threading.Lock()

    def __repr__(self) -> str:
        return f"FetchPickAndPlace(seed={self.seed}, {self.genotype_length} parameters)"

    def __getstate__(self) -> dict[str, Any]:
        # A model and its pool of states stay in the process that made them.
        return {"seed": self.seed, "network": self.network}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _episodes_made=None, _lock=threading.Lock())

    @property
    def genotype_length(self) -> int:
        """1,952 weights, and 68 biases if they evolve."""
        return self.network.genotype_length

    @property
    def start(self) -> NDArray[np.float64]:
        """Where the block stands after the reset, (2,), metres."""
        # No action can reach the block within no step.
        still = self._episodes.run(self.network, np.zeros(self.genotype_length, np.float32), 0)
        return still.observations[0, 3:5].copy()

    def sample(self, n: int, *, seed: int | np.random.Generator) -> NDArray[np.float32]:
        """Genotypes initialised as in the paper: Xavier normal weights, biases 0.

        Parameters
        ----------
        n : int
        seed : int or numpy.random.Generator

        Returns
        -------
        (n, genotype_length) float32 array
        """
        return self.network.sample(n, seed)

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Run one episode per genotype.

        Parameters
        ----------
        genotypes : (N, genotype_length) array

        Returns
        -------
        Evaluation
            Behavior (N, 2) in metres. A row failed if its genotype is not finite or if MuJoCo
            found the simulation unstable.

        Raises
        ------
        NichechainError
            If the shape does not fit.
        """
        rows = check_genotypes(genotypes, self.genotype_length)
        behavior = np.full((len(rows), 2), np.nan)
        objective = np.full(len(rows), np.nan)
        reasons = [""] * len(rows)
        for i, genotype in enumerate(rows):
            if not np.isfinite(genotype).all():
                reasons[i] = "genotype is not finite"
                continue
            episode = self.episode(genotype)
            reasons[i] = episode.failure
            if not episode.failure:
                block = episode.observations[-1, 3:6]
                behavior[i] = block[:2]
                objective[i] = -np.linalg.norm(block - self._episodes.goal, axis=-1)
        return Evaluation(behavior, objective, np.array([bool(reason) for reason in reasons]), tuple(reasons))

    def episode(self, genotype: ArrayLike) -> Episode:
        """What the policy of one genotype sees and does: 51 observations and 50 actions."""
        (row,) = check_genotypes(np.asarray(genotype)[None], self.genotype_length)
        return self._episodes.run(self.network, row, self.steps)

    def actions(self, genotype: ArrayLike, observations: ArrayLike) -> NDArray[np.float32]:
        """What the policy does for each of n observations (n, 25): (n, 4) float32, in [-1, 1]."""
        return self.network.policy(genotype)(observations)

    def controller(self, genotype: ArrayLike) -> nn.Module:
        """The policy as a torch module, from (n, 25) float32 observations to (n, 4) actions.

        Equal to :meth:`actions` up to the rounding of a differently ordered sum.
        """
        return self.network.module(genotype)

    @property
    def _episodes(self) -> FetchEpisodes:
        # Loading MuJoCo and its model takes a second, so not before an episode is asked for, and
        # once even if several threads ask together.
        if self._episodes_made is None:
            with self._lock:
                if self._episodes_made is None:
                    from nichechain.engine.fetch import fetch_episodes

                    self._episodes_made = fetch_episodes(self.env_id, self.seed, self.network)
        return self._episodes_made


def _network(controller: nn.Module | None, evolve_biases: bool) -> Controller:
    if controller is None:
        return MLP((_INPUTS, 32, 32, _OUTPUTS), evolve_biases=evolve_biases)
    stack = MLP.of(controller, evolve_biases=evolve_biases)
    return stack or ModuleController(controller, _INPUTS, _OUTPUTS)
