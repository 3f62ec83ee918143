"""What a notebook shows of a build, of elites and of configurations."""

import sys
from types import SimpleNamespace

import nichechain as nc
from nichechain.archive.notebook import bar_in_notebook, in_notebook


class ZMQInteractiveShell:
    """Named as the shell of a kernel of Jupyter."""


def test_only_a_kernel_is_a_notebook(monkeypatch):
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    assert not in_notebook()
    with bar_in_notebook(3) as bar:
        assert bar is None
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=ZMQInteractiveShell))
    assert in_notebook()


def test_a_build_gives_its_archive(tmp_path):
    config = nc.BuildConfig("arm", (3, 3), ((-1, 1), (-1, 1)), evaluations=40, initial=10)
    told = []
    with nc.Threads(1) as threads:
        archive = nc.build(config, tmp_path / "arm", threads, on_progress=told.append)
    assert archive.meta.births == 40 == told[-1].births
    assert archive.config == config


def test_elites_and_configurations_are_short(arm_archive):
    elite = arm_archive.elite(int(arm_archive.elites.niche[0]))
    assert repr(elite).startswith(f"Elite(niche {elite.niche}: behavior (")
    assert "of 10 parameters)" in repr(elite)
    assert "10 parameters" in elite._repr_html_()
    shown = arm_archive.config._repr_html_()
    assert "evaluations" in shown
    assert "800" in shown
    assert "lineage_length" not in shown


def test_the_text_of_a_configuration_makes_it_again():
    options = {"joints": 5}
    config = nc.BuildConfig(
        "arm", (3, 4), ((-1, 1), (0, 1)), evaluations=40, step_bound=("rescaled", 2), domain_options=options
    )
    text = repr(config)
    assert eval(text, {"BuildConfig": nc.BuildConfig}) == config  # our own text
    assert "lineage" not in text
    assert len(text) < 200
