"""The Fetch tasks: behavior is where the block ends up, or the gripper where there is no block."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import check_seed
from nichechain.domains.base import Evaluation, check_genotypes
from nichechain.domains.memory import CACHE_MEMORY, check_cache_memory
from nichechain.domains.noise import Noise, check_seeds
from nichechain.domains.policies.controllers import Controller
from nichechain.domains.policies.networks import network
from nichechain.domains.shown import ShownDomain
from nichechain.domains.watching import Film, Motion, offscreen_backend

if TYPE_CHECKING:
    from torch import nn

    from nichechain.domains.engine.fetch import Disturbance, FetchEpisodes, Rollout


_OUTPUTS = 4
_RATE = 25.0


class FetchTask(ShownDomain):
    """A Fetch task of gymnasium-robotics from one fixed start.

    A policy sees the observations (the goal is left out) and acts 50 times at 25 Hz. Final
    positions equal those of the environment to the last bit.

    Parameters
    ----------
    seed : int
        Seed of the environment's reset, which places the block and the target.
    controller : torch.nn.Module or str
        Architecture of the policy, from the observations to 4 actions in [-1, 1]; by default the
        paper's two hidden layers of 32 units with ReLU, and tanh. A stack of linear layers with
        ReLU or tanh runs natively. Any other module runs step by step, and all of its parameters
        evolve.
    evolve_biases : bool
        Whether biases of a stack are evolved too; by default they stay 0.
    cache_memory : int
        Bytes, in each process, for the cache of motions (see :mod:`nichechain.engine.motions`):
        physics that an earlier episode has computed is not computed again. The results are the
        same. 0 turns it off; by default 2 GiB. Only a policy that runs natively has one.

    Raises
    ------
    NichechainError
        If a number is below 0 or no whole number, or the controller does not fit.

    Notes
    -----
    Behavior is (x, y) after the last action, in metres. The objective is the task's dense reward
    there: minus the distance to the target, in metres.
    """

    name: ClassVar[str]
    env_id: ClassVar[str]
    bounds: ClassVar[tuple[tuple[float, float], ...]]
    inputs: ClassVar[int] = 25
    place: ClassVar[slice] = slice(3, 6)
    """Where in an observation the position stands that counts: the block's, or the gripper's."""
    has_block: ClassVar[bool] = True
    objective_name = "minus the distance from block to target (m)"
    behavior_names = ("x", "y")
    unit = "m"
    chunk = 1
    steps = 50

    def __init__(
        self,
        seed: int = 0,
        *,
        controller: nn.Module | str = "mlp:32,32",
        evolve_biases: bool = False,
        cache_memory: int = CACHE_MEMORY,
    ) -> None:
        check_seed(seed)
        check_cache_memory(cache_memory)
        self.seed = int(seed)
        self._cache_memory = int(cache_memory)
        self.network: Controller = network(controller, self.inputs, _OUTPUTS, evolve_biases=evolve_biases)
        self._episodes_made: FetchEpisodes | None = None
        self._lock = threading.Lock()

    def __repr__(self) -> str:
        return f"{type(self).__name__}(seed={self.seed}, {self.genotype_length} parameters)"

    def __getstate__(self) -> dict[str, Any]:
        # A model and its pool of states stay in the process that made them.
        return {"seed": self.seed, "network": self.network, "_cache_memory": self._cache_memory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _episodes_made=None, _lock=threading.Lock())

    @property
    def cache_memory(self) -> int:
        """Bytes for the cache of motions; setting it lets go of what it holds."""
        return self._cache_memory

    @cache_memory.setter
    def cache_memory(self, cache_memory: int) -> None:
        check_cache_memory(cache_memory)
        with self._lock:
            self._cache_memory = int(cache_memory)
            self._episodes_made = None

    @property
    def genotype_length(self) -> int:
        """All weights, and the biases if they evolve."""
        return self.network.genotype_length

    @property
    def start(self) -> NDArray[np.float64]:
        """Where the block, or the gripper, stands after the reset, (2,), metres."""
        # No action can reach the block within no step.
        still = self._episodes.run(self.network, np.zeros(self.genotype_length, np.float32), 0)
        return still.observations[0, self.place][:2].copy()

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
        from nichechain.domains.engine.fetch import UNDISTURBED

        rows = check_genotypes(genotypes, self.genotype_length)
        return self._evaluate(rows, (UNDISTURBED for _ in rows))

    def evaluate_noisy(self, genotypes: ArrayLike, noise: Noise, seeds: ArrayLike) -> Evaluation:
        """Run one episode per genotype, disturbed.

        Parameters
        ----------
        genotypes : (N, genotype_length) array
        noise : Noise
            Of observations, of actions (before they are clipped to [-1, 1]), and ``initial`` of the
            place of the block on the table, metres along x and along y.
        seeds : (N,) array of non-negative int
            What each episode's noise is drawn with.

        Raises
        ------
        NichechainError
            If a shape does not fit, or the block of a task that has none should be displaced.
        """
        rows = check_genotypes(genotypes, self.genotype_length)
        if not self.has_block:
            noise.only("observation", "action", domain=self.name)
        return self._evaluate(rows, (self._disturbance(noise, int(s)) for s in check_seeds(seeds, rows)))

    def episode(self, genotype: ArrayLike) -> Rollout:
        """What the policy of one genotype sees and does: 51 observations and 50 actions."""
        (row,) = check_genotypes(np.asarray(genotype)[None], self.genotype_length)
        return self._episodes.run(self.network, row, self.steps)

    def watch(self, genotype: ArrayLike, *, drawn: bool = False) -> Film | Motion:
        """The episode of one genotype: pictures, or places where MuJoCo has no renderer.

        Parameters
        ----------
        genotype : (genotype_length,) array
        drawn : bool
            Whether to give the places of gripper and block over the table in any case.
        """
        episode = self.episode(genotype)
        if not drawn and offscreen_backend() is not None:
            from nichechain.domains.engine.pictures import fetch_pictures

            return Film(fetch_pictures(self.env_id, self.seed, episode.actions), _RATE)
        tracks = {"gripper": episode.observations[:, :2]}
        if self.has_block:
            tracks["block"] = episode.observations[:, self.place][:, :2]
        return Motion(tracks, None, _RATE)

    def actions(self, genotype: ArrayLike, observations: ArrayLike) -> NDArray[np.float32]:
        """What the policy does for each of n observations: (n, 4) float32, in [-1, 1]."""
        return self.network.policy(genotype)(observations)

    def controller(self, genotype: ArrayLike) -> nn.Module:
        """The policy as a torch module, from (n, inputs) float32 observations to (n, 4) actions.

        Equal to :meth:`actions` up to the rounding of a differently ordered sum.
        """
        return self.network.module(genotype)

    def _disturbance(self, noise: Noise, seed: int) -> Disturbance:
        from nichechain.domains.engine.fetch import Disturbance

        # Always the same draws, so that one kind of noise does not change what another one does.
        rng = np.random.default_rng(seed)
        shift = rng.standard_normal(2)
        observation = rng.standard_normal((self.steps, self.inputs))
        action = rng.standard_normal((self.steps, _OUTPUTS))
        return Disturbance(
            noise.observation * observation if noise.observation else None,
            (noise.action * action).astype(np.float32) if noise.action else None,
            noise.initial * shift if noise.initial else None,
        )

    def _evaluate(self, rows: NDArray[np.float32], disturbances: Iterable[Disturbance]) -> Evaluation:
        behavior = np.full((len(rows), 2), np.nan)
        objective = np.full(len(rows), np.nan)
        reasons = [""] * len(rows)
        steps = known = 0
        for i, (genotype, disturbance) in enumerate(zip(rows, disturbances, strict=True)):
            if not np.isfinite(genotype).all():
                reasons[i] = "genotype is not finite"
                continue
            episode = self._episodes.run(self.network, genotype, self.steps, disturbance)
            steps += self.steps
            known += episode.known
            reasons[i] = episode.failure
            if not episode.failure:
                reached = episode.observations[-1, self.place]
                behavior[i] = reached[:2]
                objective[i] = -np.linalg.norm(reached - self._episodes.goal, axis=-1)
        failed = np.array([bool(reason) for reason in reasons])
        return Evaluation(behavior, objective, failed, tuple(reasons), steps=steps, known=known)

    @property
    def _episodes(self) -> FetchEpisodes:
        # Loading MuJoCo and its model takes a second, so not before an episode is asked for, and
        # once even if several threads ask together.
        if self._episodes_made is None:
            with self._lock:
                if self._episodes_made is None:
                    from nichechain.domains.engine.fetch import fetch_episodes

                    self._episodes_made = fetch_episodes(
                        self.env_id, self.seed, self.network, self._cache_memory
                    )
        return self._episodes_made


class FetchPickAndPlace(FetchTask):
    """``FetchPickAndPlace-v4``, the paper's task ("Task description").

    A genotype holds 1,952 weights, and 68 biases if they evolve. Bounds are those of the table
    top, 0.5 by 0.7 m. Everything else is as in :class:`FetchTask`.
    """

    name = "fetch"
    env_id = "FetchPickAndPlace-v4"
    bounds = ((1.05, 1.55), (0.40, 1.10))


class FetchPush(FetchTask):
    """``FetchPush-v4``: the fingers stay shut, so the block can only be pushed over the table.

    Bounds are those of the table top, 0.5 by 0.7 m. Everything else is as in :class:`FetchTask`.
    """

    name = "fetch-push"
    env_id = "FetchPush-v4"
    bounds = ((1.05, 1.55), (0.40, 1.10))


class FetchSlide(FetchTask):
    """``FetchSlide-v4``: a puck that slides further than the arm reaches.

    Bounds are those of its long table, 1.25 by 0.9 m, to the centimetre. Everything else is as in
    :class:`FetchTask`, the puck being the block.
    """

    name = "fetch-slide"
    env_id = "FetchSlide-v4"
    bounds = ((0.70, 1.95), (0.30, 1.20))


class FetchReach(FetchTask):
    """``FetchReach-v4``: no block, and behavior is where the gripper ends.

    Bounds are those of the arm's reach, far wider than the table: they hold 98 % of where 250
    policies ended, with initial weights and Cauchy noise of scale 0.1, 1 and 10 on them.
    Everything else is as in :class:`FetchTask`.
    """

    name = "fetch-reach"
    env_id = "FetchReach-v4"
    inputs = 10
    place = slice(0, 3)
    has_block = False
    objective_name = "minus the distance from gripper to target (m)"
    bounds = ((0.20, 1.70), (-0.20, 1.60))
