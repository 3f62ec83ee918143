"""Every numbered example runs as a newcomer runs it, and leaves the picture that it names."""

import re
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SCRIPTS = sorted(EXAMPLES.glob("[0-9][0-9]_*.py"))
# Those that are over in some ten seconds; all others run with -m slow.
QUICK = {"01_quickstart", "02_ask_the_chain", "03_walks", "04_own_domain"}
# What an example needs beyond what nichechain does.
NEEDS = {"05_ray_cluster": "ray", "09_qdax": "qdax"}
# A cluster has nothing to draw.
NO_PICTURE = {"05_ray_cluster"}


@pytest.mark.parametrize(
    "script",
    [
        pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else pytest.mark.slow)
        for path in SCRIPTS
    ],
)
def test_example(script, tmp_path):
    if script.stem in NEEDS:
        pytest.importorskip(NEEDS[script.stem])
    told = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, encoding="utf-8", timeout=600
    )
    assert told.returncode == 0, told.stderr
    wrote = re.findall(r"^wrote (\S+\.png)$", told.stdout, re.MULTILINE)
    if script.stem in NO_PICTURE:
        return
    assert wrote
    for name in wrote:
        picture = matplotlib.image.imread(tmp_path / name)
        assert min(picture.shape[:2]) > 300
        # More than the white of an empty figure.
        assert (picture[..., :3] < 0.99).any(axis=2).mean() > 0.05


def test_examples_are_numbered_without_gaps_in_order():
    numbers = [int(path.stem[:2]) for path in SCRIPTS]
    assert numbers == sorted(set(numbers))
    assert QUICK | NO_PICTURE | set(NEEDS) <= {path.stem for path in SCRIPTS}
