"""An archive that somebody made to harm whoever opens it."""

from __future__ import annotations

import ast
import io
import os
import pickle
import subprocess
import sys
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from nichechain.archive.archive import load
from nichechain.archive.untrusted import sha256
from nichechain.core.errors import ArchiveError, NichechainError

from .samples import (
    ROOT,
    edited,
    elites_name,
    forged,
    npy,
    npz,
    part_names,
    read_all,
    written,
)


class _Bomb:
    """Unpickling it makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def test_no_pickle_is_loaded(pristine: dict[str, bytes], tmp_path: Path) -> None:
    bomb = np.array([_Bomb(tmp_path / "exploded")], object)
    name = elites_name(pristine)
    with np.load(io.BytesIO(pristine[name])) as arrays:
        plain = dict(arrays)
    for i, data in enumerate(
        [
            npz(**{**plain, "niche": bomb}),
            npz(**{**plain, "pending_uid": bomb}),
            pickle.dumps(bomb[0]),
            npy(bomb),
        ]
    ):
        folder = written(tmp_path / str(i), forged(pristine, name, data))
        with pytest.raises(ArchiveError, match="elites"):
            read_all(folder)
    assert not (tmp_path / "exploded").exists()
    # The bomb works where pickles are allowed.
    np.load(io.BytesIO(npy(bomb)), allow_pickle=True)
    assert (tmp_path / "exploded").exists()


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04 not a zip", b"plain", npy(np.zeros(3)), npz(niche=[1])])
def test_elites_that_are_none(data: bytes, pristine: dict[str, bytes], tmp_path: Path) -> None:
    name = elites_name(pristine)
    folder = written(tmp_path, forged(pristine, name, data))
    with pytest.raises(ArchiveError, match=name):
        read_all(folder)


@pytest.mark.parametrize("data", [b"", b"PAR1 not parquet PAR1", b"plain"])
def test_births_that_are_none(data: bytes, pristine: dict[str, bytes], tmp_path: Path) -> None:
    name = part_names(pristine)[1]
    folder = written(tmp_path, forged(pristine, name, data))
    with pytest.raises(ArchiveError, match=Path(name).name):
        read_all(folder)


@pytest.mark.parametrize("which", ["elites", "parts", "centroids"])
@pytest.mark.parametrize("way", ["../secret", "/etc/hostname", "link", "meta.json", "", "births", "a\0b"])
def test_other_names_than_a_build_gives_are_refused(
    which: str, way: str, pristine: dict[str, bytes], tmp_path: Path
) -> None:
    """So no path of the metadata can leave the folder, and no file can stand for another."""

    def edit(meta: dict[str, Any]) -> None:
        if which == "centroids":
            meta["config"].update(niches="cvt", shape=[63])
            meta["centroids"] = {"file": way, "sha256": "0"}
        else:
            (meta["elites"] if which == "elites" else meta["parts"][0])["file"] = way

    folder = written(tmp_path / "archive", edited(pristine, edit))
    (folder / "link").symlink_to(tmp_path)
    with pytest.raises(ArchiveError, match=r"meta\.json is damaged: it names"):
        read_all(folder)


@pytest.mark.parametrize("what", ["elites", "part", "meta", "births"])
def test_links_may_not_leave_the_folder(what: str, pristine: dict[str, bytes], tmp_path: Path) -> None:
    name = {"elites": elites_name(pristine), "part": part_names(pristine)[0], "meta": "meta.json"}
    folder = written(tmp_path / "archive", pristine)
    moved = folder / name.get(what, "births")
    moved.rename(tmp_path / "elsewhere")
    moved.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ArchiveError, match="lies outside the folder"):
        read_all(folder)
    # Within it they may.
    (tmp_path / "elsewhere").rename(folder / "here")
    moved.unlink()
    moved.symlink_to(folder / "here")
    read_all(folder)
    # And the folder itself may be a link.
    (tmp_path / "link").symlink_to(folder)
    read_all(tmp_path / "link")


@pytest.mark.parametrize("what", ["elites", "part"])
def test_pipes_and_folders_are_not_waited_for(what: str, pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path / "archive", pristine)
    path = folder / (elites_name(pristine) if what == "elites" else part_names(pristine)[0])
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(ArchiveError, match=f"{path.name} is damaged: it is no plain file"):
        read_all(folder)
    path.unlink()
    path.mkdir()
    with pytest.raises(ArchiveError, match=f"{path.name} is damaged: it is no plain file"):
        read_all(folder)


def test_the_same_part_is_not_read_again_and_again(pristine: dict[str, bytes], tmp_path: Path) -> None:
    def edit(meta: dict[str, Any]) -> None:
        meta["parts"] = [meta["parts"][0]] * 1000
        meta["births"] = 200 * 1000

    folder = written(tmp_path, edited(pristine, edit))
    with pytest.raises(ArchiveError, match="as part 1, of 200 rows"):
        read_all(folder)


# Claims of sizes, and what they would cost


def member(shape: object, data: bytes = b"", dtype: str = "<i8", header: str | None = None) -> bytes:
    """An array file that claims a shape."""
    text = header or repr({"descr": dtype, "fortran_order": False, "shape": shape})
    raw = text.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(raw).to_bytes(2, "little") + raw + data


def zipped(files: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def doubled(plain: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w") as archive:
        warnings.simplefilter("ignore")
        for name, data in [*plain.items(), ("niche.npy", plain["niche.npy"])]:
            archive.writestr(name, data)
    return buffer.getvalue()


def members(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def with_reasons(files: dict[str, bytes], length: int, **options: Any) -> bytes:
    """The first part of births, every one failed for a reason of that length."""
    table = pq.read_table(io.BytesIO(files[part_names(files)[0]]))
    place = table.column_names.index("failed")
    # Not alike, so that their lengths are what they have in common.
    reasons = pa.array([f"{row:03d}".rjust(length, "x") for row in range(len(table))])
    buffer = io.BytesIO()
    pq.write_table(table.set_column(place, "failed", reasons), buffer, **{"compression": "zstd", **options})
    return buffer.getvalue()


def bombs(files: dict[str, bytes]) -> dict[str, dict[str, bytes]]:
    """Archives whose checksums are right, and that claim more than they are."""
    elites, part = elites_name(files), part_names(files)[0]
    plain = members(files[elites])
    huge = 10**12

    def arrays(**changed: bytes) -> dict[str, bytes]:
        return forged(files, elites, zipped({**plain, **{f"{k}.npy": data for k, data in changed.items()}}))

    def births(length: int, **options: Any) -> dict[str, bytes]:
        return forged(files, part, with_reasons(files, length, **options))

    def config(**values: Any) -> dict[str, bytes]:
        return edited(files, lambda meta: meta["config"].update(values))

    def many_rows(meta: dict[str, Any]) -> None:
        meta["parts"][0].update(file=f"births/part-000000-{huge}.parquet", rows=huge)
        meta["births"] = huge + 250

    def many_centroids(meta: dict[str, Any]) -> None:
        meta["config"].update(niches="cvt", shape=[10**9])
        meta["centroids"] = {"file": "centroids.npy", "sha256": sha256(CENTROIDS)}

    compressed = zipped({**plain, "niche.npy": member((huge,), bytes(50_000_000))}, zipfile.ZIP_DEFLATED)
    return {
        "an array that claims a huge shape": arrays(niche=member((huge,))),
        "a matrix that claims a huge shape": arrays(genotype=member((huge, 10), dtype="<f4")),
        "a shape whose product is 0": arrays(genotype=member((0, 10**18), dtype="<f4"), niche=member((0,))),
        "a negative shape": arrays(niche=member((-1,))),
        "a shape that is no number": arrays(niche=member(("a",))),
        "a header that is a bomb": arrays(niche=member((), header="9**9**9")),
        "a header nested deeply": arrays(niche=member((), header="(" * 9000)),
        "an item as large as one likes": arrays(niche=member((1,), dtype="<U1000000000")),
        "a zip bomb": forged(files, elites, compressed),
        "an array twice": forged(files, elites, doubled(plain)),
        "very long strings": births(2_000_000),
        "strings a little too long": births(1001),
        "strings that grow out of nothing": births(
            10_000, use_dictionary=False, column_encoding={"failed": "DELTA_BYTE_ARRAY"}
        ),
        "a part of a billion rows": edited(files, many_rows),
        "metadata nested deeply": {**files, "meta.json": b'{"format": 1, "config": ' + b"[" * 1_000_000},
        "metadata without end": {**files, "meta.json": b" " * (1 << 24) + files["meta.json"]},
        "a number without end": {**files, "meta.json": b'{"format": ' + b"9" * 1_000_000 + b"}"},
        "infinitely many births": edited(files, lambda meta: meta.update(births=float("inf"))),
        "a trillion niches": config(shape=[10**6, 10**6]),
        "niches beyond all bounds": config(shape=[10**400, 7]),
        "a billion centroids": {**edited(files, many_centroids), "centroids.npy": CENTROIDS},
    }


CENTROIDS = member((10**9, 2), dtype="<f8")

# In a process that has little more memory than it takes to start.
POOR = """
import resource, sys, time
from pathlib import Path
from nichechain.archive.archive import load
from nichechain.core.errors import ArchiveError, NichechainError

load(sys.argv[1]).births()
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 200 * 2**20,) * 2)
for folder in sorted(Path(sys.argv[2]).iterdir()):
    began = time.monotonic()
    try:
        load(folder).births()
        said = "READ"
    except ArchiveError as error:
        said = str(error)
    print(folder.name, f"{time.monotonic() - began:.3f}", said, sep="|")
"""


@pytest.mark.parametrize(
    ("name", "value"),
    [("initial", 2**31), ("initial", 1), ("batch", 2**31), ("batch", 63), ("step", 10**12), ("step", -1)],
)
def test_births_end_in_the_step_that_their_build_was_in(
    name: str, value: int, pristine: dict[str, bytes], tmp_path: Path
) -> None:
    def edit(meta: dict[str, Any]) -> None:
        (meta if name == "step" else meta["config"])[name] = value

    folder = written(tmp_path, edited(pristine, edit))
    with pytest.raises(ArchiveError, match=r"of its build has|not born yet|must be at most"):
        load(folder).elites()


def test_claims_are_checked_before_memory_is_given(pristine: dict[str, bytes], tmp_path: Path) -> None:
    good = written(tmp_path / "good", pristine)
    made = bombs(pristine)
    for name, files in made.items():
        written(tmp_path / "bombs" / name, files)
    # Larger than any memory, and no byte of it on the disk.
    sparse = written(tmp_path / "bombs" / "a file without end", pristine)
    os.truncate(sparse / elites_name(pristine), 10**13)
    done = subprocess.run(
        [sys.executable, "-c", POOR, str(good), str(tmp_path / "bombs")],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        timeout=300,
    )
    lines = [line.split("|") for line in done.stdout.splitlines()]
    assert [name for name, _, _ in lines] == sorted([*made, "a file without end"])
    for name, seconds, said in lines:
        assert float(seconds) < 20, name
        assert said.startswith(str(tmp_path / "bombs" / name)), (name, said)
        assert "is damaged" in said, (name, said)
        # None but the honest giant needed the limit.
        assert ("memory" in said) == (name == "a file without end"), (name, said)


@pytest.mark.parametrize("claim", [2**31 - 1, 2**27])
def test_a_page_that_claims_to_be_large(claim: int, pristine: dict[str, bytes], tmp_path: Path) -> None:
    """The header of a page says how much memory it wants, and the footer need not agree."""
    name = part_names(pristine)[0]
    data = pristine[name]
    column = pq.ParquetFile(io.BytesIO(data)).metadata.row_group(0).column(1)
    assert column.path_in_schema == "uid"
    start = column.dictionary_page_offset
    # Field 1, a number of one byte; field 2, the decompressed size, a number of two.
    assert data[start] == data[start + 2] == 0x15
    size = data[start + 3 : start + 5]
    assert (size[0] & 127 | size[1] << 7) >> 1 == 8 * 200
    number = claim << 1
    digits = bytes([number >> shift & 127 | 128 for shift in (0, 7, 14, 21)] + [number >> 28])
    # The stored size of the page shrinks by as much as its header grows.
    stored = data[start + 6 : start + 8]
    assert data[start + 5] == 0x15
    less = (stored[0] & 127 | stored[1] << 7) - 2 * 3
    shorter = bytes([less & 127 | 128, less >> 7])
    page = data[: start + 3] + digits + b"\x15" + shorter + data[start + 8 : start + 8 + 100]
    changed = page + data[len(page) :]
    folder = written(tmp_path, forged(pristine, name, changed))
    with pytest.raises(ArchiveError, match="its column uid claims to be larger than it can be"):
        read_all(folder)


# The source


def sources() -> list[tuple[str, ast.Module]]:
    package = ROOT / "nichechain"
    return [
        (path.relative_to(package).as_posix(), ast.parse(path.read_text(encoding="utf-8")))
        for path in sorted(package.rglob("*.py"))
    ]


def test_nothing_is_unpickled_and_no_code_is_run() -> None:
    """Only messages between a driver and its own workers are pickled."""
    pickles = {"pickle", "cloudpickle", "dill", "marshal", "shelve", "joblib"}
    forbidden = {"eval", "exec", "compile", "os.system", "pd.read_pickle", "pandas.read_pickle", "yaml.load"}
    found = set()
    for name, tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                found |= {(name, alias.name) for alias in node.names if alias.name.split(".")[0] in pickles}
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in pickles:
                found.add((name, node.module))
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                options = {option.arg: ast.unparse(option.value) for option in node.keywords}
                assert called not in forbidden, name
                assert options.get("allow_pickle", "False") == "False", name
                assert options.get("shell", "False") == "False", name
                assert called != "torch.load" or options.get("weights_only") == "True", name
    assert found == {
        ("execution/fleet.py", "pickle"),
        ("execution/fleet.py", "cloudpickle"),
        ("execution/growing.py", "pickle"),
    }


@pytest.mark.parametrize(
    "named",
    [
        {"domain": "evil"},
        {"domain": "evil:Domain"},
        {"domain": "os:system"},
        {"domain": "gym:evil:Env-v0"},
        {"domain": "gym:a:evil:Env-v0"},
        {"domain": "gym:CartPole-v1", "domain_options": {"descriptor": "evil:function"}},
        {"domain": "arm", "domain_options": {"descriptor": "evil:function"}},
    ],
    ids=str,
)
def test_an_archive_names_no_module_to_import(
    named: dict[str, Any], pristine: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither opening one nor asking for its domain imports what its metadata name."""
    (tmp_path / "evil.py").write_text("import sys; sys.evil = True")
    monkeypatch.syspath_prepend(tmp_path)
    folder = written(tmp_path / "a", edited(pristine, lambda meta: meta["config"].update(named)))
    archive = load(folder)
    archive.births()
    with pytest.raises(NichechainError):
        _ = archive.domain
    with pytest.raises(NichechainError):
        _ = archive.mutate
    assert not hasattr(sys, "evil")


def test_a_module_that_is_trusted_is_imported(
    pristine: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "benign.py").write_text("import sys; sys.benign = True")
    monkeypatch.syspath_prepend(tmp_path)
    folder = written(
        tmp_path / "a", edited(pristine, lambda meta: meta["config"].update(domain="gym:benign:Env-v0"))
    )
    with pytest.raises(ArchiveError, match="asks to import 'benign': if you trust it"):
        _ = load(folder).domain
    monkeypatch.setenv("NICHECHAIN_TRUSTED_MODULES", "other,benign")
    with pytest.raises(NichechainError, match="environment benign:Env-v0 cannot be made"):
        _ = load(folder).domain
    assert sys.benign  # type: ignore[attr-defined]
