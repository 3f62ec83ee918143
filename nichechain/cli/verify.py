"""``nichechain verify``: whether an archive is what its configuration leads to, to the bit."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from nichechain.cli import output, parsing, progress, workers
from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    from nichechain.verification import Check, Verification

_GROUPS = {
    "record": "record, against itself",
    "search": "search, run again on recorded behaviors",
    "domain": "domain, against the recorded one",
    "genotypes": "genotypes, grown again from their roots",
    "births evaluated": "births, grown and evaluated again",
    "elites evaluated": "elites, evaluated again",
}


@dataclass(frozen=True)
class VerifyCommand:
    """Make parts of an archive again from its configuration, and compare to the last bit.

    Exit status 0: all that was compared agrees, or what differs can be due to a library or a machine
    other than the recorded ones. 1: something differs that nothing recorded explains. 2: the archive
    is damaged.
    """

    path: parsing.ArchivePath
    sample: Annotated[str, tyro.conf.arg(metavar="N|all")] = "100"
    """Elites, and as many births, to evaluate again. The rest is checked without evaluations, in full."""
    seed: int = 0
    """Seed of the choice of these."""
    workers: parsing.Workers = None
    cache_memory: parsing.CacheMemory = None
    strict: bool = False
    """Exit with status 1 whatever the cause of a difference."""
    json: bool = False
    """Write every check as JSON."""


def run(arguments: Sequence[str]) -> int:
    """Verify."""
    command = parsing.parse(VerifyCommand, arguments)
    from nichechain.archive.archive import load
    from nichechain.verification import verify

    sample = _sample(command.sample)
    archive = load(command.path)
    began = time.monotonic()
    with workers.hired(command.workers, command.cache_memory) as executor, progress.stages() as tell:
        result = verify(
            archive,
            sample=sample,
            seed=command.seed,
            executor=executor,
            on_progress=lambda now: tell(now.stage, now.done, now.total),
        )
    if command.json:
        print(json.dumps(result.to_json(), indent=2))
    else:
        _show(result, time.monotonic() - began)
    return int(bool(result.unexplained or (command.strict and not result.ok)))


def _sample(text: str) -> int | None:
    if text == "all":
        return None
    if not (text.isdecimal() and text.isascii()):
        raise NichechainError(f"--sample is {shown(text)}, but must be a number of elites, from 0, or all")
    return int(text)


def _show(result: Verification, seconds: float) -> None:
    shown = output.console()
    table = output.table("", "checks", "compared", "differ")
    for group, text in _GROUPS.items():
        checks = [check for check in result.checks if check.group == group]
        if checks:
            odd = max(check.mismatches for check in checks)
            most = max(check.checked for check in checks)
            table.add_row(text, str(len(checks)), str(most), f"[red]{odd}[/]" if odd else "0")
    shown.print(
        f"[bold]{result.folder}[/]  {result.births} births, {result.elites} elites; "
        f"{result.sampled_births} births and {result.sampled_elites} elites evaluated again"
    )
    shown.print(table)
    for check in result.mismatched:
        shown.print(f"[red]not so:[/] {check.name}: {_size(check)}", markup=True)
    for cause in result.causes:
        shown.print(f"[yellow]likely cause:[/] {cause}")
    for reason in result.unverified:
        shown.print(f"[yellow]not verified:[/] {reason}")
    shown.print(_verdict(result, seconds))


def _size(check: Check) -> str:
    text = f"{check.mismatches} of {check.checked} differ"
    if check.difference is not None:
        text += f", by up to {check.difference:.3g}"
    if check.uids:
        more = ", …" if check.mismatches > len(check.uids) else ""
        text += f"; births {', '.join(map(str, check.uids))}{more}"
    return text


def _verdict(result: Verification, seconds: float) -> str:
    took = f"[dim]({seconds:.0f} s)[/]"
    if result.unexplained:
        return f"[bold red]This archive is not what its configuration leads to.[/] {took}"
    if not result.ok:
        return (
            "[bold yellow]It differs, as archives may where a library or the machine differs.[/] "
            f"--strict makes this an error. {took}"
        )
    if result.unverified:
        return f"[bold green]All that could be compared is equal to the last bit.[/] {took}"
    return f"[bold green]All that was compared is equal to the last bit.[/] {took}"
