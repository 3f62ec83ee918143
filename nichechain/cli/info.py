"""``nichechain info``: what is in an archive."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from nichechain.cli import output, parsing
from nichechain.core.text import some


@dataclass(frozen=True)
class InfoCommand:
    """What is in an archive, with the configuration and versions that made it."""

    path: parsing.ArchivePath
    format: Literal["table", "json"] = "table"
    """How to write it."""


def run(arguments: Sequence[str]) -> int:
    """Say what is in the archive."""
    command = parsing.parse(InfoCommand, arguments)
    import pyarrow.compute as pc

    from nichechain.archive import read
    from nichechain.archive.archive import load
    from nichechain.births.table import LINEAGE
    from nichechain.search import savings

    archive = load(command.path)
    saved = savings.read(archive.folder)
    meta, counts, config = archive.meta, archive.counts, archive.config
    flags = read.read_births(archive.folder, meta, [LINEAGE])[LINEAGE]
    of_lineages = int(pc.sum(flags).as_py() or 0)
    size = sum(path.stat().st_size for path in archive.folder.rglob("*") if path.is_file())
    names, unit = meta.facts.behavior_names, meta.facts.unit
    content: dict[str, Any] = {
        "folder": str(archive.folder),
        "births": meta.births,
        "evaluations_asked_for": config.evaluations,
        "niches": len(archive.niches),
        "niches_filled": len(archive.niches) - counts.never_filled,
        "niches_never_filled": counts.never_filled,
        "niches_filled_never_parent": counts.never_parent,
        "rows_of_T_observed": counts.rows_observed,
        "births_outside": counts.births_outside,
        "births_of_lineages": of_lineages,
        "births_of_calibrations": meta.births - meta.built,
        "births_with_a_parent": int(counts.births.sum()),
        "births_failed": meta.births - int(counts.visits.sum()),
        "deepest_elite": int(archive.elites.depth.max()) if len(archive.elites) else 0,
        "genotype_length": int(archive.elites.genotype.shape[1]),
        "physics_steps": saved.steps,
        "physics_steps_known": saved.known,
        "bytes": size,
    }
    if command.format == "json":
        made_by = {"configuration": config.to_json(), "origin": meta.origin, "versions": meta.versions}
        print(json.dumps({**content, **made_by}, indent=2))
        return 0
    cells = " by ".join(map(str, config.shape))
    if config.niches == "cvt":
        cells = f"{cells} Voronoi cells (seed {config.niches_seed})"
    spans = ", ".join(
        f"{name} {low:g} to {high:g} {unit}" for name, (low, high) in zip(names, config.bounds, strict=True)
    )
    state = "complete" if meta.complete else f"unfinished, {config.evaluations} asked for"
    if meta.calibrations:
        state += f", {content['births_of_calibrations']} of them added by calibrate"
        left = meta.calibrations[-1].end - meta.births
        state += f", {left} more to come" if left else ""
    if meta.origin is not None:
        state = meta.origin["kind"]
    rows = {
        "archive": str(archive.folder),
        "births": f"{meta.births} ({state})",
        "  out of bounds": str(content["births_outside"]),
        "  failed": str(content["births_failed"]),
        "  of unselected lineages": str(of_lineages),
        "grid" if config.niches == "grid" else "tessellation": f"{cells} over {spans}",
        "niches filled": f"{content['niches_filled']} of {len(archive.niches)}",
        "  never filled": str(content["niches_never_filled"]),
        "  filled, never a parent": str(content["niches_filled_never_parent"]),
        "rows of T observed": str(content["rows_of_T_observed"]),
        **_elites(content, elites=len(archive.elites)),
        **output.physics(saved),
        "on disk": f"{size / 1e6:.1f} MB",
    }
    shown = output.console()
    shown.print(output.facts(rows))
    if meta.imported:
        assert meta.origin is not None
        shown.print("\n[bold]Imported from[/]")
        shown.print(output.facts({name: _plain(value) for name, value in _origin(meta.origin).items()}))
    else:
        shown.print("\n[bold]Configuration[/]" + (" of the first run" if meta.origin else ""))
        shown.print(output.facts({name: _plain(value) for name, value in config.to_json().items()}))
    if archive.orphan_note is not None:
        shown.print(f"\n[bold]Warning:[/] {archive.orphan_note}")
    shown.print("\n[bold]Versions[/]")
    shown.print(output.facts(meta.versions))
    return 0


def _elites(content: dict[str, Any], elites: int) -> dict[str, str]:
    """Rows on elites; a log may bring none, or none with a genotype."""
    if not elites:
        return {}
    rows = {"deepest elite": some(content["deepest_elite"], "generation")}
    if content["genotype_length"]:
        rows["genotype"] = some(content["genotype_length"], "parameter")
    return rows


def _origin(origin: dict[str, Any]) -> dict[str, Any]:
    """The log and the columns that were read, or the program and who its parents were."""
    told = {name: value for name, value in origin.items() if name not in ("kind", "columns", "emitters")}
    columns = {f"  {name}": value for name, value in origin.get("columns", {}).items()}
    emitters = {f"  {each['emitter']}, parent": each["parent"] for each in origin.get("emitters", [])}
    return {**told, **columns, **emitters}


def _plain(value: Any) -> str:
    if isinstance(value, (tuple, list)):
        return ", ".join(_plain(part) for part in value)
    return f"{value:g}" if isinstance(value, float) else str(value)
