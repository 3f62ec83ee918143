"""How much physics a build was spared, in a small file beside its archive.

It depends on how many workers there were, and on interruptions, which nothing that an archive holds
does. So it is no part of what is committed, and reading an archive does without it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from nichechain.core.files import write_atomically
from nichechain.domains.base import Evaluation

FILE = "physics.json"


@dataclass(frozen=True)
class Savings:
    """Steps of episodes, and those that were not computed.

    Parameters
    ----------
    steps : int
        Steps of all episodes whose domain keeps count.
    known : int
        Steps among them that were known from earlier episodes.
    """

    steps: int = 0
    known: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.known <= self.steps:
            raise ValueError(f"{self.known} of {self.steps} steps cannot have been known")

    def and_of(self, evaluation: Evaluation) -> Savings:
        """With the episodes of an evaluation."""
        return Savings(self.steps + evaluation.steps, self.known + evaluation.known)


def read(folder: Path) -> Savings:
    """What is known of the archive in a folder: nothing, where the file is absent or damaged."""
    try:
        found = json.loads((folder / FILE).read_bytes())
        return Savings(int(found["steps"]), int(found["known"]))
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        return Savings()


def write(folder: Path, savings: Savings) -> None:
    """Replace what is known, if anything is.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    if savings.steps:
        write_atomically(folder / FILE, json.dumps(asdict(savings)).encode())
