"""Pictures that others draw: examples, the gallery's page, and the explorer in a browser."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
from of_archive import ARCHIVE, CHAIN
from saving import EXAMPLES, HERE, shrink

from nichechain.plots.explorer import write_explorer


def example(path: Path) -> None:
    """Run an example and keep its picture."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            runpy.run_path(str(path), run_name="__main__")
            (picture,) = Path(folder).glob("*.png")
            out = HERE / "examples" / f"{path.stem}.png"
            out.parent.mkdir(exist_ok=True)
            out.write_bytes(picture.read_bytes())
        finally:
            os.chdir(before)
    shrink(out)
    print(f"wrote {out}")


def explorer() -> None:
    """The explorer's page, as a browser shows it."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for argument in ("headless", "no-sandbox", "disable-gpu", "window-size=1280,1000"):
        options.add_argument(f"--{argument}")
    service = webdriver.ChromeService(shutil.which("chromedriver"))
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "explore.html"
        write_explorer(ARCHIVE, CHAIN, page)
        browser = webdriver.Chrome(options=options, service=service)
        try:
            browser.get(f"{page.as_uri()}#niche=14,14")
            browser.save_screenshot(str(HERE / "explorer.png"))
        finally:
            browser.quit()
    shrink(HERE / "explorer.png")
    print(f"wrote {HERE / 'explorer.png'}")


def gallery() -> None:
    """Run the blocks of the gallery, which write its pictures, and keep these."""
    before, names = Path.cwd(), {}
    blocks = re.findall(r"^```python\n(.*?)^```$", (HERE.parent / "gallery.md").read_text(), re.S | re.M)
    out = HERE / "gallery"
    out.mkdir(exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        plt.rc_context({"figure.figsize": (5.4, 5.8), "savefig.dpi": 140}),
    ):
        os.chdir(folder)
        try:
            for block in blocks:
                exec(block, names)  # noqa: S102  # our own page
        finally:
            os.chdir(before)
        for picture in sorted(Path(folder).glob("*.png")):
            (out / picture.name).write_bytes(picture.read_bytes())
            print(f"wrote {out / picture.name}")


PICTURES: dict[str, Callable[[], None]] = {
    "explorer": explorer,
    "gallery": gallery,
    **{path.stem: partial(example, path) for path in sorted(EXAMPLES.glob("0[1-4]_*.py"))},
}
