"""When too many births fail, it is not the births."""

from __future__ import annotations

from collections import Counter

import pyarrow as pa

from nichechain.core.checks import check_numbers
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain
from nichechain.execution import WORKER_DIED
from nichechain.search.config import MOST_FAILED

FEWEST_BIRTHS = 100
"""Births from which on the share that failed says something."""


class Failures:
    """Counts the births of a run that failed, and stops it when they are too many.

    Parameters
    ----------
    most : float
        Share of births that may fail, from 0 to 1; 1 lets a run go on whatever happens.

    Attributes
    ----------
    births, failed : int

    Raises
    ------
    NichechainError
        If the share is out of range.
    """

    def __init__(self, most: float = MOST_FAILED) -> None:
        check_numbers(max_failed=most)
        if not 0 <= most <= 1:
            raise NichechainError(f"max_failed is {most}, but must be a share of births, from 0 to 1")
        self._most = most
        self._reasons: Counter[str] = Counter()
        self.births = 0

    @property
    def failed(self) -> int:
        """How many failed."""
        return self._reasons.total()

    def count(self, rows: pa.Table) -> None:
        """Take births, in the columns of :mod:`nichechain.births.table`, into account."""
        self.births += len(rows)
        reasons = rows["failed"]
        if reasons.null_count < len(reasons):
            self._reasons.update(reasons.drop_null().to_pylist())

    def check(self, where: str) -> None:
        """Stop a run of which too much has failed.

        Parameters
        ----------
        where : str
            What is left of it, and how it goes on, for the end of the message.

        Raises
        ------
        NichechainError
            If more than the share of at least ``FEWEST_BIRTHS`` failed.
        """
        if self.births >= FEWEST_BIRTHS and self.failed > self._most * self.births:
            reason, times = self._reasons.most_common(1)[0]
            raise NichechainError(
                f"{self.failed} of {self.births} births failed, more than the share of {self._most:g} that "
                f"may, {times} of them because: {reason}; {where}"
            )


def check_first_batch(rows: pa.Table, domain: Domain, seed: int) -> None:
    """Stop a run none of whose first births could be evaluated: it is the domain that is wrong.

    Parameters
    ----------
    rows : pyarrow.Table
        The first births.
    domain : Domain
    seed : int
        Seed of the run.

    Raises
    ------
    NichechainError
        If all of them failed; from what the domain raised, if it did.
    """
    if rows["failed"].null_count:
        return
    reason = rows["failed"][0].as_py()
    cause = None
    if reason != WORKER_DIED:
        try:
            domain.evaluate(domain.sample(1, seed=keyed(seed, Purpose.INITIAL)))
        except Exception as error:
            # Where in the domain it was raised is what its author wants to know.
            cause = error
    raise NichechainError(
        f"all {len(rows)} births of the first batch failed, the first because: {reason}"
    ) from cause
