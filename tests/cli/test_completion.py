import shutil
import subprocess

import pytest

from nichechain.cli import COMMANDS, main


def complete(script, *words):
    """What bash offers for the last word."""
    line = " ".join(f"'{word}'" for word in words)
    asked = (
        f"COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _nichechain; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    told = subprocess.run(
        ["bash", "-c", f"{script}\n{asked}"], capture_output=True, encoding="utf-8", check=True
    )
    return told.stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash(capsys):
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    assert set(complete(script, "nichechain", "")) == set(COMMANDS)
    assert complete(script, "nichechain", "ver") == ["verify"]
    assert complete(script, "nichechain", "build", "--eval") == ["--evaluations"]
    assert "--lineages" in complete(script, "nichechain", "evolvability", "--")
    assert {"pressure", "metrics", "resume"} <= set(complete(script, "nichechain", "walks", ""))
    assert {"selection", "resume", "report"} <= set(complete(script, "nichechain", "study", ""))
    assert "--archive-scope" in complete(script, "nichechain", "walks", "--arch")
    # Positional arguments are no options.
    assert "--path" not in complete(script, "nichechain", "info", "--")


def test_zsh_and_fish(capsys):
    assert main(["completion", "zsh"]) == 0
    assert "bashcompinit" in capsys.readouterr().out
    assert main(["completion", "fish"]) == 0
    shown = capsys.readouterr().out
    for command in COMMANDS:
        assert f"-a {command} -d" in shown
    assert "'__fish_seen_subcommand_from build' -l evaluations" in shown


def test_an_unknown_shell(capsys):
    assert main(["completion", "tcsh"]) == 2
    assert "tcsh" in capsys.readouterr().err
