import pytest

from nichechain.cli import main


def test_watch_writes_a_film(arm_archive, tmp_path, capsys):
    niche = arm_archive.niches.label(int(arm_archive.elites.niche[0]))
    out = tmp_path / "arm.png"
    assert main(["watch", str(arm_archive.folder), "--niche", niche, "--out", str(out)]) == 0
    said = capsys.readouterr().out.replace("\n", "")
    assert f"wrote {out}" in said
    assert "a drawing of its places" in said
    assert out.stat().st_size > 5_000


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "--niche is missing"),
        (["--niche", "99,99"], "99"),
        (["--niche", "0,0", "--out", "film.avi"], "must end in one of .gif, .mp4, .png"),
        (["--niche", "0,0", "--out", "no/such/film.gif"], "there is no folder"),
    ],
)
def test_bad_options_write_nothing(arm_archive, tmp_path, monkeypatch, capsys, options, said):
    monkeypatch.chdir(tmp_path)
    assert main(["watch", str(arm_archive.folder), *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())
