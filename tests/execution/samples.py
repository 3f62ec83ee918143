"""Domains that misbehave; they travel to workers whole, for those cannot import this file."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable
from pathlib import Path

import cloudpickle
import numpy as np
from numpy.typing import ArrayLike

import nichechain
from nichechain.domains import Evaluation, PlanarArm

cloudpickle.register_pickle_by_value(sys.modules[__name__])


class Arm(PlanarArm):
    """An arm that is handed out in small chunks."""

    chunk = 5


class Deadly(Arm):
    """Kills its process at the genotype numbered 17: once, if there is a file to remember it by."""

    def __init__(self, once: Path | None = None) -> None:
        super().__init__()
        self.once = once

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        if (np.asarray(genotypes)[:, 0] == 17).any() and not (self.once and self.once.exists()):
            if self.once:
                self.once.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().evaluate(genotypes)


class Stillborn(Arm):
    """Kills every process that unpacks it."""

    def __setstate__(self, state: object) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class Fragile(Arm):
    """Cannot be unpacked."""

    def __getstate__(self) -> dict[str, object]:
        return {"joints": 10}

    def __setstate__(self, state: object) -> None:
        raise LookupError("no licence on this machine")


class Counted(Arm):
    """Leaves a file for every process that unpacks it."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder

    def __getstate__(self) -> dict[str, object]:
        return self.__dict__

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        with (self.folder / str(os.getpid())).open("a") as file:
            file.write("x")


class Awkward(Exception):  # noqa: N818
    """Can be pickled, but not made again from its pickle."""

    def __init__(self, what: str, where: str) -> None:
        super().__init__(f"{what} in {where}")


class Raises(Arm):
    """Raises at the genotype numbered 17."""

    def __init__(self, awkward: bool = False, chunk: int = 5, error: Exception | None = None) -> None:
        super().__init__()
        self.awkward = awkward
        self.chunk = chunk
        self.error = error or ArithmeticError("elbow")

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        if (np.asarray(genotypes)[:, 0] == 17).any():
            raise Awkward("hinge", "elbow") if self.awkward else self.error
        return super().evaluate(genotypes)


class Writes(Arm):
    """Uses its input as a scratch pad."""

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        rows = np.asarray(genotypes)
        rows += 0.5
        return super().evaluate(rows)


def numbered(n: int) -> np.ndarray:
    """Genotypes (n, 10) with their number in front."""
    rows = np.random.default_rng(n).normal(size=(n, 10)).astype(np.float32)
    rows[:, 0] = np.arange(n)
    return rows


def assert_same(evaluation: Evaluation, expected: Evaluation) -> None:
    """All is equal to the bit."""
    assert evaluation.behavior.tobytes() == expected.behavior.tobytes()
    assert evaluation.objective.tobytes() == expected.objective.tobytes()
    assert evaluation.failed.tolist() == expected.failed.tolist()
    assert evaluation.reasons == expected.reasons


def notes(error: BaseException) -> str:
    """What was noted on an exception."""
    return "\n".join(error.__notes__)


SCRIPT = """
import sys, time
from pathlib import Path
from nichechain import execution
from nichechain.domains import PlanarArm

FOLDER, WORKERS = sys.argv[1:]

class Sleeper(PlanarArm):
    chunk = 1
    def evaluate(self, genotypes):
        Path(FOLDER, str(int(genotypes[0, 0]))).touch()
        time.sleep(1000)

if WORKERS == "ray":
    import ray
    ray.init(num_cpus=2, address="local", include_dashboard=False, object_store_memory=2**27)
rows = Sleeper().sample(8, seed=0)
rows[:, 0] = range(8)
with execution.make(WORKERS) as executor:
    executor.evaluate(Sleeper(), rows)
"""


def check_nothing_is_left(workers: str, stop: signal.Signals, everybody: bool, folder: Path) -> None:
    """Stop a script in which two workers are in the middle of an evaluation; all of it must end."""
    mark = uuid.uuid4().hex
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(folder), workers],
        env={**os.environ, "NICHECHAIN_MARK": mark, "RAY_USAGE_STATS_ENABLED": "0"},
        cwd=Path(nichechain.__file__).parents[1],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        assert _wait_for(lambda: len(list(folder.iterdir())) == 2 or process.poll() is not None)
        assert len(_marked(mark)) >= 3
        if everybody:
            os.killpg(process.pid, stop)
        else:
            os.kill(process.pid, stop)
        assert process.wait(30) != 0
        assert _wait_for(lambda: not _marked(mark))
        assert len(list(folder.iterdir())) == 2
    finally:
        for pid in _marked(mark):
            os.kill(pid, signal.SIGKILL)


def _wait_for(condition: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.05)
    return False


def _marked(mark: str) -> list[int]:
    """Processes with a mark in their environment; zombies have none."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                if mark.encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
            except OSError:
                continue
    return found
