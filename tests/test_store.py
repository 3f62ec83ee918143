"""The archive folder: what is committed survives anything, and nothing else is believed."""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import nichechain
from nichechain import store
from nichechain.archive import load
from nichechain.building import build
from nichechain.config import BuildConfig
from nichechain.errors import ArchiveError
from nichechain.execution import Threads

CONFIG = BuildConfig(
    "arm", (9, 7), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=450, initial=100, batch=64, scale=0.3, seed=5
)
ROOT = Path(nichechain.__file__).parents[1]


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder but the lock."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def built(folder: Path, config: BuildConfig = CONFIG) -> dict[str, bytes]:
    with Threads(1) as executor:
        build(config, folder, executor)
    return content(folder)


@pytest.fixture(autouse=True)
def _small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "PART_ROWS", 200)


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store, "PART_ROWS", 200)
        return built(tmp_path_factory.mktemp("pristine"))


def written(folder: Path, files: dict[str, bytes]) -> Path:
    """A folder with these files."""
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    return folder


def read_all(folder: Path) -> None:
    archive = load(folder)
    archive.births()


def edited(files: dict[str, bytes], edit: Callable[[dict[str, Any]], None]) -> dict[str, bytes]:
    """The files with other metadata, as somebody who wants to be believed would write it."""
    meta = json.loads(files["meta.json"])
    own = meta.pop("sha256", None)
    edit(meta)
    if own is not None:
        meta["sha256"] = hashlib.sha256(json.dumps(meta, indent=2).encode()).hexdigest()
    return {**files, "meta.json": json.dumps(meta, indent=2).encode()}


def forged(files: dict[str, bytes], name: str, data: bytes) -> dict[str, bytes]:
    """The files with other content under one name, its checksum right."""

    def edit(meta: dict[str, Any]) -> None:
        for entry in (meta["elites"], *meta["parts"]):
            if entry["file"] == name:
                entry["sha256"] = hashlib.sha256(data).hexdigest()

    return edited({**files, name: data}, edit)


def elites_name(files: dict[str, bytes]) -> str:
    return next(name for name in files if name.startswith("elites-"))


def part_names(files: dict[str, bytes]) -> list[str]:
    return sorted(name for name in files if name.startswith("births/"))


# Layout


def test_files_of_an_archive(pristine: dict[str, bytes]) -> None:
    assert list(pristine) == [
        "births/part-000000-00200.parquet",
        "births/part-000001-00200.parquet",
        "births/part-000002-00050.parquet",
        "elites-000000450.npz",
        "meta.json",
    ]
    meta = json.loads(pristine["meta.json"])
    assert meta["births"] == 450
    for entry in (meta["elites"], *meta["parts"]):
        assert hashlib.sha256(pristine[entry["file"]]).hexdigest() == entry["sha256"]
    assert [part["rows"] for part in meta["parts"]] == [200, 200, 50]


def test_parts_are_parquet_that_anything_reads(pristine: dict[str, bytes]) -> None:
    tables = [pq.read_table(io.BytesIO(pristine[name])) for name in part_names(pristine)]
    assert [uid for table in tables for uid in table["uid"].to_pylist()] == list(range(450))


def test_how_births_are_cut_into_parts_does_not_matter(
    pristine: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = written(tmp_path / "small", pristine)
    expected = store.read_births(folder, store.read_meta(folder))
    for rows in (1000, 450, 100, 63):
        monkeypatch.setattr(store, "PART_ROWS", rows)
        files = built(tmp_path / str(rows))
        assert len(part_names(files)) == -(-450 // rows)
        assert files[elites_name(files)] == pristine[elites_name(pristine)]
        table = store.read_births(tmp_path / str(rows), store.read_meta(tmp_path / str(rows)))
        assert table.equals(expected)


def test_full_parts_are_final(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, pristine)
    longer = built(folder, replace(CONFIG, evaluations=700))
    first, second, tail = part_names(pristine)
    assert longer[first] == pristine[first]
    assert longer[second] == pristine[second]
    assert tail not in longer


def test_state_comes_back_as_it_was(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """Elites and the pending children of a batch that the budget cut."""
    folder = written(tmp_path, pristine)
    state = store.read_state(folder, store.read_meta(folder))
    assert (state.births, state.step) == (450, 6)
    # Six batches would be 484 births.
    assert state.pending.uid.tolist() == list(range(450, 484))
    assert state.elites.genotype.dtype == state.pending.genotype.dtype == np.float32
    assert state.elites.behavior.dtype == state.elites.objective.dtype == np.float64
    # The children that wait are those that a larger budget would have had.
    built(folder, replace(CONFIG, evaluations=484))
    births = store.read_births(folder, store.read_meta(folder)).to_pydict()
    assert births["parent_uid"][450:] == state.pending.parent_uid.tolist()
    assert births["depth"][450:] == state.pending.depth.tolist()
    assert store.read_state(folder, store.read_meta(folder)).pending.uid.size == 0


def test_a_build_that_is_not_done_says_so(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, pristine)
    assert store.read_meta(folder).complete
    folder = written(tmp_path, edited(pristine, lambda meta: meta["config"].update(evaluations=500)))
    assert not store.read_meta(folder).complete


# Damage


def flipped(data: bytes, position: int) -> bytes:
    return data[:position] + bytes([data[position] ^ 1]) + data[position + 1 :]


DAMAGES: dict[str, Callable[[bytes], bytes | None]] = {
    "first byte": lambda data: flipped(data, 0),
    "middle byte": lambda data: flipped(data, len(data) // 2),
    "last byte": lambda data: flipped(data, len(data) - 1),
    "truncated": lambda data: data[: len(data) // 2],
    "one byte short": lambda data: data[:-1],
    "one byte long": lambda data: data + b"\0",
    "empty": lambda _: b"",
    "missing": lambda _: None,
}


@pytest.mark.parametrize("kind", ["elites", "full part", "last part", "meta"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_is_named(kind: str, damage: str, pristine: dict[str, bytes], tmp_path: Path) -> None:
    parts = part_names(pristine)
    name = {
        "elites": elites_name(pristine),
        "full part": parts[0],
        "last part": parts[-1],
        "meta": "meta.json",
    }[kind]
    damaged = DAMAGES[damage](pristine[name])
    folder = written(tmp_path, pristine)
    if damaged is None:
        (folder / name).unlink()
    else:
        (folder / name).write_bytes(damaged)
    before = content(folder)
    with pytest.raises(ArchiveError) as caught:
        read_all(folder)
    assert Path(name).name in str(caught.value)
    assert "\n" not in str(caught.value)
    # Without metadata there is no archive to go on from, so a build would rightly begin anew.
    if (kind, damage) != ("meta", "missing"):
        with pytest.raises(ArchiveError), Threads(1) as executor:
            build(replace(CONFIG, evaluations=500), folder, executor)
        assert content(folder) == before


def test_every_byte_of_the_metadata_counts(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """No flipped bit may pass for another seed, another count or a program error."""
    folder = written(tmp_path, pristine)
    data = pristine["meta.json"]
    silent = []
    for position in range(len(data)):
        (folder / "meta.json").write_bytes(flipped(data, position))
        try:
            read_all(folder)
        except ArchiveError:
            continue
        silent.append(data[max(0, position - 20) : position + 1].decode())
    assert silent == []


@pytest.mark.parametrize(
    "text",
    ["", "[]", "null", "{}", '{"format": 1}', "{", '{"format": 1, "config": 3}', "\xff", '"meta"'],
)
def test_metadata_that_is_none(text: str, pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, {**pristine, "meta.json": text.encode("latin-1")})
    with pytest.raises(ArchiveError, match=r"meta\.json is damaged"):
        read_all(folder)


@pytest.mark.parametrize(
    "edit",
    [
        lambda meta: meta.update(elites=3),
        lambda meta: meta.update(elites={"file": "elites-000000450.npz"}),
        lambda meta: meta["elites"].pop("file"),
        lambda meta: meta.update(parts=3),
        lambda meta: meta.update(parts=["births"]),
        lambda meta: meta["parts"][0].pop("sha256"),
        lambda meta: meta["parts"][0].pop("rows"),
        lambda meta: meta["parts"][0].update(rows=199),
        lambda meta: meta["config"].pop("seed"),
        lambda meta: meta["config"].update(bounds=[1, 2]),
        lambda meta: meta.pop("versions"),
        lambda meta: meta.update(births="many"),
    ],
)
def test_metadata_with_a_wrong_value(
    edit: Callable[[dict[str, Any]], None], pristine: dict[str, bytes], tmp_path: Path
) -> None:
    folder = written(tmp_path, edited(pristine, edit))
    with pytest.raises(ArchiveError):
        read_all(folder)


def test_births_that_are_not_all_there(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """Metadata whose parts do not add up to its births was not written by a build."""
    folder = written(tmp_path, edited(pristine, lambda meta: meta["parts"].pop()))
    with pytest.raises(ArchiveError):
        read_all(folder)


def test_another_format_is_refused(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, edited(pristine, lambda meta: meta.update(format=store.FORMAT + 1)))
    with pytest.raises(ArchiveError, match="has format 2, but this version reads format 1"):
        read_all(folder)


def test_folders_that_are_no_archives(tmp_path: Path) -> None:
    with pytest.raises(ArchiveError, match="there is no such folder"):
        store.read_meta(tmp_path / "nowhere")
    with pytest.raises(ArchiveError, match=r"it has no meta\.json"):
        store.read_meta(tmp_path)
    assert not store.is_archive(tmp_path)


# Malice


class _Bomb:
    """Unpickling it makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def npy(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


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


@pytest.mark.parametrize("which", ["elites", "parts"])
@pytest.mark.parametrize("way", ["relative", "absolute", "link"])
def test_files_outside_the_folder_are_refused(
    which: str, way: str, pristine: dict[str, bytes], tmp_path: Path
) -> None:
    name = elites_name(pristine) if which == "elites" else part_names(pristine)[0]
    secret = tmp_path / "secret"
    secret.write_bytes(pristine[name])
    path = {"relative": "../secret", "absolute": str(secret), "link": "link"}[way]

    def edit(meta: dict[str, Any]) -> None:
        (meta["elites"] if which == "elites" else meta["parts"][0])["file"] = path

    folder = written(tmp_path / "archive", edited(pristine, edit))
    (folder / "link").symlink_to(secret)
    with pytest.raises(ArchiveError, match=r"lies outside the folder"):
        read_all(folder)


# Several writers, and what they leave


def test_a_second_writer_is_refused(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, pristine)
    with store.writing(folder), Threads(1) as executor:
        with pytest.raises(ArchiveError, match="is being written by another build: wait for it, or stop it"):
            build(replace(CONFIG, evaluations=500), folder, executor)
        # Readers need not wait.
        read_all(folder)
    assert content(folder) == pristine
    built(folder, replace(CONFIG, evaluations=500))


def test_a_killed_writer_lets_go(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pathlib import Path; from nichechain import store\n"
        "with store.writing(Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, cwd=ROOT
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        with pytest.raises(ArchiveError, match="is being written"), store.writing(tmp_path):
            pass
        process.kill()
    with store.writing(tmp_path):
        pass


STALE = {
    "elites-000000001.npz": b"of an earlier commit",
    "elites-000000450.npz.tmp": b"cut short",
    "births/part-000002-00049.parquet": b"of an earlier commit",
    "births/part-000009-00001.parquet.tmp": b"cut short",
    "meta.json.tmp": b"{",
}
FOREIGN = {"notes.txt": b"mine", "births/notes.txt": b"mine", "figure.png": b"mine", "elites.csv": b"mine"}


def test_stale_files_are_ignored_and_swept(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path / "archive", {**pristine, **STALE, **FOREIGN})
    read_all(folder)
    assert load(folder).meta.births == 450
    expected = built(tmp_path / "fresh", replace(CONFIG, evaluations=500))
    assert built(folder, replace(CONFIG, evaluations=500)) == {**expected, **FOREIGN}


def test_clear_removes_the_archive_and_nothing_else(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, {**pristine, **STALE, **FOREIGN})
    store.clear(folder)
    assert content(folder) == FOREIGN
    assert not store.is_archive(folder)
    store.clear(folder)
    assert built(folder) == {**pristine, **FOREIGN}


# Crashes

# Builds in forked children that are killed, each going on from what the last one left. A child
# says when it has made its first commit; it then has until a random instant to live.
KILLER = """
import os, random, signal, sys, time
from pathlib import Path
import ribs.archives
import pyarrow.parquet
from nichechain import building, store
from nichechain.config import BuildConfig
from nichechain.execution import Threads
from nichechain.randomness import Purpose

folder, kills = Path(sys.argv[1]), int(sys.argv[2])
config = BuildConfig("arm", (9, 7), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=int(sys.argv[3]),
                     initial=100, batch=64, scale=0.3, seed=5)
store.PART_ROWS = 200
building.CHECKPOINT_SECONDS = -1.0
random.seed(kills)

for kill in range(kills):
    ready, say = os.pipe()
    child = os.fork()
    if child == 0:
        commit = store.Writer.commit
        def committing(self, state):
            if kill % 3 == 0:
                os.write(say, b".")
            commit(self, state)
            os.write(say, b".")
        store.Writer.commit = committing
        with Threads(1) as executor:
            building.build(config, folder, executor)
        os._exit(0)
    os.close(say)
    os.read(ready, 1)
    time.sleep(random.random() * 0.06)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    os.close(ready)
    births = store.read_meta(folder).births if store.is_archive(folder) else 0
    print(births, *sorted(path.name for path in folder.rglob("*.tmp")), flush=True)
"""


def check_kills(kills: int, evaluations: int, folder: Path) -> None:
    config = replace(CONFIG, evaluations=evaluations)
    expected = built(folder / "whole", config)
    archive = folder / "killed"
    done = subprocess.run(
        [sys.executable, "-c", KILLER, str(archive), str(kills), str(evaluations)],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        timeout=300,
    )
    births = [int(line.split()[0]) for line in done.stdout.splitlines()]
    assert len(births) == kills
    # No kill takes back what was committed, and most of them came in the middle.
    assert births == sorted(births)
    assert sum(0 < count < evaluations for count in births) > kills // 2
    assert len(load(archive).births()) == births[-1]
    assert built(archive, config) == expected


def test_resumes_after_kills(tmp_path: Path) -> None:
    check_kills(6, 6_000, tmp_path)


@pytest.mark.slow
def test_resumes_after_many_kills(tmp_path: Path) -> None:
    check_kills(50, 40_000, tmp_path)


class _PowerCutError(BaseException):
    """No handler of ours may catch it."""


@pytest.mark.parametrize("operation", ["fsync", "replace", "unlink"])
def test_a_power_cut_at_any_operation_of_a_commit(
    operation: str, pristine: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the n-th operation on nothing reaches the disk; the last commit must still be there."""
    later = replace(CONFIG, evaluations=700)
    expected = built(tmp_path / "whole", later)
    cuts = 0
    for n in range(100):
        folder = written(tmp_path / str(n), pristine)
        if not cut_power(folder, later, operation, n, monkeypatch):
            break
        cuts += 1
        archive = load(folder)
        assert archive.meta.births in (450, 700)
        assert len(archive.births()) == archive.meta.births
        assert built(folder, later) == expected
    assert cuts >= 2


def cut_power(
    folder: Path, config: BuildConfig, operation: str, n: int, monkeypatch: pytest.MonkeyPatch
) -> bool:
    """Build until the power is cut at the n-th of such operations; whether there were so many."""
    count = 0

    def stub(original: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            nonlocal count
            count += 1
            if count > n:
                raise _PowerCutError
            return original(*arguments, **options)

        return call

    with monkeypatch.context() as patch:
        if operation == "fsync":
            patch.setattr(store.os, "fsync", stub(store.os.fsync))
        else:
            patch.setattr(Path, operation, stub(getattr(Path, operation)))
        try:
            built(folder, config)
        except _PowerCutError:
            return True
    return False


def test_files_are_on_disk_before_they_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every file is synced before it is renamed, and the metadata is renamed last."""
    events: list[str] = []
    fsync, rename = store.os.fsync, Path.replace

    def synced(descriptor: int) -> None:
        events.append("sync " + Path(f"/proc/self/fd/{descriptor}").readlink().name)
        fsync(descriptor)

    def renamed(self: Path, target: Path) -> Path:
        assert events[-1] == f"sync {self.name}"
        events.append(f"rename {target.name}")
        return rename(self, target)

    monkeypatch.setattr(store.os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", renamed)
    built(tmp_path / "archive", replace(CONFIG, evaluations=50))
    renames = [event.split()[1] for event in events if event.startswith("rename")]
    assert renames == ["part-000000-00050.parquet", "elites-000000050.npz", "meta.json"]
    # The folders' entries too.
    assert events[-1] == "sync archive"
    assert "sync births" in events
