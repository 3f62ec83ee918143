"""A condition: one kind of walk, in plain values that a file and a table can hold."""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass, fields
from typing import get_args

from nichechain import variation
from nichechain.core.checks import check_at_least, check_choice, check_text, shown
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.studies.initialisation import check_scheme
from nichechain.studies.settings import MetricName, Mode, WalkSettings
from nichechain.variation import Mutation
from nichechain.variation.additive import parse_step_bound
from nichechain.walks import (
    BetterThanParent,
    Selection,
    Selective,
    TopFraction,
    Uniform,
    WalkConfig,
    diversity,
)
from nichechain.walks.diversity import ArchiveRule, Metric

# It names files, and stands in tables.
_LONGEST_LABEL = 100


@dataclass(frozen=True)
class Condition(WalkSettings):
    """One kind of walk.

    Parameters
    ----------
    label : str
        Name in tables and figures, unique within a study.
    level : str
        Evolutionary pressure: ``selective``, ``better`` (than the parent), a fraction such as
        ``0.25`` (the best quarter), or ``random``.
    metric : {"knn", "knn-no-archive", "parent", "ancestors", "kde", "evolvability"}
        Diversity G.
    offspring, mutation, ...
        As in :class:`WalkSettings`, by name.

    Raises
    ------
    NichechainError
        If a value is out of range.
    """

    label: str
    level: str = "selective"
    metric: MetricName = "knn"

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Of all values: what tells conditions apart first, then what they have in common."""
        return ("label", "level", "metric", *(field.name for field in fields(WalkSettings)))

    def __post_init__(self) -> None:
        check_choice("metric", self.metric, get_args(MetricName))
        check_choice("mode", self.mode, get_args(Mode))
        check_text(label=self.label)
        if not (self.slug and self.label.isprintable() and len(self.label) <= _LONGEST_LABEL):
            raise NichechainError(
                f"label is {shown(self.label)}, but must have a letter or a digit, and at most "
                f"{_LONGEST_LABEL} characters, all of them printable"
            )
        check_at_least(1, litter=self.litter)
        check_scheme(self.initialisation)
        # Those of other metrics are written with the study as well.
        diversity.KNearest(self.k)
        diversity.KernelDensity(self.bandwidth, self.mode, self.decay)
        self.walk_config(0)
        self.mutate()

    @property
    def slug(self) -> str:
        """The label as a name for files."""
        return re.sub(r"[^A-Za-z0-9.]+", "-", self.label).strip("-")

    def walk_config(self, seed: int) -> WalkConfig:
        """The kind of walk, its runs seeded by the study's seed and the condition's label."""
        return WalkConfig(
            selection=selection_of(self.level),
            metric=self._metric(),
            offspring=self.offspring,
            states=self.states,
            other_niche=self.other_niche,
            archive=ArchiveRule(limit=self.archive_limit, scope=self.archive_scope),
            seed=condition_seed(seed, self.label),
        )

    @property
    def width(self) -> int:
        """States of a walk at a time."""
        return self.states or 1

    def evaluations(self, steps: int) -> int:
        """Rollouts of a walk of so many steps, its start among them, if no candidate fails."""
        children = self.width * self.offspring
        judging = (self.width + children) * self.litter if self.metric == "evolvability" else 0
        return self.width + (steps + 1) * (children + judging)

    def mutate(self) -> Mutation:
        """The mutation operator."""
        bound = None
        if self.step_bound is not None:
            bound = variation.Bound(*parse_step_bound(self.step_bound))
        return variation.make(self.mutation, self.scale, bound=bound)

    def _metric(self) -> Metric:
        if self.metric in ("knn", "knn-no-archive"):
            return diversity.KNearest(self.k, archive=self.metric == "knn")
        if self.metric == "kde":
            return diversity.KernelDensity(self.bandwidth, self.mode, self.decay)
        if self.metric == "evolvability":
            return diversity.OffspringNiches(self.litter)
        return diversity.make(self.metric)


def selection_of(level: str) -> Selection:
    """The selection of a level of evolutionary pressure.

    Raises
    ------
    NichechainError
        If there is no such level.
    """
    named: dict[str, Selection] = {
        "selective": Selective(),
        "better": BetterThanParent(),
        "random": Uniform(),
    }
    if isinstance(level, str) and level in named:
        return named[level]
    try:
        return TopFraction(float(level))
    except (OverflowError, TypeError, ValueError):
        raise NichechainError(
            f"level is {shown(level)}, "
            "but must be selective, better, random, or a fraction above 0 and at most 1"
        ) from None


def pressure_of(level: str) -> float:
    """Share of the offspring that a level lets pass, 0 for the selective walk and 1 for the random.

    Raises
    ------
    NichechainError
        If the level is ``better``, which lets pass a share that changes, or is none.
    """
    rule = selection_of(level)
    match rule:
        case Selective():
            return 0.0
        case Uniform():
            return 1.0
        case TopFraction():
            return rule.fraction
    raise NichechainError(f"level is {shown(level)}, which lets no fixed share of the offspring pass")


def condition_seed(seed: int, label: str) -> int:
    """Seed of a condition's runs: it depends on its label, not on the conditions beside it."""
    check_text(label=label)
    number = zlib.crc32(label.encode("utf-8", "surrogatepass"))
    return int(keyed(seed, Purpose.CONDITION, number).integers(2**63))
