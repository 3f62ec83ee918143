"""Any Gymnasium environment as a domain: a policy, a number of steps, and a descriptor."""

from __future__ import annotations

import contextlib
import functools
import io
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_bounds, as_tuple, check_at_least, check_seed, check_text, shown
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Evaluation, check_genotypes
from nichechain.domains.descriptors import Descriptor, Episode, FinalObservation, MeanObservation, named
from nichechain.domains.noise import Noise, average, check_repeats, check_seeds, evaluation_seeds
from nichechain.domains.policies.controllers import MLP, Controller
from nichechain.domains.policies.networks import network
from nichechain.domains.policies.spaces import Actions, Observations, actions_of, stacked
from nichechain.domains.shown import ShownDomain
from nichechain.domains.watching import Film
from nichechain.niches import parse_bounds
from nichechain.niches.base import check_bounds, precision_of

if TYPE_CHECKING:
    from torch import nn

Floats = NDArray[np.float64]
Float32s = NDArray[np.float32]
Act: TypeAlias = Callable[[Floats], Float32s]

PREFIX = "gym:"
_SILENCE = Noise()
_ENV_OPTION = "env."


class GymDomain(ShownDomain):
    """A Gymnasium environment, a policy that acts in it, and a descriptor of what became of it.

    An evaluation makes one episode and reads its behavior off. The same genotype gives the same
    bits whatever the batch and the workers, if the environment draws what it draws from the
    generator that ``reset(seed=...)`` gives it, as Gymnasium asks.

    Parameters
    ----------
    env_id : str
        As ``gymnasium.make`` takes it; environments of gymnasium-robotics need no registration.
    descriptor : str or callable
        A function from an :class:`Episode` to B numbers, or a text, see
        :func:`nichechain.domains.descriptors.named`.
    bounds : sequence of (float, float), optional
        Bounds of a grid over behavior. Needed, unless behavior is some numbers of an observation
        that has finite bounds itself.
    names : sequence of str, optional
        Of the axes of behavior; by default what the descriptor says, or their numbers.
    unit : str
        Of behavior.
    controller : torch.nn.Module or str
        Such as ``"mlp:64,64"``: see :func:`nichechain.domains.policies.networks.network`.
    steps : int, optional
        Actions of an episode at most; by default the limit that the environment is registered
        with.
    seed : int
        Of the reset; with ``repeats``, of their resets.
    repeats : int
        For environments with something random: episodes of each genotype, each from a reset of
        its own, whose mean is the behavior. By default one episode from the reset of ``seed``.
    observations : sequence of str
        Keys of a Dict observation that the policy sees; by default ``observation`` if there is
        one, or else all.
    evolve_biases : bool
        Whether biases of a stack of linear layers evolve, or stay 0.
    env_options : mapping, optional
        Keyword arguments for ``gymnasium.make``.

    Raises
    ------
    NichechainError
        If there is no such environment, its spaces are of a kind that this cannot serve, or an
        option does not fit.

    Notes
    -----
    Actions: the outputs of the policy, in [-1, 1], span the bounds of a Box; of Discrete and
    MultiDiscrete actions those with the largest outputs are taken, of MultiBinary ones those with
    outputs above 0; a Tuple or Dict of these shares the outputs among them. The
    objective is the sum of rewards.

    A descriptor named by a text ``module:function`` is imported when the first episode is
    evaluated, never before.
    """

    chunk = 1
    objective_name = "sum of rewards"
    start: Floats | None = None

    def __init__(
        self,
        env_id: str,
        descriptor: Descriptor | str = "final-xy",
        *,
        bounds: Sequence[tuple[float, float]] | None = None,
        names: Sequence[str] | None = None,
        unit: str = "units",
        controller: nn.Module | str = "mlp:64,64",
        steps: int | None = None,
        seed: int = 0,
        repeats: int = 1,
        observations: Sequence[str] = (),
        evolve_biases: bool = False,
        env_options: Mapping[str, Any] | None = None,
    ) -> None:
        check_text(environment=env_id)
        check_seed(seed)
        check_at_least(1, repeats=repeats)
        if env_options is not None and not isinstance(env_options, Mapping):
            raise NichechainError(f"env_options is {shown(env_options)}, but must map names to values")
        if steps is not None:
            check_at_least(1, steps=steps)
        self.env_id = env_id
        self.name = PREFIX + env_id
        self.seed = int(seed)
        self.repeats = int(repeats)
        self.unit = unit
        self._env_options = dict(env_options or {})
        self._steps = steps
        # list.pop and list.append are atomic, so the list is a pool without a lock.
        self._idle: list[Any] = [_make(env_id, steps, self._env_options)]
        env = self._idle[0]
        if steps is None and env.spec.max_episode_steps is None:
            raise NichechainError(f"{env_id} has no limit of steps of its own: say how many")
        self._observations = Observations.of(env.observation_space, observations)
        self._actions: Actions = actions_of(env.action_space)
        self.network: Controller = network(
            controller,
            self._observations.inputs,
            self._actions.outputs,
            output=self._actions.activation,
            evolve_biases=evolve_biases,
        )
        known = None
        if isinstance(descriptor, str):
            descriptor, known = named(descriptor)
        self._descriptor: Descriptor = descriptor
        self.bounds = self._bounds(bounds)
        axes = len(self.bounds)
        named_axes = None if names is None else as_tuple("names", names)
        check_text(**{f"names of axis {axis}": name for axis, name in enumerate(named_axes or ())})
        self.behavior_names = tuple(named_axes or known or map(str, range(axes)))
        if len(self.behavior_names) != axes:
            raise NichechainError(
                f"there are bounds of {axes} axes of behavior, but {len(self.behavior_names)} axes: "
                f"{', '.join(self.behavior_names)}"
            )

    @classmethod
    def of_options(cls, env_id: str, *, seed: int = 0, **options: str | float) -> GymDomain:
        """The domain that plain texts and numbers describe, as the command line has them.

        Parameters
        ----------
        env_id : str
        seed : int
        **options
            ``descriptor``, ``unit``, ``controller``, ``steps``, ``repeats`` and ``evolve_biases`` as
            in the class; ``bounds`` like ``"0,1,-2,2"``, ``names`` and ``observations`` with commas;
            and keyword arguments of ``gymnasium.make`` after ``env.``, such as
            ``env.terminate_when_unhealthy``.

        Raises
        ------
        NichechainError
            If there is no such option.
        """
        given: dict[str, Any] = {}
        env_options: dict[str, Any] = {}
        for name, value in options.items():
            if name.startswith(_ENV_OPTION):
                env_options[name.removeprefix(_ENV_OPTION)] = value
            elif name == "bounds":
                given[name] = parse_bounds(str(value))
            elif name in ("names", "observations"):
                given[name] = [word.strip() for word in str(value).split(",")]
            elif name in ("steps", "repeats"):
                given[name] = int(value)
            elif name in ("descriptor", "unit", "controller", "evolve_biases"):
                given[name] = value
            else:
                raise NichechainError(
                    f"{PREFIX}{env_id} has no option {name!r}: it has descriptor, bounds, names, unit, "
                    f"controller, steps, repeats, observations, evolve_biases and {_ENV_OPTION}NAME"
                )
        return cls(env_id, seed=seed, env_options=env_options, **given)

    def __repr__(self) -> str:
        return f"GymDomain({self.env_id!r}, seed={self.seed}, {self.genotype_length} parameters)"

    def __getstate__(self) -> dict[str, Any]:
        # Environments stay in the process that made them.
        return {**self.__dict__, "_idle": []}

    @property
    def genotype_length(self) -> int:
        """Number of evolved parameters of the policy."""
        return self.network.genotype_length

    def sample(self, n: int, *, seed: int | np.random.Generator) -> Float32s:
        """Genotypes with Xavier normal weights and biases 0, (n, genotype_length)."""
        return self.network.sample(n, seed)

    def evaluate(self, genotypes: ArrayLike, *, seeds: ArrayLike | None = None) -> Evaluation:
        """Run the episodes of each genotype.

        Parameters
        ----------
        genotypes : (N, genotype_length) array
        seeds : (N, R) array of non-negative int, optional
            Seeds of the resets of R episodes, whose mean is the behavior. By default those of
            ``repeats``, each a function of the genotype (see
            :func:`nichechain.domains.noise.evaluation_seeds`), or that of the domain.

        Returns
        -------
        Evaluation
            With a spread where there are repeats. A row failed if its genotype is not finite, if
            MuJoCo found the simulation unstable, or if its behavior is not finite.

        Raises
        ------
        NichechainError
            If a shape does not fit, or the descriptor does not give as many numbers as there are
            bounds.
        """
        rows = check_genotypes(genotypes, self.genotype_length)
        if seeds is not None:
            drawn = check_repeats(seeds, rows)
        elif self.repeats > 1:
            drawn = evaluation_seeds(self.seed, rows, self.repeats)
        else:
            return self._run(rows, np.full(len(rows), self.seed), _SILENCE, np.zeros(len(rows), np.int64))
        return average([self._run(rows, column, _SILENCE, column) for column in drawn.T])

    def evaluate_noisy(self, genotypes: ArrayLike, noise: Noise, seeds: ArrayLike) -> Evaluation:
        """Run one episode per genotype, disturbed.

        Parameters
        ----------
        genotypes : (N, genotype_length) array
        noise : Noise
            Of observations, of the policy's outputs (before they become an action), and
            ``initial``: 1 for a reset with the seed of the noise, 0 for that of the domain.
        seeds : (N,) array of non-negative int
            What each episode's noise is drawn with.

        Raises
        ------
        NichechainError
            If a shape does not fit, or ``initial`` is another number.
        """
        if noise.initial not in (0.0, 1.0):
            raise NichechainError(
                f"noise of initial is {noise.initial}, but an environment draws its own start: "
                "1 for another reset each time, or 0"
            )
        rows = check_genotypes(genotypes, self.genotype_length)
        given = check_seeds(seeds, rows)
        return self._run(rows, given if noise.initial else np.full(len(rows), self.seed), noise, given)

    def episode(self, genotype: ArrayLike) -> Episode:
        """The episode of one genotype from the domain's reset; its ``env`` is yours to keep."""
        (row,) = check_genotypes(np.asarray(genotype)[None], self.genotype_length)
        env = _make(self.env_id, self._steps, self._env_options)
        return self._episode(env, row, self.seed, _SILENCE, 0)

    def watch(self, genotype: ArrayLike, *, drawn: bool = False) -> Film:
        """Pictures of one genotype's episode, as the environment renders them.

        Raises
        ------
        NichechainError
            If the environment renders no pictures here, or a drawing is asked for.
        """
        if drawn:
            raise NichechainError(f"{self.name} cannot be drawn: an environment shows itself by its renderer")
        from nichechain.domains.filming import Filmed, makes_pictures

        (row,) = check_genotypes(np.asarray(genotype)[None], self.genotype_length)
        with makes_pictures(self.env_id, self._idle[0] if self._idle else None):
            env = _make(self.env_id, self._steps, {**self._env_options, "render_mode": "rgb_array"})
            camera = Filmed(env)
            self._episode(camera, row, self.seed, _SILENCE, 0)
            env.close()
        return Film(np.stack(camera.frames), camera.rate)

    def controller(self, genotype: ArrayLike) -> nn.Module:
        """The policy as a torch module, from flat observations to outputs (see the notes)."""
        return self.network.module(genotype)

    def _bounds(self, bounds: Sequence[tuple[float, float]] | None) -> tuple[tuple[float, float], ...]:
        if isinstance(self._descriptor, (FinalObservation, MeanObservation)):
            columns = self._descriptor.columns
            inputs = self._observations.inputs
            if max(columns) >= inputs:
                raise NichechainError(
                    f"the descriptor asks for observation {max(columns)}, but the last is {inputs - 1}"
                )
            if bounds is None:
                low, high = self._observations.low, self._observations.high
                bounds = [(float(low[column]), float(high[column])) for column in columns]
        pairs = () if bounds is None else as_bounds(bounds)
        if bounds is None or not np.isfinite(pairs).all():
            raise NichechainError(f"{self.name} has no finite bounds of behavior of its own: give bounds")
        check_bounds(pairs)
        return pairs

    def _run(
        self, rows: Float32s, resets: NDArray[np.int64], noise: Noise, seeds: NDArray[np.int64]
    ) -> Evaluation:
        axes = len(self.bounds)
        behavior = np.full((len(rows), axes), np.nan)
        objective = np.full(len(rows), np.nan)
        reasons = [""] * len(rows)
        precisions: set[np.dtype[Any]] = set()
        for i, (genotype, reset, seed) in enumerate(zip(rows, resets.tolist(), seeds.tolist(), strict=True)):
            if not np.isfinite(genotype).all():
                reasons[i] = "genotype is not finite"
                continue
            env = self._idle.pop() if self._idle else _make(self.env_id, self._steps, self._env_options)
            episode = self._episode(env, genotype, reset, noise, seed)
            reasons[i] = _physics_failure(episode.env)
            if not reasons[i]:
                given = self._descriptor(episode)
                precisions.add(precision_of(given))
                described = np.array(given, np.float64)
                if described.shape != (axes,):
                    raise NichechainError(
                        f"the descriptor gives an array of shape {described.shape}, "
                        f"but there are bounds of {axes} axes"
                    )
                if np.isfinite(described).all():
                    behavior[i] = described
                    # Not sum(), which rounds otherwise from Python 3.12 on.
                    objective[i] = functools.reduce(operator.add, episode.rewards.tolist(), 0.0)
                else:
                    reasons[i] = "behavior is not finite"
            # Not before the descriptor is done with its state.
            self._idle.append(env)
        failed = np.array([bool(reason) for reason in reasons])
        if len(precisions) == 1:
            behavior = behavior.astype(precisions.pop())
        return Evaluation(behavior, objective, failed, tuple(reasons))

    def _episode(self, env: Any, genotype: Float32s, reset: int, noise: Noise, seed: int) -> Episode:
        act = _policy(self.network, genotype)
        # A generator for each, so that one kind of noise does not change what another one does.
        eyes, hands = (np.random.default_rng([seed, which]) for which in range(2))
        # Some environments take no larger seeds.
        observation, info = env.reset(seed=reset % 2**31)
        observations, infos = [self._observations.flat(observation)], [info]
        actions: list[Any] = []
        rewards: list[float] = []
        terminated = truncated = False
        while not (terminated or truncated):
            seen = observations[-1]
            if noise.observation:
                seen = seen + noise.observation * eyes.standard_normal(len(seen))
            output = act(seen)
            if noise.action:
                output = output + (noise.action * hands.standard_normal(len(output))).astype(np.float32)
            actions.append(self._actions.action(output))
            observation, reward, terminated, truncated, info = env.step(actions[-1])
            observations.append(self._observations.flat(observation))
            rewards.append(float(reward))
            infos.append(info)
        return Episode(
            np.array(observations),
            stacked(actions),
            np.array(rewards),
            tuple(infos),
            bool(terminated),
            observation,
            env.unwrapped,
        )


def _policy(controller: Controller, genotype: Float32s) -> Act:
    """From one observation (inputs,) to outputs (outputs,); compiled where it can be, the same bits."""
    if not isinstance(controller, MLP):
        policy = controller.policy(genotype)
        return lambda observation: policy(observation[None])[0]
    from nichechain.domains.engine.policy import forward

    parameters = controller.parameters(genotype)
    sizes, activations = np.array(controller.sizes), controller.activations
    hidden = np.empty((2, max(controller.sizes)), np.float32)

    def act(observation: Floats) -> Float32s:
        output = np.empty(controller.outputs, np.float32)
        forward(parameters, sizes, activations, hidden, observation, output)
        return output

    return act


def _make(env_id: str, steps: int | None, options: Mapping[str, Any]) -> Any:
    """The environment, without the checks that a pure loop does not need."""
    import gymnasium

    limit = {} if steps is None else {"max_episode_steps": steps}
    try:
        if env_id not in gymnasium.registry and ":" not in env_id:
            _register_robotics()
        return gymnasium.make(env_id, disable_env_checker=True, **limit, **options)
    except (gymnasium.error.Error, ImportError, TypeError) as error:
        raise NichechainError(f"environment {env_id} cannot be made: {error}") from error


def _register_robotics() -> None:
    import gymnasium

    # On import it prints a notice about environments of another family.
    with contextlib.redirect_stderr(io.StringIO()), contextlib.suppress(ImportError):
        import gymnasium_robotics

        gymnasium.register_envs(gymnasium_robotics)


def _physics_failure(env: Any) -> str:
    """What MuJoCo found wrong, if the environment is one of its."""
    if not hasattr(getattr(env, "data", None), "warning"):
        return ""
    from nichechain.domains.engine.fetch import physics_failure

    return physics_failure(env.data)
