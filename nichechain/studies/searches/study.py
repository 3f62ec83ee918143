"""Which searches are compared: one configuration, several selections of parents, several seeds."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, replace
from typing import Any

from nichechain.core.checks import as_tuple, check_at_least, check_text, shown
from nichechain.core.errors import NichechainError
from nichechain.search.config import BuildConfig

REFERENCE = "uniform"
"""The selection that others are compared with."""


@dataclass(frozen=True)
class OneSearch:
    """One of the searches of a study.

    Parameters
    ----------
    selection : str
    run : int
    config : BuildConfig
        ``nichechain build`` with it makes the same births.
    """

    selection: str
    run: int
    config: BuildConfig

    @property
    def name(self) -> str:
        """Name of its files."""
        return f"{_slug(self.selection)}-{self.run:04d}"


@dataclass(frozen=True)
class SelectionStudy:
    """Searches that differ in how parents are selected.

    Parameters
    ----------
    config : BuildConfig
        What all searches share; run r has the seed ``config.seed + r`` whatever its selection, so that
        runs of one number begin with the same births.
    selections : tuple of str
        See :class:`nichechain.BuildConfig`; ``uniform`` is one of them.
    runs : int
        Searches with each, at least 2.
    elites, offspring : int
        So many elites that a search ends with are checked, on so many fresh offspring of each: how many
        niches they land in. With 0 elites none is.

    Raises
    ------
    NichechainError
        If a value is out of range, or uniform is missing.
    """

    config: BuildConfig
    selections: tuple[str, ...] = ("uniform", "curiosity", "reach")
    runs: int = 10
    elites: int = 20
    offspring: int = 20

    def __post_init__(self) -> None:
        check_at_least(2, runs=self.runs, offspring=self.offspring)
        check_at_least(0, elites=self.elites)
        if self.config.objective != "domain":
            raise NichechainError(
                f"objective is {shown(self.config.objective)}, "
                "but a study of selections compares searches that "
                "keep what the domain's objective or replacement says"
            )
        if isinstance(self.selections, str):
            raise NichechainError(
                f"selections is {shown(self.selections)}, but must be several, such as ('uniform', 'reach')"
            )
        object.__setattr__(self, "selections", as_tuple("selections", self.selections))
        check_text(**{f"selection {k}": name for k, name in enumerate(self.selections)})
        if REFERENCE not in self.selections:
            raise NichechainError(
                f"selections are {', '.join(map(str, self.selections))}, but must include {REFERENCE}, "
                "which the others are compared with"
            )
        for selection in self.selections:
            replace(self.config, selection=selection)
        slugs = [_slug(selection) for selection in self.selections]
        for selection, slug in zip(self.selections, slugs, strict=True):
            if slugs.count(slug) > 1:
                raise NichechainError(f"selection {selection!r} is given twice, but must be given once")

    @property
    def evaluations(self) -> int:
        """Rollouts in all."""
        each = self.config.evaluations + self.elites * self.offspring
        return self.runs * len(self.selections) * each

    def searches(self) -> list[OneSearch]:
        """All searches, in an order in which every selection has about as many runs at any time."""
        return [
            OneSearch(selection, run, replace(self.config, selection=selection, seed=self.config.seed + run))
            for run in range(self.runs)
            for selection in self.selections
        ]

    def to_json(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**asdict(self), "config": self.config.to_json()}

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> SelectionStudy:
        """The study that :meth:`to_json` wrote."""
        config = BuildConfig.from_json(values["config"])
        return cls(**{**values, "config": config, "selections": tuple(values["selections"])})


def _slug(selection: str) -> str:
    return re.sub(r"[^a-z0-9.]+", "-", selection)
