"""Run a study into a folder: checkpoints after every step, and goes on to the same bits.

Walks advance in blocks of runs of one condition. A finished block is a pair of Parquet files; the
one under way is a single file, replaced after every step. So what the folder holds depends
neither on interruptions nor on workers, and more runs can be added later.
"""

from __future__ import annotations

import io
import json
import re
import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.files import write_atomically, writing
from nichechain.core.machine import library_versions
from nichechain.core.parquet import read_parquet
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain
from nichechain.execution import Executor
from nichechain.niches import GridNiches
from nichechain.studies.conditions import Condition
from nichechain.studies.initialisation import initialise
from nichechain.studies.study import Study
from nichechain.walks import Walks, WalkState, run_seed

BLOCK = 10
"""Runs that advance together; results do not depend on it."""

# A step of a fast domain takes milliseconds, far less than making it durable.
_CHECKPOINT_SECONDS = 1.0
_STUDY, _RUNNING = "study.json", "running.npz"
_PREFIX = "state_"
_FORMAT = 1


@dataclass(frozen=True)
class Block:
    """Runs of one condition that advance together.

    Parameters
    ----------
    condition : Condition
    first, last : int
        Numbers of the runs, both among them.
    """

    condition: Condition
    first: int
    last: int

    @property
    def name(self) -> str:
        """Name of its files."""
        return f"{self.condition.slug}-{self.first:04d}-{self.last:04d}"

    @property
    def runs(self) -> range:
        """Numbers of the runs."""
        return range(self.first, self.last + 1)

    def evaluations(self, steps: int) -> int:
        """Rollouts, the starts among them."""
        return len(self.runs) * self.condition.evaluations(steps)


@dataclass(frozen=True)
class _Walked:
    """How far a block is."""

    state: WalkState
    records: tuple[pa.Table, ...]
    births: tuple[pa.Table, ...]

    @property
    def made(self) -> int:
        return sum(table.num_rows for table in self.births)


def run(
    study: Study,
    folder: str | Path,
    executor: Executor,
    *,
    domain: Domain | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> None:
    """Walk all that is still to walk of a study.

    Parameters
    ----------
    study : Study
        If the folder holds a study, that one; only ``runs`` may be larger.
    folder : path
    executor : Executor
    domain : Domain, optional
        By default the one that the study names.
    on_progress : callable, optional
        Told how many of ``study.evaluations`` are made so far.

    Raises
    ------
    ArchiveError
        If the folder holds another study, is damaged, or is being written.
    NichechainError
        If the domain is unknown or a start fails to evaluate.
    """
    folder = Path(folder)
    domain = domain or study.make_domain()
    with writing(folder):
        if (folder / _STUDY).exists():
            _check_continues(read_study(folder), study, folder)
        for name in ("records", "births"):
            (folder / name).mkdir(exist_ok=True)
        _write_study(folder, study, domain.unit)
        finished = finished_blocks(folder, study)
        done = sum(block.evaluations(study.steps) for block in finished)
        _tell(on_progress, done)
        for block in _blocks_to_walk(folder, study, finished):
            _walk(block, study, domain, folder, executor, lambda n, d=done: _tell(on_progress, d + n))  # type: ignore[misc]
            done += block.evaluations(study.steps)
        # What is no longer under way, and what a crash left half-written.
        for path in (folder / _RUNNING, *folder.glob("**/*.tmp")):
            path.unlink(missing_ok=True)


def is_study(folder: str | Path) -> bool:
    """Whether a folder holds a study."""
    return (Path(folder) / _STUDY).is_file()


def read_study(folder: str | Path) -> Study:
    """The study that a folder holds.

    Raises
    ------
    ArchiveError
        If there is none, it is damaged, or a newer version wrote it.
    """
    return _read_study(Path(folder))[0]


def read_unit(folder: str | Path) -> str:
    """Unit of behavior of the study that a folder holds, without making its domain.

    Raises
    ------
    ArchiveError
        As :func:`read_study`.
    """
    return _read_study(Path(folder))[1]


def _read_study(folder: Path) -> tuple[Study, str]:
    path = folder / _STUDY
    try:
        values = json.loads(path.read_text("utf-8"))
        if values["format"] != _FORMAT:
            raise ArchiveError(f"{path} has format {values['format']}, but this version reads {_FORMAT}")
        return Study.from_json(values["study"]), str(values["unit"])
    except FileNotFoundError:
        raise ArchiveError(f"{folder} holds no study: it has no {_STUDY}") from None
    except ArchiveError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, NichechainError) as error:
        raise ArchiveError(f"{path} is damaged: {error}") from error


def read_records(folder: str | Path, study: Study | None = None) -> pa.Table:
    """Measures of all finished runs, one row for each condition, run and step.

    Parameters
    ----------
    folder : path
        Of :func:`run`.
    study : Study, optional
        By default the folder's.

    Returns
    -------
    pyarrow.Table
        ``condition`` and the columns of :meth:`nichechain.walks.StepRecord.table`.

    Raises
    ------
    ArchiveError
        If the folder holds no study or a file is damaged.
    """
    return _read_blocks(Path(folder), "records", study)


def read_births(folder: str | Path, study: Study | None = None) -> pa.Table:
    """Every evaluated genotype of all finished runs: ``condition`` and the columns of births.

    Raises
    ------
    ArchiveError
        If the folder holds no study or a file is damaged.
    """
    return _read_blocks(Path(folder), "births", study)


def finished_blocks(folder: str | Path, study: Study) -> list[Block]:
    """Blocks that are walked to their end, condition by condition, by the numbers of their runs."""
    names = [path.stem for path in (Path(folder) / "records").glob("*.parquet")]
    return [
        Block(condition, first, last)
        for condition in study.conditions
        for first, last in sorted(_runs_named(names, condition))
        if last < study.runs
    ]


def _blocks_to_walk(folder: Path, study: Study, finished: list[Block]) -> list[Block]:
    """In an order in which every condition has about as many runs at any time; one under way goes first."""
    under_way = _under_way(folder)
    made = []
    for place, condition in enumerate(study.conditions):
        walked = {run for block in finished if block.condition == condition for run in block.runs}
        for first, last in _runs_named([] if under_way is None else [under_way], condition):
            if last < study.runs and walked.isdisjoint(range(first, last + 1)):
                made.append((-1, place, Block(condition, first, last)))
                walked.update(range(first, last + 1))
        together = study.runs if condition.archive_scope == "configuration" else BLOCK
        left = [run for run in range(study.runs) if run not in walked]
        while left:
            # Runs in a row: a block's name says which it has.
            length = next((k for k in range(1, len(left)) if left[k] != left[0] + k), len(left))
            length = min(length, together)
            made.append((left[0], place, Block(condition, left[0], left[length - 1])))
            left = left[length:]
    return [block for _, _, block in sorted(made, key=lambda entry: entry[:2])]


def _runs_named(names: Sequence[str], condition: Condition) -> list[tuple[int, int]]:
    """First and last run of the blocks of a condition among some names."""
    pattern = re.compile(re.escape(condition.slug) + r"-(\d+)-(\d+)")
    found = (pattern.fullmatch(name) for name in names)
    return [(int(match[1]), int(match[2])) for match in found if match]


def _walk(
    block: Block,
    study: Study,
    domain: Domain,
    folder: Path,
    executor: Executor,
    tell: Callable[[int], None],
) -> None:
    config = block.condition.walk_config(study.seed)
    niches = GridNiches(study.shape, study.bounds)
    walks = Walks(domain, block.condition.mutate(), config, niches)
    at = _read_running(folder, block)
    if at is None:
        starts = start_genotypes(study, block.condition, domain, block.runs)
        state, first = walks.start(block.runs, executor, starts)
        at = _Walked(state, (), (first,))
    made = at.made
    tell(made)

    def on_done(more: int) -> None:
        nonlocal made
        made += more
        tell(made)

    saved = time.monotonic()
    try:
        while at.state.step <= study.steps:
            step = walks.advance(at.state, executor, on_done)
            at = _Walked(step.state, (*at.records, step.record.table()), (*at.births, step.births))
            made = at.made
            if time.monotonic() - saved >= _CHECKPOINT_SECONDS:
                _write_running(folder, block, at)
                saved = time.monotonic()
    except KeyboardInterrupt:
        _write_running(folder, block, at)
        raise
    # Records last: a block that has them is finished.
    for name, tables in (("births", at.births), ("records", at.records)):
        write_atomically(folder / name / f"{block.name}.parquet", _parquet(pa.concat_tables(tables)))


def start_genotypes(study: Study, condition: Condition, domain: Domain, runs: range) -> NDArray[np.float32]:
    """First genotypes of a condition's runs, the same for all conditions of a paired study.

    Returns
    -------
    (R, P) float32 array, or (R, μ, P) for multi-state walks
    """
    seed = study.seed if study.paired else condition.walk_config(study.seed).seed
    rows = [
        initialise(
            domain,
            condition.initialisation,
            condition.width,
            seed=keyed(run_seed(seed, number), Purpose.INITIAL),
        )
        for number in runs
    ]
    return np.concatenate(rows) if condition.states is None else np.stack(rows)


def _tell(on_progress: Callable[[int], None] | None, made: int) -> None:
    if on_progress is not None:
        on_progress(made)


def _check_continues(old: Study, new: Study, folder: Path) -> None:
    if replace(old, runs=new.runs) != new:
        before, after = old.to_json(), new.to_json()
        names = [name for name in before if before[name] != after[name] and name != "runs"]
        raise ArchiveError(
            f"{folder} holds a study that differs in {', '.join(names)}: go on with that one, "
            "or give another folder"
        )
    if new.runs < old.runs:
        raise ArchiveError(f"{folder} holds a study of {old.runs} runs, more than the {new.runs} asked for")
    shared = [condition.label for condition in new.conditions if condition.archive_scope == "configuration"]
    if new.runs > old.runs and shared:
        raise ArchiveError(
            f"{folder} holds a study of {old.runs} runs, and no run can be added to condition {shared[0]}, "
            "whose runs share a novelty archive"
        )


def _write_study(folder: Path, study: Study, unit: str) -> None:
    values = {
        "format": _FORMAT,
        "study": study.to_json(),
        "unit": unit,
        "versions": library_versions(),
    }
    write_atomically(folder / _STUDY, json.dumps(values, indent=1).encode())


def _write_running(folder: Path, block: Block, at: _Walked) -> None:
    arrays: dict[str, Any] = {f"{_PREFIX}{name}": values for name, values in at.state.arrays().items()}
    arrays["block"] = np.frombuffer(block.name.encode(), np.uint8)
    for name, tables in (("records", at.records), ("births", at.births)):
        content = _parquet(pa.concat_tables(tables)) if tables else b""
        arrays[name] = np.frombuffer(content, np.uint8)
    file = io.BytesIO()
    np.savez(file, **arrays)
    write_atomically(folder / _RUNNING, file.getvalue())


def _under_way(folder: Path) -> str | None:
    """Name of the block that was under way."""
    arrays = _load_running(folder, ("block",))
    return None if arrays is None else bytes(arrays["block"]).decode("ascii", "replace")


def _read_running(folder: Path, block: Block) -> _Walked | None:
    """How far the block was, if it was under way."""
    if _under_way(folder) != block.name:
        return None
    arrays = _load_running(folder)
    assert arrays is not None
    try:
        state = WalkState.from_arrays(
            {name.removeprefix(_PREFIX): v for name, v in arrays.items() if name.startswith(_PREFIX)}
        )
        records, births = (
            (read_parquet(pa.BufferReader(arrays[name].tobytes())),) if len(arrays[name]) else ()
            for name in ("records", "births")
        )
    except (KeyError, ValueError, OSError, pa.ArrowException) as error:
        raise _damaged(folder, error) from error
    return _Walked(state, records, births)


def _load_running(folder: Path, names: Sequence[str] | None = None) -> dict[str, NDArray[Any]] | None:
    try:
        with np.load(folder / _RUNNING, allow_pickle=False) as stored:
            return {name: stored[name] for name in names or stored.files}
    except FileNotFoundError:
        return None
    except (KeyError, ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise _damaged(folder, error) from error


def _damaged(folder: Path, error: Exception) -> ArchiveError:
    path = folder / _RUNNING
    return ArchiveError(f"{path} is damaged: {error}; without that file, the walks under way begin anew")


def _parquet(table: pa.Table) -> bytes:
    content = io.BytesIO()
    pq.write_table(table, content, compression="zstd", write_page_checksum=True)
    return content.getvalue()


def _read_blocks(folder: Path, name: str, study: Study | None) -> pa.Table:
    study = study or read_study(folder)
    tables = []
    for block in finished_blocks(folder, study):
        path = folder / name / f"{block.name}.parquet"
        try:
            rows = read_parquet(path, checksums=True)
        except (OSError, pa.ArrowException) as error:
            raise ArchiveError(f"{path} is damaged: {error}") from error
        label = pa.array([block.condition.label] * rows.num_rows, pa.string())
        tables.append(rows.add_column(0, "condition", label))
    if not tables:
        raise ArchiveError(f"{folder} has no finished walks yet: go on with them first")
    order = [(key, "ascending") for key in ("run", "step", "uid")]
    rows = pa.concat_tables(tables)
    rows = rows.take(pc.sort_indices(rows, order))
    return pa.concat_tables(
        rows.filter(pc.equal(rows["condition"], condition.label)) for condition in study.conditions
    )
