import subprocess
import sys

import pytest

from nichechain import __version__
from nichechain.cli import COMMANDS, main


def test_help_names_every_command(capsys):
    assert main(["--help"]) == 0
    shown = capsys.readouterr().out
    assert all(f"  {name} " in shown for name in COMMANDS)
    assert main([]) == 0
    assert capsys.readouterr().out == shown


@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS)])
def test_help_imports_nothing_heavy(command):
    script = (
        "import sys\n"
        "from nichechain.cli import main\n"
        f"try: main([*{command!r}, '--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'torch', 'ribs', 'mujoco', 'numba', 'matplotlib'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"nichechain {__version__}\n"


def test_unknown_command_is_one_sentence_and_status_2(capsys):
    assert main(["fill"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("nichechain: error: there is no command 'fill'")
    assert error.count("\n") == 1
    assert "build" in error


def test_debug_shows_where_an_error_comes_from(tmp_path):
    from nichechain.core.errors import ArchiveError

    assert main(["info", str(tmp_path)]) == 2
    with pytest.raises(ArchiveError):
        main(["info", str(tmp_path), "--debug"])
