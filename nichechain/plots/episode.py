"""What an elite does: a film where its domain has a renderer, a drawing over the map where it has none."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.files import as_path, replace_file
from nichechain.domains.watching import Film, Motion, watch
from nichechain.niches import Niche
from nichechain.plots.cells import borders, frame
from nichechain.plots.style import EDGE, INK, LONG_JUMP, axes_of, behavior_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive

Pictures = NDArray[np.uint8]

ENDINGS = (".gif", ".mp4", ".png")
"""What an episode can be written as."""

_SHEET = 6
_SIDE = 4.6
_DPI = 100


def watch_elite(archive: Archive, niche: Niche, out: Path | str, *, drawn: bool = False) -> Film | Motion:
    """Write what the elite of a niche does as a picture or a film.

    Parameters
    ----------
    archive : Archive
    niche : int or tuple of int
    out : path
        ``.gif``; ``.mp4``, which needs ffmpeg; or ``.png``, moments side by side, or the whole drawing.
    drawn : bool
        Whether to draw places over the map, even where the domain has a renderer.

    Returns
    -------
    Film or Motion
        What was written.

    Raises
    ------
    NichechainError
        If the niche is empty, the domain cannot be watched or shows nothing here, the ending is
        unknown, or there is no ffmpeg.
    """
    out = as_path("out", out)
    if out.suffix not in ENDINGS:
        raise NichechainError(f"out is {out}, but must end in {', '.join(ENDINGS)}")
    if out.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise NichechainError(f"{out} needs ffmpeg, which is not installed: write a .gif instead")
    elite = archive.elite(niche)
    seen = watch(archive.domain, elite.genotype, drawn=drawn)
    if isinstance(seen, Motion):
        write_motion(archive, elite.state, seen, out)
    else:
        write_film(seen, out)
    return seen


def write_film(film: Film, out: Path) -> None:
    """Write a film as .gif or .mp4, or six of its moments as .png."""
    if out.suffix == ".png":
        replace_file(out, _png(_sheet(film.frames)))
    elif out.suffix == ".mp4":
        _write_mp4(film, out)
    else:
        replace_file(out, _gif(film))


def write_motion(archive: Archive, niche: int, motion: Motion, out: Path) -> None:
    """Write a drawing over the map: the whole as .png, moment by moment as .gif or .mp4."""
    if out.suffix == ".png":
        replace_file(out, _png(next(_drawings(archive, niche, motion, [len(motion) - 1]))))
        return
    frames = np.stack(list(_drawings(archive, niche, motion, list(range(len(motion))))))
    write_film(Film(frames, motion.rate), out)


def plot_motion(
    archive: Archive,
    motion: Motion,
    ax: Axes | None = None,
    *,
    niche: Niche | None = None,
    upto: int | None = None,
) -> Axes:
    """Draw the places of an episode over the niches of an archive.

    Parameters
    ----------
    archive : Archive
        Of two axes of behavior.
    motion : Motion
    ax : matplotlib.axes.Axes, optional
        By default one of its own.
    niche : int or tuple of int, optional
        Framed.
    upto : int, optional
        The last moment to draw; by default all.

    Raises
    ------
    NichechainError
        If behavior does not have two axes, or there is no such niche or moment.
    """
    ax = axes_of(ax)
    from matplotlib.collections import LineCollection

    if len(archive.niches.bounds) != 2:
        raise NichechainError(
            f"behavior has {len(archive.niches.bounds)} axes, but places are drawn over a map of 2"
        )
    last = len(motion) - 1 if upto is None else upto
    check_whole(upto=last)
    if not 0 <= last < len(motion):
        raise NichechainError(f"upto is {last}, but there are moments 0 to {len(motion) - 1}")
    borders(ax, archive.niches)
    if niche is not None and (state := archive.niches.state(niche)) < len(archive.niches):
        frame(ax, archive.niches, state)
    if motion.limbs is not None:
        steps = np.unique(np.linspace(0, last, 6).astype(int))
        fades = LineCollection(
            list(motion.limbs[steps]),
            colors=EDGE,
            alpha=list(np.linspace(0.12, 1.0, steps.size)),
            linewidths=2.2,
        )
        ax.add_collection(fades, autolim=False)
        ax.plot(*motion.limbs[last].T, "o", color=INK, markersize=4.5, zorder=4)
    for (name, track), color in zip(motion.tracks.items(), _colors(len(motion.tracks)), strict=True):
        ax.plot(*track[: last + 1].T, color=color, linewidth=1.8, zorder=5, label=name)
        ax.plot(*track[0], "o", markersize=6, markerfacecolor="white", markeredgecolor=color, zorder=6)
        ax.plot(*track[last], "o", markersize=8, color=color, markeredgecolor="white", zorder=9)
    behavior_axes(ax, archive)
    (left, right), (bottom, top) = archive.niches.bounds
    places = np.concatenate([*motion.tracks.values(), *([] if motion.limbs is None else motion.limbs)])
    # What happens off the map is seen too, with a little air around.
    low, high = np.minimum(places.min(axis=0), (left, bottom)), np.maximum(places.max(axis=0), (right, top))
    air = 0.03 * (high - low)
    ax.set(xlim=(low[0] - air[0], high[0] + air[0]), ylim=(low[1] - air[1], high[1] + air[1]))
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, frameon=False)
    return ax


def _colors(number: int) -> list[str]:
    """What behavior is read off, the last, stands out."""
    return [*[EDGE] * (number - 1), LONG_JUMP]


def _drawings(archive: Archive, niche: int, motion: Motion, moments: list[int]) -> Iterator[Pictures]:
    """The drawing at some moments, (height, width, 3) each."""
    from matplotlib.figure import Figure
    from PIL import Image

    label = archive.niches.label(niche) if niche < len(archive.niches) else "outside"
    for moment in moments:
        figure = Figure(figsize=(_SIDE, _SIDE), dpi=_DPI, layout="constrained")
        ax = figure.add_subplot()
        plot_motion(archive, motion, ax, niche=niche, upto=moment)
        ax.set_title(f"elite of niche {label}", fontsize=11)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=_DPI)
        yield np.asarray(Image.open(drawn).convert("RGB"), np.uint8)


def _sheet(frames: Pictures) -> Pictures:
    """Six moments in two rows."""
    chosen = frames[np.linspace(0, len(frames) - 1, _SHEET).round().astype(int)]
    rows = [np.concatenate(list(row), axis=1) for row in (chosen[: _SHEET // 2], chosen[_SHEET // 2 :])]
    return np.concatenate(rows)


def _png(picture: Pictures) -> bytes:
    from PIL import Image

    written = io.BytesIO()
    Image.fromarray(picture).save(written, "png", optimize=True)
    return written.getvalue()


def _gif(film: Film) -> bytes:
    from PIL import Image

    pictures = [Image.fromarray(picture) for picture in film.frames]
    # One palette for all: a palette of its own for each makes still things flicker, and files large.
    sample = Image.fromarray(_sheet(film.frames)).quantize(128, dither=Image.Dither.NONE)
    indexed = [picture.quantize(palette=sample, dither=Image.Dither.NONE) for picture in pictures]
    # Browsers show no frame for less than two hundredths of a second, and the last one is looked at.
    each = max(20, round(1000.0 / film.rate))
    lasts = [*[each] * (len(indexed) - 1), 1500]
    written = io.BytesIO()
    indexed[0].save(
        written, "gif", save_all=True, append_images=indexed[1:], duration=lasts, loop=0, optimize=False
    )
    return written.getvalue()


def _write_mp4(film: Film, out: Path) -> None:
    # Its usual encoding wants even sides.
    frames = film.frames[:, : film.frames.shape[1] // 2 * 2, : film.frames.shape[2] // 2 * 2]
    height, width = frames.shape[1:3]
    part = out.with_name(f".{out.name}.part.mp4")
    command = [
        *("ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{width}x{height}", "-r", f"{film.rate:g}", "-i", "-", "-pix_fmt", "yuv420p", str(part)),
    ]
    try:
        made = subprocess.run(  # noqa: S603  # no shell reads the name of the file
            command, input=np.ascontiguousarray(frames).tobytes(), capture_output=True
        )
        if made.returncode:
            why = made.stderr.decode(errors="replace").strip().splitlines()
            raise NichechainError(f"ffmpeg cannot write {out}: {why[-1] if why else 'no reason given'}")
        part.replace(out)
    finally:
        part.unlink(missing_ok=True)
