"""Archives over tessellations and over grids of one and three axes, from build to command line."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import nichechain as nc
from nichechain.archive import Columns, import_births, write
from nichechain.archive.exports import write_stn
from nichechain.archive.merge import merge
from nichechain.cli import main
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.niches import CVTNiches

from .spaces import build, config

KINDS = {
    "line": config(1, shape=(25,)),
    "space": config(3, shape=(5, 4, 3)),
    "cvt line": config(1, shape=(25,), niches="cvt"),
    "cvt": config(2, shape=(40,), niches="cvt", niches_seed=3),
    "cvt space": config(3, shape=(50,), niches="cvt"),
    "cvt absorb": config(2, shape=(40,), niches="cvt", outside="absorb"),
    "cvt clip": config(2, shape=(40,), niches="cvt", outside="clip"),
}


def _content(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != ".lock"
    }


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    root = tmp_path_factory.mktemp("archives")
    return {name: build(root / name.replace(" ", "-"), asked) for name, asked in KINDS.items()}


@pytest.mark.parametrize("name", KINDS)
def test_births_and_elites_lie_in_their_niches(archives, name):
    archive = archives[name]
    births = archive.births()
    behavior = births[[f"behavior_{axis}" for axis in archive.meta.facts.behavior_names]].to_numpy()
    np.testing.assert_array_equal(archive.niches.of(behavior), births["child_niche"].to_numpy(np.int64))
    np.testing.assert_array_equal(archive.niches.of(archive.elites.behavior), archive.elites.niche)
    assert archive.filled > 10
    # An elite is the birth of its niche with the largest key, so it is one of those accepted.
    accepted = births[births["accepted"]].drop_duplicates("child_niche", keep="last")
    winners = accepted.set_index("child_niche")["uid"].loc[archive.elites.niche]
    assert winners.tolist() == archive.elites.uid.tolist()
    elite = archive.elite(int(archive.elites.niche[2]))
    assert archive.niches.flat(elite.niche) == elite.state


@pytest.mark.parametrize("name", KINDS)
def test_chain_and_command_line(archives, name, capsys):
    archive = archives[name]
    chain = archive.chain()
    np.testing.assert_allclose(np.asarray(chain.T).sum(axis=1), 1.0, rtol=1e-9)
    scores = nc.niche_evolvability(chain, l=3, lineages=20, draws=3)
    assert ((scores.value > 0) & (scores.value <= len(archive.niches))).all()
    best = scores.ranking(chain, min_births=5)["index"].iloc[0]
    folder = str(archive.folder)
    assert main(["info", folder, "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["niches"] == len(archive.niches)
    assert main(["info", folder]) == 0
    assert ("Voronoi cells" in capsys.readouterr().out) == name.startswith("cvt")
    assert main(["evolvability", folder, "--niche", best, "--draws", "3", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["index"] == best


@pytest.mark.parametrize("name", KINDS)
def test_stn_names_places_by_their_labels(archives, name, tmp_path):
    archive = archives[name]
    write_stn(archive.births(), archive.niches, tmp_path / "stn.csv")
    rows = (tmp_path / "stn.csv").read_text().splitlines()[1:]
    known = {archive.niches.label(state).replace(",", "_") for state in range(archive.niches.states)}
    assert {row.split(",")[2] for row in rows} <= known


@pytest.mark.parametrize("budgets", [(900,), (130, 131, 900)])
def test_a_tessellation_resumes_to_the_same_bytes(archives, budgets, tmp_path):
    for evaluations in budgets:
        build(tmp_path, replace(KINDS["cvt"], evaluations=evaluations))
    assert _content(tmp_path) == _content(archives["cvt"].folder)


def test_a_tessellation_is_read_never_made_again(archives, tmp_path, monkeypatch):
    build(tmp_path, replace(KINDS["cvt"], evaluations=200))

    def never(*_, **__):
        raise AssertionError("the tessellation was made again")

    monkeypatch.setattr(CVTNiches, "tessellated", never)
    build(tmp_path, KINDS["cvt"])
    assert nc.load(tmp_path).niches == archives["cvt"].niches
    with pytest.raises(ArchiveError, match="was begun with niches_seed = 3"):
        build(tmp_path, replace(KINDS["cvt"], niches_seed=4))


def _npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=array.dtype == object)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (_npy(np.zeros((39, 2))), "there are 39 centroids, but must be 40"),
        (_npy(np.zeros((40, 3))), r"centroids have shape \(40, 3\)"),
        (_npy(np.zeros((40, 2), np.float32)), "an array is float32"),
        (_npy(np.zeros((40, 2))), "two centroids are the same"),
        (_npy(np.full((40, 2), 9.0)), "out of bounds"),
        (_npy(np.full((40, 2), np.nan)), "out of bounds"),
        (_npy(np.array([{"a": 1}], object)), "an array is object"),
        (b"", "is damaged"),
        (b"\x93NUMPY", "is damaged"),
        (b"PK\x03\x04", "is damaged"),
    ],
)
def test_centroids_are_checked_before_they_are_used(archives, content, message, tmp_path):
    """Even where checksums are right: whoever made the archive could have written anything."""
    _forge(archives["cvt"].folder, tmp_path, content)
    with pytest.raises(ArchiveError, match=message):
        nc.load(tmp_path)


def test_damaged_or_missing_centroids_are_told_of(archives, tmp_path):
    build(tmp_path, replace(KINDS["cvt"], evaluations=120))
    path = tmp_path / "centroids.npy"
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    with pytest.raises(ArchiveError, match=r"centroids\.npy is damaged"):
        nc.load(tmp_path)
    path.unlink()
    with pytest.raises(ArchiveError, match=r"centroids\.npy cannot be read"):
        nc.load(tmp_path)
    _forge(archives["cvt"].folder, tmp_path, None)
    with pytest.raises(ArchiveError, match=r"meta\.json is damaged"):
        nc.load(tmp_path)


def _forge(source: Path, folder: Path, content: bytes | None) -> None:
    """A copy of an archive with other centroids, its checksums made to fit."""
    import hashlib

    for name, data in _content(source).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    meta = json.loads((folder / "meta.json").read_text())
    meta.pop("sha256")
    if content is None:
        meta.pop("centroids")
    else:
        (folder / "centroids.npy").write_bytes(content)
        meta["centroids"]["sha256"] = hashlib.sha256(content).hexdigest()
    meta["sha256"] = hashlib.sha256(json.dumps(meta, indent=2).encode()).hexdigest()
    (folder / "meta.json").write_text(json.dumps(meta, indent=2))


def test_clearing_removes_centroids(tmp_path):
    build(tmp_path, replace(KINDS["cvt"], evaluations=120))
    write.clear(tmp_path)
    assert not _content(tmp_path)


def test_runs_on_one_tessellation_merge(archives, tmp_path):
    other = build(tmp_path / "other", replace(KINDS["cvt"], seed=1))
    merge([archives["cvt"].folder, other.folder], tmp_path / "both")
    both = nc.load(tmp_path / "both")
    assert both.niches == other.niches
    assert (both.counts.matrix != (archives["cvt"].counts + other.counts).matrix).nnz == 0
    elsewhere = build(tmp_path / "elsewhere", replace(KINDS["cvt"], seed=1, niches_seed=4))
    with pytest.raises(NichechainError, match=r"niches_seed 3 and .* has 4"):
        merge([archives["cvt"].folder, elsewhere.folder], tmp_path / "none")
    moved = archives["cvt"].niches.centers[::-1]
    (tmp_path / "moved").mkdir()
    _forge(other.folder, tmp_path / "moved", _npy(np.ascontiguousarray(moved)))
    with pytest.raises(NichechainError, match="different centroids"):
        merge([archives["cvt"].folder, tmp_path / "moved"], tmp_path / "none")


def test_births_of_another_program_are_imported_into_a_tessellation(archives, tmp_path):
    niches = archives["cvt"].niches
    births = archives["cvt"].births()
    births[["parent_niche", "behavior_x", "behavior_y"]].to_csv(tmp_path / "log.csv", index=False)
    columns = Columns(parent="parent_niche", child=("behavior_x", "behavior_y"))
    import_births(tmp_path / "log.csv", tmp_path / "archive", niches, columns=columns)
    imported = nc.load(tmp_path / "archive")
    assert imported.niches == niches
    # A log without the column has no births of lineages.
    own = archives["cvt"].counts + archives["cvt"].counts_of(lineages=True)
    assert (imported.counts.matrix != own.matrix).nnz == 0


def test_a_build_on_the_command_line(tmp_path, capsys):
    asked = ["build", "arm", "--scale", "0.3", "--out", str(tmp_path / "a"), "--niches", "cvt:30"]
    assert main([*asked, "--evaluations", "300"]) == 0
    assert main(["build", "arm", "--out", str(tmp_path / "a"), "--resume", "--evaluations", "350"]) == 0
    archive = nc.load(tmp_path / "a")
    assert (archive.meta.births, len(archive.niches), archive.config.niches) == (350, 30, "cvt")
    capsys.readouterr()
    assert main([*asked, "--grid", "8x8", "--force"]) == 2
    assert "--grid 8x8 and --niches cvt:30 exclude each other" in capsys.readouterr().err
    assert main([*asked[:-1], "cvt:none", "--force"]) == 2
    assert "niches is 'cvt:none'" in capsys.readouterr().err
    assert main(["explore", str(tmp_path / "a"), "--out", str(tmp_path / "page.html")]) == 0
