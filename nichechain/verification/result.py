"""What a verification found, and what may have caused it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

FIRST = 5
"""How many uids of mismatches are named."""

NOTHING: tuple[str, ...] = ()
"""What a check of the record alone depends on."""
SEARCH = ("nichechain", "numpy", "ribs")
"""What decides who is a parent and who is kept."""
_MACHINE = ("machine", "system", "libc", "simd", "libm", "numpy_math")
GENOTYPES = ("nichechain", "numpy", "torch", *_MACHINE)
"""What decides a genotype, given its ancestry."""
EVALUATION = (
    "nichechain",
    "python",
    "numpy",
    "numba",
    "torch",
    "mujoco",
    "gymnasium",
    "gymnasium-robotics",
    *_MACHINE,
)
"""What decides what becomes of a genotype."""

_KINDS = {
    "machine": "other kind of CPU",
    "simd": "other kind of CPU",
    "system": "other system",
    "libc": "other C library",
    "libm": "other bits from functions of the C library, which picks them by CPU",
    "numpy_math": "other bits from functions of NumPy, which picks them by CPU",
}


@dataclass(frozen=True)
class Difference:
    """Something that was one way when the archive was made, and is another now.

    Parameters
    ----------
    name : str
        A library, or a trait of the machine.
    recorded, present : str
    """

    name: str
    recorded: str
    present: str

    def __str__(self) -> str:
        kind = _KINDS.get(self.name, "other version")
        return f"{kind}: {self.name} was {self.recorded}, here it is {self.present}"


@dataclass(frozen=True)
class Check:
    """One thing that was compared.

    Parameters
    ----------
    name : str
        What holds if nothing mismatches.
    group : {"record", "search", "genotypes", "elites evaluated", "births evaluated", "domain"}
    checked, mismatches : int
        How many were compared, and how many of them differ.
    uids : tuple of int
        The first few births that differ.
    difference : float, optional
        The largest absolute difference, where what is compared are numbers and some differ.
    depends_on : tuple of str
        Libraries and traits of the machine that can make it fail without anything being wrong.
    """

    name: str
    group: str
    checked: int
    mismatches: int
    uids: tuple[int, ...] = ()
    difference: float | None = None
    depends_on: tuple[str, ...] = NOTHING

    @classmethod
    def of(
        cls,
        name: str,
        group: str,
        differs: ArrayLike,
        uids: ArrayLike,
        *,
        difference: float | None = None,
        depends_on: tuple[str, ...] = NOTHING,
    ) -> Check:
        """The check that found which of the births with those uids differ."""
        odd = np.asarray(differs, bool)
        named = np.asarray(uids)[odd][:FIRST]
        return cls(
            name,
            group,
            odd.size,
            int(np.count_nonzero(odd)),
            tuple(int(uid) for uid in named),
            difference if odd.any() else None,
            depends_on,
        )


@dataclass(frozen=True)
class Verification:
    """What became of verifying an archive.

    Parameters
    ----------
    folder : str
    births, elites : int
        What the archive has.
    sampled_births, sampled_elites : int
        Evaluated again.
    seed : int
        Seed of the choice of both.
    checks : tuple of Check
    unverified : tuple of str
        What could not be checked, and why.
    differences : tuple of Difference
        Between what the archive records of libraries and machine, and here.
    machine_recorded : bool
        Whether the archive records on what kind of machine it was made.
    """

    folder: str
    births: int
    elites: int
    sampled_births: int
    sampled_elites: int
    seed: int
    checks: tuple[Check, ...]
    unverified: tuple[str, ...]
    differences: tuple[Difference, ...]
    machine_recorded: bool

    @property
    def mismatched(self) -> tuple[Check, ...]:
        """Checks with a mismatch."""
        return tuple(check for check in self.checks if check.mismatches)

    @property
    def ok(self) -> bool:
        """Whether nothing mismatched."""
        return not self.mismatched

    @property
    def unexplained(self) -> tuple[Check, ...]:
        """Checks with a mismatch that no recorded difference can explain: something is wrong."""
        return tuple(check for check in self.mismatched if not self._explanations(check))

    @property
    def causes(self) -> tuple[str, ...]:
        """Likely causes of what mismatched, one sentence each."""
        found: dict[str, None] = {}
        for check in self.mismatched:
            for cause in self._causes(check):
                found.setdefault(cause)
        return tuple(found)

    def to_json(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            **asdict(self),
            "ok": self.ok,
            "unexplained": [check.name for check in self.unexplained],
            "causes": list(self.causes),
        }

    def _explanations(self, check: Check) -> list[Difference]:
        return [difference for difference in self.differences if difference.name in check.depends_on]

    def _causes(self, check: Check) -> list[str]:
        other_domain = any(c.group == "domain" for c in self.mismatched)
        explanations = [f"{difference}" for difference in self._explanations(check)]
        if check.group == "domain":
            return ["the domain here has another seed than the archive's, or has been edited", *explanations]
        if check.group == "record":
            return ["the births or elites were altered, or written by a program with an error"]
        if check.group.endswith("evaluated") and other_domain:
            return []
        if explanations:
            return explanations
        if self._altered_ancestry(check):
            return []
        if 2 * check.mismatches < check.checked or check.checked == 1:
            cause = "nothing recorded differs and most agree: those named were altered"
            if check.group.endswith("evaluated"):
                cause += ", or their evaluation went wrong once (memory, overclocking)"
            return [cause]
        what = {
            "search": "the seed or the rules of the search",
            "genotypes": "the seed, the initialisation or the mutation operator",
        }.get(check.group, "the domain's code or files, or a trait of the machine that is not recorded,")
        causes = [f"nothing recorded differs and most disagree: {what} changed"]
        if not self.machine_recorded and check.group.endswith("evaluated"):
            causes.append("the archive does not record its kind of machine: another CPU is possible")
        return causes

    def _altered_ancestry(self, check: Check) -> bool:
        """Whether a mismatch further up already says why this one must follow."""
        return check.group == "search" and any(c.group == "record" for c in self.mismatched)
