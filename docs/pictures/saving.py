"""Where pictures come from and go to."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

# Twice what a page shows, so that letters stay sharp.
_DPI = 160

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "examples"
RESULTS = EXAMPLES / "results"


def save(figure: Figure, name: str) -> None:
    """Write the picture of that name."""
    out = HERE / f"{name}.png"
    # A layout of its own keeps to the size asked for.
    figure.savefig(out, dpi=_DPI, bbox_inches=None if figure.get_layout_engine() else "tight")
    shrink(out)
    print(f"wrote {out}")


def shrink(path: Path, width: int = 1600) -> None:
    """No wider than a sharp screen shows a page. All colours stay: a palette makes bands of a scale."""
    with Image.open(path) as image:
        whole = image.convert("RGB")
    if whole.width > width:
        whole = whole.resize((width, round(whole.height * width / whole.width)), Image.Resampling.LANCZOS)
    whole.save(path, optimize=True)
