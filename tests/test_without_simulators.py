"""What needs no simulator and no PyTorch runs where they are absent, and what needs them names them."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import nichechain

# What refuses to be imported, as if it were not installed.
HIDDEN = ("torch", "mujoco", "gymnasium", "gymnasium_robotics")

_BEFORE = f"""
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {HIDDEN!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Hidden())
"""


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A fresh interpreter without these libraries, in a folder."""
    return subprocess.run(
        [sys.executable, "-c", _BEFORE + code],
        capture_output=True,
        text=True,
        cwd=folder,
        env={
            "PYTHONPATH": str(Path(nichechain.__file__).parents[1]),
            "PATH": "/usr/bin:/bin",
            "HOME": str(folder),
        },
        check=False,
    )


def test_births_of_others_are_imported_estimated_drawn_and_explored(tmp_path):
    done = run(
        """
import numpy as np, pandas as pd
import nichechain as nc
from matplotlib.figure import Figure
from nichechain import plots
from nichechain.archive import Columns, import_births
from nichechain.cli import main
from nichechain.plots.explorer import write_explorer

rng = np.random.default_rng(0)
parent, child = rng.uniform(-1, 1, (2, 600, 2))
log = pd.DataFrame({"px": parent[:, 0], "py": parent[:, 1], "cx": child[:, 0], "cy": child[:, 1]})
niches = nc.GridNiches((4, 4), ((-1, 1), (-1, 1)))
import_births(log, "archive", niches, columns=Columns(("px", "py"), ("cx", "cy")))
archive = nc.load("archive")
chain = archive.chain()
assert nc.l_evolvability(chain, niche=3, l=3, lineages=10, draws=4).value > 1
scores = nc.niche_evolvability(chain, l=2, lineages=5, draws=4)
figure = Figure()
plots.plot_evolvability(archive, scores, figure.subplots())
figure.savefig("map.png", dpi=30)
assert nc.load("fetch-pick-and-place").elite((14, 14)).depth > 0
log.to_csv("log.csv", index=False)
common = ["--parent-behavior", "px,py", "--child-behavior", "cx,cy", "--bounds=-1,1,-1,1"]
assert main(["import", "log.csv", "--grid", "4x4", *common, "--out", "again"]) == 0
for command in (
    ["info", "again"],
    ["evolvability", "again", "--top", "2", "--draws", "4"],
    ["plot", "again", "visits", "--out", "visits.png", "--dpi", "30"],
    ["explore", "again", "--out", "page.html", "--draws", "4"],
    ["estimate", "again"],
    ["domains"],
):
    assert main(command) == 0, command
""",
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "page.html").stat().st_size > 10_000


def test_a_search_of_pyribs_is_recorded(tmp_path):
    done = run(
        """
import numpy as np
from ribs.archives import GridArchive
from ribs.emitters import GaussianEmitter
from ribs.schedulers import Scheduler
from nichechain.pyribs import from_ribs, record

archive = GridArchive(solution_dim=3, dims=(4, 4), ranges=[(-1, 1), (-1, 1)], seed=0)
scheduler = Scheduler(archive, [GaussianEmitter(archive, sigma=0.3, x0=np.zeros(3), batch_size=20, seed=0)])
recording = record(scheduler)
for _ in range(5):
    solutions = scheduler.ask()
    scheduler.tell(-np.square(solutions).sum(axis=1), solutions[:, :2])
found = from_ribs(recording, "archive")
assert found.chain().niche_evolvability(l=2, lineages=5).max() > 1
""",
        tmp_path,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("words", "package"),
    [
        (["build", "fetch", "--evaluations", "10", "--out", "a"], "torch"),
        (["build", "gym:Swimmer-v5", "--bounds=-2,2,-2,2", "--evaluations", "10", "--out", "a"], "gymnasium"),
    ],
)
def test_what_needs_a_library_names_it(words, package, tmp_path):
    done = run(f"from nichechain.cli import main; sys.exit(main({words!r}))", tmp_path)
    assert done.returncode == 2
    assert f"needs {package}, which is not installed: pip install {package}" in done.stderr
    # On a busy machine it may first say what it waits for.
    assert len([line for line in done.stderr.splitlines() if line.startswith("nichechain: ")]) == 1


def test_the_docs_list_what_is_left_to_install():
    root = Path(nichechain.__file__).parents[1]
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = {re.match(r"[\w-]+", each).group() for each in project["dependencies"]}
    absent = {name.replace("_", "-") for name in HIDDEN}
    assert absent < needed
    page = (root / "docs/faq.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^python -m pip install -c constraints.txt (cloudpickle .*)$", page, re.MULTILINE)
    assert set(line.split()) == needed - absent
