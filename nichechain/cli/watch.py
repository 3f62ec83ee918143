"""``nichechain watch``: what the elite of a niche does, as a film or a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from nichechain.cli import output, parsing, progress
from nichechain.core.errors import NichechainError


@dataclass(frozen=True)
class WatchCommand:
    """Write what the elite of a niche does.

    Fetch tasks and Gymnasium environments are filmed by their own renderer. Where MuJoCo has none that
    needs no screen, gripper and block are drawn over the table. Of the arm its posture is drawn.
    """

    path: parsing.ArchivePath
    niche: Annotated[str | None, parsing.option("I,J", None)] = None
    """Niche whose elite is watched."""
    out: Path = Path("episode.gif")
    """Film to write: .gif, or .mp4 where ffmpeg is installed. Or .png: six moments of a film, or the
    whole drawing."""
    drawn: bool = False
    """Draw places over the map, even where there is a renderer."""


def run(arguments: Sequence[str]) -> int:
    """Write the film."""
    command = parsing.parse(WatchCommand, arguments)
    if command.niche is None:
        raise NichechainError("--niche is missing, but an elite is watched by its niche: --niche 7,11")
    from nichechain.plots.episode import ENDINGS, watch_elite

    output.check_out(command.out, ENDINGS)
    from nichechain.archive.archive import load
    from nichechain.domains.watching import Motion
    from nichechain.niches import parse_niche

    archive = load(command.path)
    niche = parse_niche(command.niche, "--niche")
    with progress.spinner("running the episode"):
        seen = watch_elite(archive, niche, command.out, drawn=command.drawn)
    what = "a drawing of its places" if isinstance(seen, Motion) else "filmed by its renderer"
    size = command.out.stat().st_size
    output.console().print(f"wrote {command.out} ({size / 1e6:.1f} MB): {what}")
    return 0
