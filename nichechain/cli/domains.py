"""``nichechain domains``: what can be searched."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import tyro

from nichechain.cli import output, parsing, progress

if TYPE_CHECKING:
    from nichechain.domains import Domain

_SECONDS = 0.5


@dataclass(frozen=True)
class DomainsCommand:
    """Domains that a build can search: nichechain's own, and those that installed packages bring."""

    speed: tyro.conf.FlagCreatePairsOff[bool] = False
    """Measure evaluations a second on one thread, about a second for each domain."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Write JSON."""


def run(arguments: Sequence[str]) -> int:
    """List the domains."""
    command = parsing.parse(DomainsCommand, arguments)
    from rich.markup import escape

    from nichechain import domains

    rows = []
    for name in domains.names():
        with progress.spinner(f"{name}: measuring its speed"):
            rows.append(_row(name, domains.make(name), measure=command.speed))
    if command.json:
        print(json.dumps(rows, indent=2))
        return 0
    headings = ["domain", "behavior", "bounds", "genotype", *(["evaluations/s"] if command.speed else [])]
    listed = output.table(*headings)
    for column in listed.columns:
        column.no_wrap = True
    for row in rows:
        bounds = " by ".join(f"[{low:g}, {high:g}]" for low, high in row["bounds"])
        cells = [row["name"], f"{', '.join(row['behavior'])} ({row['unit']})", bounds, f"{row['genotype']:,}"]
        if command.speed:
            cells.append(f"{row['evaluations_per_second']:,.0f}")
        listed.add_row(*map(escape, cells))
    shown = output.console()
    shown.print(listed)
    shown.print("Any Gymnasium environment, with bounds of what its descriptor gives:")
    shown.print("  nichechain build gym:ENV_ID --descriptor final-xy --bounds X0,X1,Y0,Y1")
    return 0


def _row(name: str, domain: Domain, *, measure: bool) -> dict[str, Any]:
    row: dict[str, Any] = {
        "name": name,
        "behavior": list(domain.behavior_names),
        "unit": domain.unit,
        "bounds": [list(pair) for pair in domain.bounds],
        "genotype": domain.genotype_length,
        "objective": domain.objective_name,
    }
    if measure:
        row["evaluations_per_second"] = _speed(domain)
    return row


def _speed(domain: Domain) -> float:
    """Evaluations a second on this thread, in batches of the domain's chunk."""
    genotypes = domain.sample(domain.chunk, seed=0)
    # The first evaluation loads what the domain needs.
    domain.evaluate(genotypes)
    began, done = time.perf_counter(), 0
    while (passed := time.perf_counter() - began) < _SECONDS:
        domain.evaluate(genotypes)
        done += len(genotypes)
    return done / passed
