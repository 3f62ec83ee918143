"""Which searches ``nichechain build`` is asked for: one, or one for each of several seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from nichechain.archive import read
from nichechain.archive.building import check_resumable
from nichechain.archive.trust import check_trusted
from nichechain.cli import parsing
from nichechain.cli.build import BuildCommand
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.search.config import BuildConfig


@dataclass(frozen=True)
class PlannedSearch:
    """A search and where its archive goes.

    Parameters
    ----------
    config : BuildConfig
    folder : Path
    """

    config: BuildConfig
    folder: Path


def asked_for(command: BuildCommand, arguments: Sequence[str]) -> list[PlannedSearch]:
    """The searches that a command asks for, in the order of its seeds.

    What a command that resumes does not say again stays as it was: in every archive that was begun, and
    where none was begun, as in the first of the others.

    Parameters
    ----------
    command : BuildCommand
    arguments : sequence of str
        What it was read from.

    Raises
    ------
    NichechainError
        If options exclude each other or a value is out of range.
    ArchiveError
        If a folder holds an archive that is neither to be resumed nor replaced, or that cannot be resumed
        like this. Nothing has been written by then.
    """
    if not command.resume:
        command.config()
    if command.resume and command.force:
        raise NichechainError("--resume and --force exclude each other: go on, or start over")
    seeds = [command.seed]
    if command.seeds is not None:
        if command.seed:
            raise NichechainError(
                f"--seed {command.seed} and --seeds {command.seeds} exclude each other: give one"
            )
        seeds = parsing.seeds(command.seeds)
    folders = {seed: command.folder_of(seed) for seed in seeds}
    begun = {
        seed: folder for seed, folder in folders.items() if read.is_archive(folder) and not command.force
    }
    stored = {seed: read.read_meta(folder) for seed, folder in begun.items()}
    if not begun:
        config = command.config()
        return [PlannedSearch(replace(config, seed=seed), folder) for seed, folder in folders.items()]
    for seed, meta in stored.items():
        if not command.resume:
            raise ArchiveError(
                f"{begun[seed]} already holds an archive of {meta.births} births: "
                "--resume goes on with it, --force starts over"
            )
        if command.descriptor is None:
            check_trusted(meta.config, begun[seed])
    usual = next(iter(stored.values())).config
    again = parsing.parse(BuildCommand, arguments, default=BuildCommand.of(usual))
    config = again.config()
    asked = []
    for seed, folder in folders.items():
        own = replace(config, seed=seed) if command.seeds is not None else config
        if seed in stored:
            if again.evaluations == usual.evaluations:
                own = replace(own, evaluations=stored[seed].config.evaluations)
            check_resumable(stored[seed], own, folder)
        asked.append(PlannedSearch(own, folder))
    return asked
