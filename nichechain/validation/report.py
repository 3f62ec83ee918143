"""All checks of an archive's chain together."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nichechain.archive.archive import Archive
from nichechain.core.checks import check_at_least, check_whole
from nichechain.core.duration import warn_if_long
from nichechain.core.errors import NichechainError
from nichechain.evolvability.question import Question
from nichechain.execution import Executor
from nichechain.validation import chapman_kolmogorov
from nichechain.validation.direct import DirectCheck, compare
from nichechain.validation.lineages import Triples
from nichechain.validation.markov import (
    PERMUTATIONS,
    MarkovTest,
    check_permutations,
    homogeneity_test,
    lineage_test,
    sibling_test,
)
from nichechain.validation.rollouts import OFFSPRING, OnDone, run_lineages, sample_roots

if TYPE_CHECKING:
    import pandas as pd

# Births that are permuted in a second, on average over the tests.
_PERMUTED_A_SECOND = 3e6


@dataclass(frozen=True)
class ValidationConfig:
    """What a validation is asked to do.

    Parameters
    ----------
    elites : int
        Elites to run lineages from, at least 3.
    lineages : int
        Lineages U of each.
    l : int
        Generations.
    offspring : int
        Further children of each elite, that predictions from its genotype begin with.
    permutations : int
        Of each test.
    seed : int
    """

    elites: int = 24
    lineages: int = 20
    l: int = 5
    offspring: int = OFFSPRING
    permutations: int = PERMUTATIONS
    seed: int = 0

    def __post_init__(self) -> None:
        Question(self.l, self.lineages, seed=self.seed)
        check_whole(elites=self.elites)
        check_at_least(1, offspring=self.offspring)
        if self.elites < 3:
            raise NichechainError(f"elites is {self.elites}, but a rank correlation needs at least 3")
        check_permutations(self.permutations)
        for name in ("elites", "lineages", "l", "offspring", "permutations", "seed"):
            # Short numbers of NumPy would overflow in what is computed with them.
            object.__setattr__(self, name, int(getattr(self, name)))

    @property
    def evaluations(self) -> int:
        """Genotypes to evaluate, unless a lineage ends before its time."""
        return self.elites * (self.lineages * self.l + self.offspring)

    @property
    def permuted(self) -> int:
        """Permutations of all tests, unless there is nothing to permute."""
        return (4 + (self.l > 1)) * self.permutations


@dataclass(frozen=True)
class Validation:
    """What came of the checks.

    Parameters
    ----------
    config : ValidationConfig
    births : int
        Births of the archive.
    tests : tuple of MarkovTest
    direct : DirectCheck
    """

    config: ValidationConfig
    births: int
    tests: tuple[MarkovTest, ...]
    direct: DirectCheck

    def to_json(self) -> dict[str, Any]:
        """Plain values for JSON; what is undefined is None."""
        return {
            "configuration": asdict(self.config),
            "births": self.births,
            "estimator": self.direct.estimator,
            "convention": "definition",
            "tests": [{**asdict(test), "ratio": _finite(test.ratio)} for test in self.tests],
            "direct": {
                "evaluations": int(self.direct.lineages.states.size + self.direct.lineages.offspring.size),
                "lineages_failed": self.direct.lineages.failed,
                "summary": _records(self.direct.summary()),
                "elites": _records(self.direct.to_frame()),
            },
        }


def validate(
    archive: Archive,
    executor: Executor,
    config: ValidationConfig | None = None,
    *,
    keep: Path | None = None,
    on_done: OnDone | None = None,
    on_permuted: OnDone | None = None,
    on_drawn: OnDone | None = None,
) -> Validation:
    """Test whether births are a chain's, and check the chain's predictions on real lineages.

    Parameters
    ----------
    archive : Archive
    executor : Executor
        Where lineages are evaluated.
    config : ValidationConfig, optional
    keep : Path, optional
        A file to keep lineages in, should they be interrupted; see
        :func:`~nichechain.validation.run_lineages`.
    on_done : callable, optional
        Told how many more genotypes have been evaluated, or were kept.
    on_permuted, on_drawn : callable, optional
        Told how many more permutations, and draws of T, are done.

    Returns
    -------
    Validation

    Raises
    ------
    NichechainError
        If fewer than 3 niches have births enough.
    """
    config = config or ValidationConfig()
    warn_if_long(
        config.permuted * archive.meta.births / _PERMUTED_A_SECOND,
        f"of {archive.meta.births} births, fewer permutations take less",
    )
    chain = archive.chain()
    roots = sample_roots(
        chain,
        archive.elites.niche,
        config.elites,
        l=config.l,
        lineages=config.lineages,
        seed=config.seed,
    )
    lineages = run_lineages(
        archive,
        roots,
        executor,
        l=config.l,
        lineages=config.lineages,
        offspring=config.offspring,
        seed=config.seed,
        keep=keep,
        on_done=on_done,
    )
    triples = Triples.from_births(archive.births())
    tests = [
        test(triples, permutations=config.permutations, seed=config.seed, on_done=on_permuted)
        for test in (lineage_test, homogeneity_test, sibling_test, chapman_kolmogorov.births_test)
    ]
    if config.l > 1:
        tests += chapman_kolmogorov.lineages_test(
            lineages.walks, permutations=config.permutations, seed=config.seed, on_done=on_permuted
        )
    direct = compare(chain, lineages, archive.niches, seed=config.seed, on_done=on_drawn)
    return Validation(config, archive.meta.births, tuple(tests), direct)


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    records: list[dict[str, Any]] = json.loads(frame.to_json(orient="records", double_precision=10))
    return records


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
