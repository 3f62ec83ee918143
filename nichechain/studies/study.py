"""Studies: conditions that are compared, and the ready ones of the paper and around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from typing import Any, Literal, get_args

from nichechain import domains
from nichechain.core.checks import (
    DomainOption,
    as_tuple,
    check_at_least,
    check_choice,
    check_fits,
    check_text,
    plain_options,
    shown,
)
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Domain
from nichechain.niches import GridNiches
from nichechain.studies.conditions import Condition, pressure_of

Kind = Literal["pressure", "metrics", "sensitivity", "population"]

# Walks of each condition: their numbers are listed before the first one is walked.
_MOST_RUNS = 1_000_000
LEVELS = ("selective", "0.1", "0.25", "0.5", "0.75", "random")
"""Levels of evolutionary pressure that are compared, the strongest first."""
POPULATION_METRICS, POPULATION_SIZE = ("kde", "knn"), 10
METRICS = ("kde", "knn", "knn-no-archive", "ancestors", "parent")
"""Diversity metrics that are compared: the paper's four, and the distance to the parent."""

VARIATIONS: dict[str, dict[str, Sequence[Any]]] = {
    "scale": {"scale": (0.01, 0.1, 1.0)},
    "bandwidth-mode": {"mode": ("factor", "length")},
    "decay": {"decay": (1.0, 0.9, 0.5)},
    "k": {"k": (1, 5, 15, 30)},
    "offspring": {"offspring": (10, 30, 100)},
    "initialisation": {
        "initialisation": (
            "domain",
            "domain:0.3",
            "domain:3",
            "xavier-uniform",
            "kaiming-normal",
            "kaiming-uniform",
            "orthogonal",
        )
    },
}
"""What the paper leaves open, and the values worth comparing; the paper's own, as we read it, among them."""
_KDE = ("bandwidth-mode", "decay")


@dataclass(frozen=True)
class Study:
    """Conditions that are compared, and how long and how often each is walked.

    Parameters
    ----------
    kind : {"pressure", "metrics", "sensitivity", "population"}
        What is compared, which decides the statistics.
    domain : str
        Name of the domain.
    conditions : tuple of Condition
    runs : int
        Walks of each condition, at least 1.
    steps : int
        T, not negative: every walk has T + 1 states, each measured by its offspring.
    shape : tuple of int
        Cells of the grid that coverage is measured on.
    bounds : tuple of (float, float)
        Its bounds, in units of behavior.
    domain_seed : int
        Seed of what the domain holds fixed.
    domain_options : mapping of str to str, int, float or bool
        What the domain is told besides, see :func:`nichechain.domains.make`.
    seed : int
        Seed of the study.
    paired : bool
        Whether run r of every condition starts from the same genotype. By default starts are
        independent, as the Kruskal-Wallis test assumes.

    Raises
    ------
    NichechainError
        If a value is out of range or two conditions have one label.
    """

    kind: Kind
    domain: str
    conditions: tuple[Condition, ...]
    runs: int
    steps: int
    shape: tuple[int, ...]
    bounds: tuple[tuple[float, float], ...]
    domain_seed: int = 0
    seed: int = 0
    paired: bool = False
    domain_options: Mapping[str, DomainOption] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, get_args(Kind))
        check_text(domain=self.domain)
        check_at_least(1, runs=self.runs)
        check_at_least(0, steps=self.steps, seed=self.seed, domain_seed=self.domain_seed)
        if self.runs > _MOST_RUNS:
            raise NichechainError(f"runs is {self.runs}, but must be at most {_MOST_RUNS}")
        check_fits(steps=self.steps)
        object.__setattr__(self, "conditions", as_tuple("conditions", self.conditions))
        for condition in self.conditions:
            if not isinstance(condition, Condition):
                raise NichechainError(f"conditions has {shown(condition)}, but must have Conditions")
        slugs = [condition.slug for condition in self.conditions]
        if not slugs:
            raise NichechainError("a study needs at least 1 condition, but has none")
        for condition in self.conditions:
            if slugs.count(condition.slug) > 1:
                raise NichechainError(f"condition {condition.label!r} is given twice, but labels must differ")
        if self.kind == "pressure":
            for condition in self.conditions:
                pressure_of(condition.level)
        if self.kind == "population":
            for one in self.conditions:
                if one.width < 2:
                    raise NichechainError(
                        f"condition {one.label!r} has states {one.states}, but must have at least 2"
                    )
        GridNiches(self.shape, self.bounds)
        object.__setattr__(self, "domain_options", plain_options(self.domain_options))

    @property
    def evaluations(self) -> int:
        """Rollouts in all, the starts among them."""
        return sum(self.runs * c.evaluations(self.steps) for c in self.conditions)

    def make_domain(self) -> Domain:
        """The domain that is walked on.

        Raises
        ------
        NichechainError
            If it is unknown or does not know an option.
        """
        return domains.make(self.domain, seed=self.domain_seed, **self.domain_options)

    def condition(self, label: str) -> Condition:
        """The condition of that label."""
        return next(c for c in self.conditions if c.label == label)

    def to_json(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Study:
        """The study that :meth:`to_json` wrote.

        Raises
        ------
        NichechainError
            If a value is unknown, or one is missing that has no default.
        """
        conditions = tuple(_read(Condition, condition) for condition in values.get("conditions", ()))
        shape = tuple(values.get("shape", ()))
        bounds = tuple((low, high) for low, high in values.get("bounds", ()))
        study: Study = _read(cls, {**values, "conditions": conditions, "shape": shape, "bounds": bounds})
        return study


def pressure_conditions(levels: Sequence[str], base: Condition) -> tuple[Condition, ...]:
    """One condition for each level of pressure, alike in all else ("Evolutionary pressure")."""
    return tuple(replace(base, label=level, level=level) for level in as_tuple("levels", levels))


def metric_conditions(metrics: Sequence[str], base: Condition) -> tuple[Condition, ...]:
    """One condition for each diversity metric, alike in all else ("Diversity metrics")."""
    return tuple(replace(base, label=name, metric=name) for name in as_tuple("metrics", metrics))  # type: ignore[arg-type]


def variations(name: str, base: Condition) -> tuple[Condition, ...]:
    """The conditions of a sensitivity study.

    Parameters
    ----------
    name : str
        One of :data:`VARIATIONS`; ``bandwidth-mode`` and ``decay`` use the KDE metric.
    base : Condition
        All that is not varied.

    Raises
    ------
    NichechainError
        If there is no such study.
    """
    check_choice("study", name, VARIATIONS)
    if name in _KDE:
        base = replace(base, metric="kde")
    ((varied, values),) = VARIATIONS[name].items()
    return tuple(replace(base, label=f"{varied} {value}", **{varied: value}) for value in values)


def _read(kind: Any, values: dict[str, Any]) -> Any:
    names = {field.name for field in fields(kind)}
    needed = {f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING}
    odd = (set(values) - names) | (needed - set(values))
    if odd:
        raise NichechainError(f"the study has missing or unknown values: {', '.join(sorted(odd))}")
    return kind(**values)
