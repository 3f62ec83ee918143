"""Lineages of one elite: when they have births, of whom, and the same bits whatever happens."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from math import ceil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from nichechain.archive.archive import load
from nichechain.archive.building import build
from nichechain.births.table import NONE
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains import Domain, Evaluation, PlanarArm
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig
from nichechain.search.lineages import Calibration, Stretch
from nichechain.verification import verify

from ..arms import RoughArm

# A step of 40 births has 12 of lineages on average: two or three generations of a brood.
CONFIG = BuildConfig(
    "arm",
    (8, 6),
    ((-0.6, 1.0), (-0.8, 0.7)),
    evaluations=610,
    initial=90,
    batch=40,
    scale=0.3,
    seed=3,
    lineage_share=0.3,
    lineage_length=4,
    lineage_brood=5,
)

CASES = [
    # share, batch, brood asked for, lineages of a brood
    (0.05, 64, 10, 10),
    (0.05, 4, 10, 4),
    (0.2, 47, 10, 10),
    (0.3, 40, 5, 5),
    (0.001, 64, 10, 10),
    (0.9, 64, 10, 10),
    # So many whole broods as are due do not fit in a step.
    (0.99, 64, 10, 8),
    (0.9, 7, 4, 1),
    (0.999, 7, 10, 7),
    (0.5, 7, 1, 1),
    (1.0, 60, 10, 10),
]


@pytest.mark.parametrize(("share", "batch", "asked", "size"), CASES)
def test_broods_take_turns_and_keep_the_share(share: float, batch: int, asked: int, size: int) -> None:
    length = 4
    stretch = Stretch(3, 500, batch, share, length, asked)
    generations: dict[tuple[int, ...], int] = {}
    given = 0
    for turn in range(400):
        slot, goes_on = stretch.slots(3 + turn)
        drawing = stretch.drawing(3 + turn)
        own = np.flatnonzero(slot != NONE)
        assert own.tolist() == list(range(batch - own.size, batch))
        assert drawing[slot == NONE].tolist() == np.flatnonzero(slot == NONE).tolist()
        # A generation of a brood is side by side in one step, whole.
        assert own.size % size == 0
        for places in own.reshape(-1, size):
            lineages = tuple(slot[places].tolist())
            assert lineages == tuple(range(lineages[0], lineages[0] + size))
            generation = generations.get(lineages, 0)
            assert (goes_on[places] == (generation % length > 0)).all()
            # Where the brood begins, its first birth draws for all of them.
            assert drawing[places].tolist() == (
                places.tolist() if generation % length else [places[0]] * size
            )
            generations[lineages] = generation + 1
        given += own.size
        assert abs(given - share * batch * (turn + 1)) < size + 1e-6
    broods = ceil(round(share * batch / size, 9))
    assert len(generations) == (broods if given >= broods * size else given // size)
    assert len({slot for lineages in generations for slot in lineages}) == len(generations) * size
    assert max(generations.values()) - min(generations.values()) <= 1


@pytest.mark.parametrize("share", [0.001, 0.05, 0.07, 0.29, 0.5, 0.999, 1.0])
@pytest.mark.parametrize("batch", [1, 7, 64, 100])
def test_lineages_that_begin_alone_take_turns_as_before_there_were_broods(share: float, batch: int) -> None:
    """What archives of then were made by, written out."""
    stretch = Stretch(2, 9, batch, share, 6, 1)
    due = round(share * batch, 9)
    for turn in range(300):
        slot, goes_on = stretch.slots(2 + turn)
        number = range(int(due * turn), int(due * (turn + 1)))
        rest = batch - len(number)
        assert slot.tolist() == [NONE] * rest + [each % ceil(due) for each in number]
        assert goes_on.tolist() == [False] * rest + [each // ceil(due) % 6 > 0 for each in number]
        assert stretch.drawing(2 + turn).tolist() == list(range(batch))


@pytest.mark.parametrize(
    ("asked", "brood", "batch", "size"),
    [
        (2000, 10, 50, 10),  # 20 broods, five abreast, four times
        (100, 10, 10, 10),
        (1, 10, 1, 1),
        (45, 10, 5, 5),  # too few for a whole brood
        (110, 10, 12, 6),  # eleven lineages are two broods
        (2000, 200, 50, 50),  # a brood is no larger than a step
        (2000, 1, 50, 1),
    ],
)
def test_broods_of_a_calibration(asked: int, brood: int, batch: int, size: int) -> None:
    config = BuildConfig("arm", (3, 2), ((0, 1), (0, 1)), batch=64)
    stretch = Calibration(7, 100, asked, brood).stretch(config)
    assert stretch.batch == batch
    slot, goes_on = stretch.slots(7)
    assert slot.tolist() == list(range(batch))
    assert not goes_on.any()
    assert stretch.drawing(7).tolist() == [place - place % size for place in range(batch)]
    assert stretch.slots(8)[1].all()
    assert stretch.drawing(8).tolist() == list(range(batch))


def built(folder: Path, config: BuildConfig = CONFIG, workers: int = 1, domain: Domain | None = None) -> Path:
    with Threads(workers) as executor:
        build(config, folder, executor, domain=domain or RoughArm())
    return folder


def content(folder: Path) -> dict[str, bytes]:
    """Every file of an archive but those of the lock."""
    return {
        path.name: path.read_bytes()
        for path in folder.rglob("*.*")
        if path.suffix in (".json", ".npz", ".parquet")
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("whole") / "archive")


@pytest.mark.parametrize("outside", ["state", "absorb"])
def test_first_births_of_a_brood_have_one_parent(outside: str, tmp_path: Path) -> None:
    """By an account from the births alone, of who was drawn and whose lineage went on."""
    config = replace(CONFIG, outside=outside, evaluations=1330)
    births = load(built(tmp_path, config), domain=RoughArm()).births()
    elites: dict[int, int] = {}
    latest: dict[int, int | None] = {}
    seen = Counter[str]()
    for step, rows in births.groupby("step"):
        if step > 0:
            occupied = sorted(niche for niche in elites if outside == "state" or niche < 48)
            drawn = keyed(3, Purpose.SELECTION, int(step)).integers(len(occupied), size=40)
            generations = range(int(2.4 * (step - 1)), int(2.4 * step))
            first = 40 - 5 * len(generations)
            for place, row in enumerate(rows.itertuples()):
                number, lineage = divmod(place - first, 5)
                slot = None if place < first else generations[number] % 3 * 5 + lineage
                begins = slot is not None and generations[number] // 3 % 4 == 0
                going = None if slot is None or begins else latest.get(slot)
                assert row.lineage == (going is not None)
                if going is not None:
                    seen["goes on"] += 1
                    assert row.parent_uid == going
                    continue
                draws = place - lineage if begins else place
                assert row.parent_uid == elites[occupied[drawn[draws]]]
                seen["begins" if begins else "ordinary" if slot is None else "in its place"] += 1
            for place, row in enumerate(rows.itertuples()):
                if place >= first:
                    number, lineage = divmod(place - first, 5)
                    dead = pd.notna(row.failed) or (outside == "absorb" and row.child_niche == 48)
                    latest[generations[number] % 3 * 5 + lineage] = None if dead else row.uid
        for row in rows[rows["accepted"]].itertuples():
            elites[row.child_niche] = row.uid
    assert min(seen.values()) > 10
    assert set(seen) == {"begins", "goes on", "ordinary", "in its place"}


class Stopping:
    """An executor that is stopped at one of its calls."""

    def __init__(self, call: int) -> None:
        self.call = call

    def evaluate(
        self, domain: Domain, genotypes: NDArray[np.float32], on_done: Callable[[int], None] | None = None
    ) -> Evaluation:
        self.call -= 1
        if not self.call:
            raise KeyboardInterrupt
        with Threads(1) as executor:
            return executor.evaluate(domain, genotypes, on_done)


def test_a_build_stopped_at_any_step_goes_on_to_the_same_bits(whole: Path, tmp_path: Path) -> None:
    for call in range(2, 15):
        folder = tmp_path / str(call)
        with pytest.raises(KeyboardInterrupt):
            build(CONFIG, folder, Stopping(call), domain=RoughArm())
        assert load(folder, domain=RoughArm()).meta.births == 90 + 40 * (call - 2)
        built(folder)
        assert content(folder) == content(whole)


@pytest.mark.parametrize("cut", [391, 409, 426])
def test_a_build_cut_within_a_brood_goes_on_to_the_same_bits(cut: int, whole: Path, tmp_path: Path) -> None:
    built(tmp_path, replace(CONFIG, evaluations=cut))
    assert content(built(tmp_path)) == content(whole)


def test_workers_change_nothing(whole: Path, tmp_path: Path) -> None:
    assert content(built(tmp_path, workers=2)) == content(whole)


def test_verification_runs_broods_again(whole: Path) -> None:
    with Threads(1) as executor:
        assert verify(load(whole, domain=RoughArm()), sample=30, executor=executor).mismatched == ()


def test_without_failures_every_lineage_runs_its_length(tmp_path: Path) -> None:
    births = load(built(tmp_path, domain=PlanarArm())).births()
    flagged = births[births["lineage"]]
    parents = births.loc[flagged["parent_uid"]]
    begun = parents[~parents["lineage"]]
    # Broods of five, each the children of one elite.
    assert len(begun) == pytest.approx(0.3 * 520 / 4, abs=10)
    assert set(begun.groupby(["step", "parent_uid"]).size() % 5) == {0}
    # Of four births all but the first are flagged.
    assert flagged.shape[0] == pytest.approx(0.3 * 520 * 3 / 4, abs=10)
