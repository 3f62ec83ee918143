import matplotlib.image
import pytest

from nichechain.cli import main

KINDS = [
    "elites",
    "visits",
    "evolvability",
    "uncertainty",
    "growth",
    "reach",
    "reachability",
    "wormholes",
    "classes",
    "transitions",
    "transitions-by-class",
]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_writes_a_picture(built, tmp_path, capsys, kind):
    out = tmp_path / f"{kind}.png"
    options = ["--niche", "5,4"] if kind == "reach" else []
    assert main(["plot", str(built), kind, "--out", str(out), "--dpi", "60", *options]) == 0
    assert f"wrote {out}" in capsys.readouterr().out.replace("\n", "")
    picture = matplotlib.image.imread(out)
    assert min(picture.shape[:2]) > 300
    # More than the white of an empty figure.
    assert (picture[..., :3] < 0.99).any(axis=2).mean() > 0.05


@pytest.mark.parametrize(("suffix", "magic"), [(".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_vector_formats(built, tmp_path, suffix, magic):
    out = tmp_path / f"visits{suffix}"
    assert main(["plot", str(built), "visits", "--out", str(out)]) == 0
    assert out.read_bytes().startswith(magic)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["visits", "--out", "map.bmp"], "must end in one of .png, .svg, .pdf"),
        (["visits", "--out", "no/such/folder/map.png"], "there is no folder"),
        (["visits", "--dpi", "1"], "--dpi is 1"),
        (["reachability", "--threshold", "1.5"], "threshold is 1.5"),
        (["evolvability", "--l", "0"], "l is 0"),
        (["uncertainty", "--estimator", "mle"], "leaves no interval to draw"),
        (["reach"], "--niche is missing"),
        (["reach", "--niche", "9,0"], "niche is 9,0, but this grid runs from 0,0 to 7,7"),
        (["reach", "--niche", "a"], "--niche is 'a'"),
        (["visits", "--niche", "1,1"], "--niche belongs to reach and growth, not to visits"),
        (["growth", "--min-births", "9999"], "no niche has 9999 births"),
        (["classes", "--threshold", "1"], "threshold is 1"),
        (["wormholes", "--estimator", "mle"], "need a chain with a posterior"),
    ],
)
def test_bad_options_write_nothing(built, tmp_path, monkeypatch, capsys, options, said):
    monkeypatch.chdir(tmp_path)
    assert main(["plot", str(built), *options]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_unknown_kind(built, capsys):
    assert main(["plot", str(built), "wormhole"]) == 2
    assert "kind is 'wormhole', but must be one of elites, " in capsys.readouterr().err
