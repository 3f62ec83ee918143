import pytest

from nichechain.cli import main, progress


@pytest.fixture(autouse=True)
def _no_line_on_a_busy_machine(monkeypatch):
    """Lines of progress that come after some time must not depend on how fast this machine is."""
    monkeypatch.setattr(progress, "_FIRST_LINE", 3600.0)


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """A small archive of the arm, built by the command line."""
    folder = tmp_path_factory.mktemp("cli") / "arm"
    assert main(build(folder, 1500)) == 0
    return folder


def build(folder, evaluations, *more):
    """Arguments of a quick build."""
    options = ["--evaluations", str(evaluations), "--grid", "8x8", "--scale", "0.3", "--seed", "5"]
    return ["build", "arm", *options, "--out", str(folder), *more]
