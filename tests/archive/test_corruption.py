"""Archives damaged at random: either the right data or one clear error, and nothing else."""

from __future__ import annotations

import hashlib
import json
import random
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

import nichechain
from nichechain.archive.archive import Archive, load
from nichechain.core.errors import ArchiveError

ARCHIVE = Path(__file__).parents[1] / "data" / "format-1"
SLOWEST = 30.0
"""Seconds that reading may take on a machine that has much else to do."""


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix != ".lock"
    }


def digest(archive: Archive) -> str:
    """All that is read of an archive."""
    births = archive.births()
    values = [repr(archive.meta), births.to_csv()]
    values += [repr(getattr(archive.elites, k).tolist()) for k in archive.elites.__dataclass_fields__]
    return hashlib.sha256("".join(values).encode()).hexdigest()


def damaged(files: dict[str, bytes], dice: random.Random) -> tuple[str, str, dict[str, bytes | None]]:
    """What was done to which file, and the files that differ."""
    name = dice.choice(sorted(files))
    data = files[name]
    kind = dice.choice(["bit", "byte", "bytes", "truncate", "grow", "delete", "swap", "zero", "empty", "cut"])
    at = dice.randrange(len(data))
    match kind:
        case "bit":
            new: bytes | None = data[:at] + bytes([data[at] ^ (1 << dice.randrange(8))]) + data[at + 1 :]
        case "byte":
            new = data[:at] + dice.randbytes(1) + data[at + 1 :]
        case "bytes":
            new = data[:at] + dice.randbytes(dice.randint(1, 64)) + data[at + 64 :]
        case "truncate":
            new = data[:at]
        case "grow":
            new = data + dice.randbytes(dice.randint(1, 5000))
        case "delete":
            new = None
        case "swap":
            new = files[dice.choice([other for other in sorted(files) if other != name])]
        case "zero":
            new = data[:at] + bytes(min(512, len(data) - at)) + data[at + 512 :]
        case "empty":
            new = b""
        case _:
            new = data[:at] + data[at + dice.randint(1, 64) :]
    return kind, name, {name: new}


def resealed(files: dict[str, bytes], name: str, data: bytes) -> dict[str, bytes | None]:
    """The same damage by somebody who knows how checksums are made."""
    meta = json.loads(files["meta.json"])
    if name == "meta.json":
        try:
            meta = json.loads(data)
            meta.pop("sha256", None)
        except (ValueError, AttributeError):
            return {name: data}
    else:
        del meta["sha256"]
        for entry in (meta["elites"], *meta["parts"]):
            if entry["file"] == name:
                entry["sha256"] = hashlib.sha256(data).hexdigest()
    meta["sha256"] = hashlib.sha256(json.dumps(meta, indent=2).encode()).hexdigest()
    sealed: dict[str, bytes | None] = {"meta.json": json.dumps(meta, indent=2).encode()}
    return sealed if name == "meta.json" else {name: data, **sealed}


def campaign(folder: Path, rounds: int, seed: int, *, sealed: bool) -> Counter[str]:
    """Damage, read, repair; how it went, counted."""
    files = files_of(ARCHIVE)
    dice = random.Random(seed)
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    right = digest(load(folder))
    outcomes: Counter[str] = Counter()
    for number in range(rounds):
        kind, name, changes = damaged(files, dice)
        data = changes[name]
        if sealed and data is not None:
            changes = resealed(files, name, data)
        for path, content in changes.items():
            if content is None:
                (folder / path).unlink()
            else:
                (folder / path).write_bytes(content)
        where = f"round {number} of seed {seed}: {kind} in {name}"
        began = time.monotonic()
        try:
            found = digest(load(folder))
        except ArchiveError as error:
            message = str(error)
            assert "\n" not in message, where
            assert len(message) < 600, (where, message)
            # The file that was damaged is named; where its checksum was made to fit, metadata may
            # be the first that does not fit, or name a file that is not there.
            named = [Path(path).name for path in changes]
            if sealed and "meta.json" in changes:
                named += ["elites-", "part-"]
            assert any(part in message for part in named), (where, message)
            outcomes["refused"] += 1
        else:
            # With right checksums, other numbers are what somebody has written there.
            assert sealed or found == right, where
            outcomes["right" if found == right else "other"] += 1
        assert time.monotonic() - began < SLOWEST, where
        for path in changes:
            (folder / path).write_bytes(files[path])
    return outcomes


def test_damage_is_refused_or_does_no_harm(tmp_path: Path) -> None:
    outcomes = campaign(tmp_path, 150, 1, sealed=False)
    assert outcomes["refused"] > 140


def test_damage_with_right_checksums_breaks_nothing(tmp_path: Path) -> None:
    outcomes = campaign(tmp_path, 150, 2, sealed=True)
    assert outcomes["refused"] > 75


# Under a limit of memory, in a process of its own: a crash of a library would end it.
LIMITED = """
import resource, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from nichechain.archive.archive import load
import test_corruption as fuzz
fuzz.digest(load(fuzz.ARCHIVE))
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 300 * 2**20,) * 2)
folder, rounds, seed, seal = sys.argv[2:]
outcomes = fuzz.campaign(Path(folder), int(rounds), int(seed), sealed=seal == "sealed")
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
print(dict(outcomes), f"peak {peak} MB", flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("seal", ["plain", "sealed"])
def test_many_damages_under_a_limit_of_memory(seal: str, tmp_path: Path) -> None:
    """Twelve thousand in all."""
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(Path(__file__).parent), str(tmp_path), "6000", "3", seal],
        cwd=Path(nichechain.__file__).parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    print(seal, done.stdout)
