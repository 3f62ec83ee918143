"""An archive as its users see it: elites, births, chain."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nichechain import variation
from nichechain.archive import read
from nichechain.archive.trust import check_trusted
from nichechain.births.orphans import orphan_note
from nichechain.chain import NicheChain, TransitionCounts, estimate
from nichechain.chain.filters import COUNTED, counts_of, within_steps
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.files import as_path
from nichechain.core.notebook import facts_table
from nichechain.core.suggestions import did_you_mean
from nichechain.domains.base import Domain
from nichechain.niches import Niche, Niches
from nichechain.niches.plain import ATTRIBUTE, to_plain
from nichechain.search.config import BuildConfig
from nichechain.search.elites import Elites
from nichechain.search.making import make_domain, make_mutation

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from torch import nn


@dataclass(frozen=True)
class Elite:
    """The genotype that stands for a niche.

    Parameters
    ----------
    niche : tuple of int, optional
        Index of its niche; None for the elite of the outside state.
    state : int
        Flat id of its niche.
    genotype : (P,) float32 array
    behavior : (B,) float64 array
    objective : float
    uid : int
        Number of its birth.
    depth : int
        Generations since an initial birth.
    """

    niche: tuple[int, ...] | None
    state: int
    genotype: NDArray[np.float32]
    behavior: NDArray[np.float64]
    objective: float
    uid: int
    depth: int

    def __repr__(self) -> str:
        place = "outside" if self.niche is None else f"niche {self.niche}"
        return f"Elite({place}: {', '.join(f'{name} {value}' for name, value in self._facts().items())})"

    def _repr_html_(self) -> str:
        return facts_table("Elite", {"niche": self.niche or "outside", **self._facts()})

    def _facts(self) -> dict[str, object]:
        behavior = ", ".join(f"{value:.4g}" for value in self.behavior)
        return {
            "behavior": f"({behavior})",
            "objective": f"{self.objective:.4g}",
            "birth": self.uid,
            "depth": self.depth,
            "genotype": f"of {self.genotype.size} parameters",
        }


class Archive:
    """The last commit of an archive folder, read-only.

    Parameters
    ----------
    folder : Path
    domain : Domain, optional
        What it was built on, where nichechain does not know it by name.

    Raises
    ------
    ArchiveError
        If the folder is no archive or is damaged.
    """

    def __init__(self, folder: Path, domain: Domain | None = None) -> None:
        self.folder = folder
        self._domain = domain
        self.steps: tuple[int, int] | None = None
        self.meta, state = read.read_commit(folder)
        self.config: BuildConfig = self.meta.config
        self.niches: Niches = read.read_niches(folder, self.meta)
        self.elites: Elites = state.elites

    def __repr__(self) -> str:
        if self.meta.imported and not len(self.elites):
            return f"Archive({str(self.folder)!r}: {self.meta.births} imported births)"
        return (
            f"Archive({str(self.folder)!r}: {self.filled} of {len(self.niches)} niches filled "
            f"by {self.meta.births} births)"
        )

    def _repr_html_(self) -> str:
        counts = self.counts
        facts = {
            "folder": self.folder,
            "domain": f"{self.config.domain}, behavior {', '.join(self.meta.facts.behavior_names)}",
            "niches filled": f"{self.filled} of {len(self.niches)}",
            "births": f"{self.meta.births}, {counts.births_outside} of them outside",
            "rows of T observed": f"{counts.rows_observed} of {len(self.niches)}",
            "mutation": f"{self.config.mutation}, scale {self.config.scale:g}",
            "seed": self.config.seed,
        }
        return facts_table("Archive", facts)

    @property
    def filled(self) -> int:
        """Niches with an elite; the outside state is not one."""
        return int(np.count_nonzero(self.elites.niche < len(self.niches)))

    @cached_property
    def domain(self) -> Domain:
        """The domain that the archive was built on.

        Raises
        ------
        ArchiveError
            If its births were imported.
        """
        if self.meta.imported:
            raise ArchiveError(
                f"{self.folder} was imported, so nothing can be evaluated: its domain is not known"
            )
        domain, _ = self._search
        length = self.elites.genotype.shape[1]
        if domain.genotype_length != length:
            raise NichechainError(
                f"{self.folder} has genotypes of {length} parameters, but {domain.name} has "
                f"{domain.genotype_length}: give load() the domain that it was built on"
            )
        return domain

    @cached_property
    def mutate(self) -> variation.Mutation:
        """The mutation operator that the archive was built with.

        Raises
        ------
        ArchiveError
            If its births were imported.
        """
        if self.meta.imported:
            raise ArchiveError(
                f"{self.folder} was imported, so nothing can be mutated: its operator is not known"
            )
        return self._search[1]

    @cached_property
    def _search(self) -> tuple[Domain, variation.Mutation]:
        """Domain and mutation, which may depend on each other."""
        if self._domain is None:
            check_trusted(self.config, self.folder)
        domain = self._domain or make_domain(self.config)
        return make_mutation(self.config, domain)

    def elite(self, niche: Niche) -> Elite:
        """The elite of a niche, or of the outside state (``"outside"``, or its id).

        Raises
        ------
        NichechainError
            If there is no such niche, or nobody was ever born in it.
        """
        if self.meta.imported and not len(self.elites):
            raise ArchiveError(f"{self.folder} was imported, so it has births but no elites")
        state = self.niches.state(niche)
        row = np.searchsorted(self.elites.niche, state)
        if row == len(self.elites) or self.elites.niche[row] != state:
            who = "the outside state" if state == len(self.niches) else f"niche {self.niches.label(state)}"
            raise NichechainError(f"{who} is empty: {self.filled} of {len(self.niches)} have an elite")
        return Elite(
            None if state == len(self.niches) else self.niches.index(state),
            state,
            self.elites.genotype[row],
            self.elites.behavior[row],
            float(self.elites.objective[row]),
            int(self.elites.uid[row]),
            int(self.elites.depth[row]),
        )

    def controller(self, niche: Niche) -> nn.Module:
        """The elite of a niche as a torch module, ready to use."""
        return self.domain.controller(self.elite(niche).genotype)

    def to_ribs(self) -> Any:
        """The elites as an archive of pyribs, see :func:`nichechain.pyribs.to_ribs`.

        By default of a build an elite is a random birth of its niche, not the best.
        """
        from nichechain.pyribs import to_ribs

        return to_ribs(self)

    def births(self) -> pd.DataFrame:
        """Every evaluated child, in order; the columns of :mod:`nichechain.births.table`.

        The frame knows its niches: ``TransitionCounts.from_births(archive.births())`` needs no more.
        """
        frame = self.table().to_pandas(use_threads=False, types_mapper=_nullable)
        names = {f"behavior_{i}": f"behavior_{name}" for i, name in enumerate(self.meta.facts.behavior_names)}
        frame = frame.rename(columns=names)
        frame.attrs[ATTRIBUTE] = to_plain(self.niches)
        return frame

    def table(self, columns: list[str] | None = None, *, whole: bool = False) -> pa.Table:
        """The same as an Arrow table, with axes of behavior numbered.

        Parameters
        ----------
        columns : list of str, optional
            By default all.
        whole : bool
            Births of other steps too, where only those :meth:`during` some are asked about.
        """
        if self.steps is None or whole:
            return read.read_births(self.folder, self.meta, columns)
        read_too = None if columns is None else list(dict.fromkeys([*columns, "step"]))
        births = within_steps(read.read_births(self.folder, self.meta, read_too), self.steps)
        return births if columns is None else births.select(columns)

    @cached_property
    def orphan_note(self) -> str | None:
        """What to say where most imported births after the first batch have no parent, else None."""
        if not self.meta.imported:
            return None
        return orphan_note(self.table(["parent_niche", "step"]))

    def during(self, steps: tuple[int, int]) -> Archive:
        """The same archive, of whose births only those of some steps are read; its elites stay.

        Parameters
        ----------
        steps : (int, int)
            From the first of these steps of the search up to, and without, the second.

        Returns
        -------
        Archive
            Its births, counts and chain are those of the window.

        Raises
        ------
        NichechainError
            If the window is empty, or births do not say their step.
        """
        seen = Archive(self.folder, self._domain)
        seen.__dict__["counts"] = self.counts_of(steps=steps)
        seen.steps = steps
        return seen

    @cached_property
    def counts(self) -> TransitionCounts:
        """Births from niche to niche."""
        return self.counts_of(steps=self.steps)

    def counts_of(
        self,
        *,
        run: int | None = None,
        steps: tuple[int, int] | None = None,
        accepted: bool = False,
        lineages: bool | None = None,
    ) -> TransitionCounts:
        """Some of the births from niche to niche, see :func:`nichechain.chain.filters.counts_of`."""
        return counts_of(
            self.table(list(COUNTED), whole=steps is not None),
            self.niches,
            run=run,
            steps=steps,
            accepted=accepted,
            lineages=lineages,
        )

    def chain(self, estimator: str = "empirical-bayes", **options: Any) -> NicheChain:
        """The Markov chain over niches, estimated from all births.

        It warns where births came from another program that lost most of their parents.

        Parameters
        ----------
        estimator : {"empirical-bayes", "dirichlet", "mle"}
        **options
            Of :func:`nichechain.chain.estimate`, such as ``unvisited="self"``.
        """
        if self.orphan_note is not None:
            warnings.warn(self.orphan_note, stacklevel=2)
        return estimate(self.counts, estimator, **options)  # type: ignore[arg-type]


def load(path: str | Path, *, domain: Domain | None = None) -> Archive:
    """Open an archive folder, or an archive that ships with nichechain by its name.

    Parameters
    ----------
    path : str or Path
        Such as ``archives/fetch-seed0`` or ``fetch-pick-and-place``.
    domain : Domain, optional
        What it was built on, where nichechain does not know it by name.

    Raises
    ------
    ArchiveError
        If there is no archive there, or it is damaged.
    """
    folder = as_path("path", path)
    if not folder.exists():
        folder = _shipped(folder) or folder
    return Archive(folder, domain)


def shipped() -> tuple[str, ...]:
    """Names of the archives that ship with nichechain."""
    return tuple(
        sorted(
            {
                entry.name
                for root in _shipped_roots()
                if root.is_dir()
                for entry in root.iterdir()
                if read.is_archive(entry)
            }
        )
    )


def _shipped(path: Path) -> Path | None:
    """A shipped archive called by its name, with or without ``archives/`` before it."""
    if len(path.parts) == 1 or (len(path.parts) == 2 and path.parts[0] == "archives"):
        for root in _shipped_roots():
            if read.is_archive(root / path.name):
                return root / path.name
    if len(path.parts) == 1 and shipped():
        own = [str(entry) for entry in Path("archives").glob("*") if read.is_archive(entry)]
        near = did_you_mean(str(path), shipped()) or did_you_mean(f"archives/{path}", own)
        raise ArchiveError(
            f"{path} is neither a folder nor an archive that ships with nichechain "
            f"({', '.join(shipped())}){near}"
        )
    near = did_you_mean(str(path), [str(entry) for entry in path.parent.glob("*") if read.is_archive(entry)])
    if near and not path.exists():
        raise ArchiveError(f"{path} is no archive: there is no such folder{near}")
    return None


def _shipped_roots() -> tuple[Path, Path]:
    """Where a wheel puts shipped archives, and where a checkout has them."""
    package = Path(__file__).resolve().parents[1]
    return package / "archives", package.parent / "archives"


def _nullable(kind: Any) -> Any:
    """Pandas types that keep integers whole beside nulls."""
    import pandas as pd
    import pyarrow as pa

    return {
        pa.int32(): pd.Int32Dtype(),
        pa.int64(): pd.Int64Dtype(),
        pa.bool_(): pd.BooleanDtype(),
        pa.string(): pd.StringDtype(),
    }.get(kind)
