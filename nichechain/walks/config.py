"""What kind of walk, and the seeds of its runs."""

from __future__ import annotations

from dataclasses import dataclass, field

from nichechain.core.checks import check_at_least, check_seed, check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.walks.diversity import ArchiveRule, KNearest, Metric
from nichechain.walks.selection import Selection, Selective


@dataclass(frozen=True)
class WalkConfig:
    """What kind of walk.

    Parameters
    ----------
    selection : Selection
        Who may follow: :class:`Selective`, :class:`TopFraction`, :class:`AtLeast`,
        :class:`BetterThanParent` or :class:`Uniform`.
    metric : Metric
        Diversity G.
    offspring : int
        Children of each state in each step, at least 1.
    states : int, optional
        Number μ of states of a multi-state walk. The μ that follow are drawn from states and
        children together, (μ + λ), which are also the population that a metric compares with. By
        default a single-state walk, which is followed by one of its children.
    other_niche : bool
        The niche variant: only a child in another niche than its parent may follow. The outside
        state counts as another niche, unless niches absorb what leaves them.
    archive : ArchiveRule
        What the novelty archive remembers.
    seed : int
        Seed of all runs, not negative.

    Raises
    ------
    NichechainError
        If a number is out of range.
    """

    selection: Selection = field(default_factory=Selective)
    metric: Metric = field(default_factory=KNearest)
    offspring: int = 30
    states: int | None = None
    other_niche: bool = False
    archive: ArchiveRule = field(default_factory=ArchiveRule)
    seed: int = 0

    def __post_init__(self) -> None:
        check_at_least(1, offspring=self.offspring)
        if self.states is not None:
            check_at_least(1, states=self.states)
        check_seed(self.seed)

    @property
    def width(self) -> int:
        """States of a walk at a time, μ."""
        return 1 if self.states is None else self.states


def run_seed(seed: int, run: int) -> int:
    """Seed of one run of a configuration: with it, run and uid, any birth of a walk can be replayed."""
    check_whole(run=run)
    if run < 0:
        raise NichechainError(f"run is {run}, but runs are numbered from 0")
    return int(keyed(seed, Purpose.RUN, run).integers(2**63))
