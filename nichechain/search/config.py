"""What a build is asked to do: one dataclass, which is its command line and stays with its result."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import KW_ONLY, MISSING, Field, asdict, dataclass, field, fields
from typing import Any, Literal, cast, get_args

from nichechain.core.checks import (
    EPSILON,
    DomainOption,
    StepBound,
    as_bounds,
    as_shape,
    as_tuple,
    check_at_least,
    check_choice,
    check_lineages,
    check_numbers,
    check_positive,
    check_text,
    plain_options,
    shown,
)
from nichechain.core.errors import NichechainError

Replacement = Literal["random", "first", "newest", "objective"]
Outside = Literal["state", "absorb", "clip"]
NichesKind = Literal["grid", "cvt"]
MutationName = Literal["cauchy", "gaussian", "student-t", "uniform-ball"]
SelectionName = Literal["uniform", "curiosity", "reach", "l-evolvability", "information"]
ObjectiveName = Literal["domain", "l-evolvability"]

_MIXTURE = "'reach:0.7,uniform:0.3'"

WHO_IS_ELITE: dict[str, str] = {
    "random": "a random birth",
    "first": "the first birth",
    "newest": "the last birth",
    "objective": "the best birth",
}
"""Which birth of a niche is its elite, by the rule of replacement."""

MOST_FAILED = 0.5
"""Share of births that may fail before a run is stopped, unless told otherwise."""

# Children of a step are drawn and grown at once.
_MOST_AT_ONCE = 2**24

BROOD = 10
"""Lineages that begin at the same elite, unless told otherwise."""


@dataclass(frozen=True, repr=False)
class SearchConfig:
    """What a MAP-Elites search does, whatever its niches are: options of ``nichechain build`` as they stand.

    Parameters
    ----------
    domain : str
        Name of the domain.
    evaluations : int
        Births in total, the initial ones among them.
    niches_seed : int
        Seed of a tessellation; runs that are to be merged share it.
    initial : int
        Births without a parent.
    batch : int
        Children of a step; their parents are drawn from the elites before it.
    mutation : {"cauchy", "gaussian", "student-t", "uniform-ball"}
        Mutation operator, on every weight.
    scale : float
        Scale of the mutation.
    df : float, optional
        Degrees of freedom of student-t, by default 3.
    step_bound : ({"per-coordinate", "rescaled"}, float), optional
        How far a child can be from its parent, which makes N(θ) a bounded set: per-coordinate
        truncates the noise on every weight, rescaled shortens a step that is longer.
    layer_scales : tuple of float
        Factor on the scale in each layer of the controller, such as 1, 0.5, 0.5; by default all
        weights are alike.
    self_adaptive : bool
        Step sizes are genes, which mutate too and are used before the weights: one per layer that
        has a layer scale, or else one for all weights. They begin at the scale.
    selection : str
        How parents are drawn from the elites: ``uniform``, each alike; ``curiosity``, whose children
        enter; as the chain of the births so far foretells (:mod:`nichechain.steering`), ``reach``, whose
        descendants would fill niches, ``l-evolvability``, whose descendants would visit many niches, and
        ``information``, where a birth tells most of l-evolvability; or a mixture such as
        ``reach:0.7,uniform:0.3``.
    temperature : float, optional
        Elites are drawn in proportion to w^(1/temperature), for w what the selection says of each;
        by default 1, and 0.3 for a selection that asks the chain.
    selection_l : int, optional
        Generations of the lineages that a selection asks the chain about, by default 1 for ``reach`` and
        5 for the others.
    selection_lineages : int, optional
        How many lineages it asks about, by default 1 for ``reach`` and 100 for the others.
    lineage_share : float
        Share of the births that unselected lineages get, whose parents are their own latest births:
        they show what lineages do. With 0 all parents are selected.
    lineage_length : int
        Births of such a lineage, at least 2: the first is the child of an elite.
    lineage_brood : int
        Lineages that begin at the same elite: they show how much those of one elite have in common.
        With 1 each begins at an elite of its own.
    replacement : {"random", "first", "newest", "objective"}
        Which birth of a niche is its elite: each alike, the first, the last, or the best.
    objective : {"domain", "l-evolvability"}
        What is best: the domain's own objective, or the l-evolvability of the genotype, from offspring
        that it gets for that, see :mod:`nichechain.search.contests`. The latter needs ``objective`` as
        replacement.
    offspring : int
        Children that a genotype must have had before its l-evolvability is compared. The births that it
        takes are births of the search.
    objective_l : int
        Generations of the lineages that l-evolvability counts. With 1 it is measured by children alone;
        with more, lineages go on from there as the chain of the births so far says.
    objective_lineages : int, optional
        How many lineages, by default ``offspring``, and at most that.
    outside : {"state", "absorb", "clip"}
        Where a behavior out of bounds belongs: a state of its own, one never left, or the nearest
        niche.
    seed : int
        Seed of the run.
    domain_seed : int
        Seed of what the domain holds fixed (fetch: where block and target begin).
    """

    domain: str
    _: KW_ONLY
    evaluations: int = 8000
    niches_seed: int = 0
    initial: int = 100
    batch: int = 64
    mutation: MutationName = "cauchy"
    scale: float = 1.0
    df: float | None = None
    step_bound: tuple[StepBound, float] | None = None
    layer_scales: tuple[float, ...] = ()
    self_adaptive: bool = False
    selection: str = "uniform"
    temperature: float | None = None
    selection_l: int | None = None
    selection_lineages: int | None = None
    lineage_share: float = 0.05
    lineage_length: int = 10
    lineage_brood: int = BROOD
    replacement: Replacement = "random"
    objective: ObjectiveName = "domain"
    offspring: int = 10
    objective_l: int = 1
    objective_lineages: int | None = None
    outside: Outside = "state"
    seed: int = 0
    domain_seed: int = 0

    def __repr__(self) -> str:
        # What is as always would hide what is not.
        told = (f"{field.name}={getattr(self, field.name)!r}" for field in fields(self) if self._says(field))
        return f"{type(self).__name__}({', '.join(told)})"

    def _says(self, field: Field[Any]) -> bool:
        """Whether a value is needed, or is not the usual one."""
        if field.default is field.default_factory is MISSING:
            return True
        usual = field.default if field.default_factory is MISSING else field.default_factory()
        return bool(getattr(self, field.name) != usual)

    def settings(self) -> dict[str, Any]:
        """These values by their names, without what a subclass adds."""
        return {field.name: getattr(self, field.name) for field in fields(SearchConfig)}


@dataclass(frozen=True, repr=False)
class BuildConfig(SearchConfig):
    """A MAP-Elites build ("Variation operator"; step 3 of the estimation of l-evolvability).

    Parameters
    ----------
    domain, evaluations, ...
        As in :class:`SearchConfig`; all but ``domain`` by name.
    shape : tuple of int
        Cells of the grid along each axis of behavior; of a tessellation, its one number of niches.
    bounds : tuple of (float, float)
        Bounds of the niches along each axis, in units of behavior.
    niches : {"grid", "cvt"}
        Equal cells, or a Voronoi tessellation, see :class:`nichechain.niches.CVTNiches`.
    epsilon : float
        Of a grid, see :class:`nichechain.niches.GridNiches`.
    domain_options : mapping of str to str, int, float or bool
        What else :func:`nichechain.domains.make` is told of the domain.

    Raises
    ------
    NichechainError
        If a value is out of range.
    """

    shape: tuple[int, ...]
    bounds: tuple[tuple[float, float], ...]
    _: KW_ONLY
    niches: NichesKind = "grid"
    epsilon: float = EPSILON
    domain_options: Mapping[str, DomainOption] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        if not isinstance(self.domain, str):
            raise NichechainError(f"domain is {shown(self.domain)}, but must be the name of a domain")
        check_text(mutation=self.mutation, outside=self.outside)
        if not isinstance(self.self_adaptive, bool):
            raise NichechainError(f"self_adaptive is {shown(self.self_adaptive)}, but must be True or False")
        asked = [
            name
            for name in ("selection_l", "selection_lineages", "objective_lineages")
            if getattr(self, name) is not None
        ]
        whole = (
            *("evaluations", "initial", "batch", "seed", "domain_seed", "niches_seed"),
            *("lineage_length", "lineage_brood", "offspring", "objective_l", *asked),
        )
        for name in whole:
            try:
                # Numbers of NumPy become plain ones, which JSON can hold.
                object.__setattr__(self, name, operator.index(getattr(self, name)))
            except TypeError:
                raise NichechainError(
                    f"{name} is {shown(getattr(self, name))}, but must be a whole number"
                ) from None
        object.__setattr__(self, "shape", as_shape(self.shape))
        object.__setattr__(self, "bounds", as_bounds(self.bounds))
        check_numbers(scale=self.scale)
        object.__setattr__(self, "scale", float(self.scale))
        object.__setattr__(self, "domain_options", plain_options(self.domain_options))
        scales = as_tuple("layer_scales", self.layer_scales)
        for scale in scales:
            check_numbers(layer_scale=scale)
        object.__setattr__(self, "layer_scales", tuple(float(scale) for scale in scales))
        if self.df is not None:
            check_numbers(df=self.df)
            object.__setattr__(self, "df", float(self.df))
        if self.step_bound is not None:
            if not isinstance(self.step_bound, (tuple, list)) or len(self.step_bound) != 2:
                raise NichechainError(
                    f"step_bound is {shown(self.step_bound)}, "
                    "but must be a kind and a size, as ('rescaled', 2.0)"
                )
            kind, size = self.step_bound
            check_numbers(step_bound=size)
            object.__setattr__(self, "step_bound", (kind, float(size)))
        check_at_least(1, evaluations=self.evaluations, initial=self.initial, batch=self.batch)
        for name in ("initial", "batch"):
            if getattr(self, name) > _MOST_AT_ONCE:
                raise NichechainError(
                    f"{name} is {getattr(self, name)}, but must be at most {_MOST_AT_ONCE}: "
                    "the children of a step are made at once"
                )
        check_at_least(0, seed=self.seed, domain_seed=self.domain_seed, niches_seed=self.niches_seed)
        check_numbers(lineage_share=self.lineage_share)
        object.__setattr__(self, "lineage_share", float(self.lineage_share))
        if not 0 <= self.lineage_share < 1:
            raise NichechainError(
                f"lineage_share is {self.lineage_share:g}, but must be a share of births, from 0 to below 1"
            )
        check_at_least(2, lineage_length=self.lineage_length)
        check_at_least(1, lineage_brood=self.lineage_brood)
        check_choice("replacement", self.replacement, get_args(Replacement))
        self._check_objective()
        check_choice("niches", self.niches, get_args(NichesKind))
        if self.niches == "cvt" and len(self.shape) != 1:
            raise NichechainError(
                f"shape is {self.shape}, but a tessellation has one number of niches, such as (400,)"
            )
        parse_selection(self.selection)
        check_at_least(1, **{name: getattr(self, name) for name in asked})
        if self.temperature is not None:
            check_positive(temperature=self.temperature)
            object.__setattr__(self, "temperature", float(self.temperature))

    def _check_objective(self) -> None:
        check_choice("objective", self.objective, get_args(ObjectiveName))
        check_at_least(1, offspring=self.offspring, objective_l=self.objective_l)
        check_lineages(self.offspring, objective_lineages=self.objective_lineages)
        if self.objective != "domain" and self.replacement != "objective":
            raise NichechainError(
                f"objective is {shown(self.objective)}, so replacement must be 'objective', "
                "but replacement is "
                f"{self.replacement!r}"
            )

    def _repr_html_(self) -> str:
        from nichechain.core.notebook import facts_table

        return facts_table(
            "BuildConfig", {each.name: getattr(self, each.name) for each in fields(self) if self._says(each)}
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values for JSON; as before grids had an epsilon, where it is the usual one."""
        values = asdict(self)
        if self.epsilon == EPSILON:
            del values["epsilon"]
        return values

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> BuildConfig:
        """The configuration that :meth:`to_json` wrote, now or in an earlier version.

        Raises
        ------
        NichechainError
            If a value is unknown, or one is missing that has no default.
        """
        names = {field.name for field in fields(cls)}
        needed = {field.name for field in fields(cls) if field.default is field.default_factory is MISSING}
        odd = (set(values) - names) | (needed - set(values))
        if odd:
            raise NichechainError(
                f"the configuration has missing or unknown values: {', '.join(sorted(odd))}"
            )
        # Before there were lineages, builds had none, and before there were broods, each began alone.
        return cls(**{"lineage_share": 0.0, "lineage_brood": 1, **values})


def parse_selection(text: str) -> tuple[tuple[SelectionName, float], ...]:
    """Names of selections and their shares: of ``reach``, or of a mixture ``reach:0.7,uniform:0.3``.

    Raises
    ------
    NichechainError
        If a name is unknown or comes twice, or the shares are no shares that sum to 1.
    """
    if not isinstance(text, str):
        raise NichechainError(f"selection is {shown(text)}, but must be a name, or a mixture as {_MIXTURE}")
    parts = [part.strip().partition(":") for part in text.split(",")]
    for name, _, _ in parts:
        check_choice("selection", name, get_args(SelectionName))
    if len(parts) == 1 and not parts[0][1]:
        return ((cast(SelectionName, parts[0][0]), 1.0),)
    names = [name for name, _, _ in parts]
    shares = []
    for name, _, share in parts:
        try:
            shares.append(float(share))
        except ValueError:
            raise NichechainError(
                f"selection is {shown(text)}, but the share of {name} must be a number, as in {_MIXTURE}"
            ) from None
    if len(set(names)) < len(names):
        raise NichechainError(f"selection is {shown(text)}, but must name each of its parts once")
    if not all(share > 0 for share in shares) or abs(sum(shares) - 1.0) > 1e-9:
        raise NichechainError(
            f"selection is {shown(text)}, but its shares must be above 0 and sum to 1, as in {_MIXTURE}"
        )
    return tuple((cast(SelectionName, name), share) for name, share in zip(names, shares, strict=True))
