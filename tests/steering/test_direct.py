"""Direct search for evolvability: values by enumeration, an account of births of its own, whole builds."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from nichechain import BuildConfig, GridNiches, Threads, build, load, verify
from nichechain.archive import read
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import estimate
from nichechain.core.errors import ArchiveError
from nichechain.execution import Processes, evaluate_rows
from nichechain.search.lineages import Stretch
from nichechain.search.selection import Told
from nichechain.steering import make_contests
from nichechain.steering.direct import OffspringCoverage, OffspringLineages

from ..choices import mean_distinct

CONFIG = BuildConfig(
    "cosinus",
    (20,),
    ((-5.0, 5.0),),
    evaluations=1500,
    initial=50,
    batch=40,
    scale=0.1,
    seed=3,
    objective="l-evolvability",
    replacement="objective",
    offspring=6,
)
NICHES = GridNiches((3, 2), ((0.0, 1.0), (0.0, 1.0)))


def births() -> Told:
    rng = np.random.default_rng(4)
    parent = rng.integers(7, size=400)
    child = (parent + rng.integers(0, 3, 400)) % 7
    none = np.zeros(400, np.int64)
    return Told(parent + 9, parent, child, none > 0, none + 1, none, none > 0)


@pytest.mark.parametrize("lineages", [1, 3, 5])
def test_one_generation_is_the_mean_over_all_choices_of_children(lineages):
    # 6 is outside, and one child failed.
    children = np.array([2, 2, 6, -1, 4])
    expected = mean_distinct(children, lineages, nowhere=(6, -1))
    assert OffspringCoverage(NICHES, lineages)(children) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("lineages", [1, 3, 5])
def test_more_generations_go_on_from_the_children_by_the_chain(lineages):
    given = births()
    by = OffspringLineages(NICHES, 3, lineages)
    by.tell(given)
    by.refresh()
    counts = TransitionCounts.from_births(
        given.parent_niche, given.child_niche, NICHES, elite=given.parent_uid
    )
    matrix = np.asarray(estimate(counts, strength=by._chain.strength).T)
    children = np.array([2, 2, 6, -1, 4])
    expected = 0.0
    for target in range(6):
        # Lineages that have not been on the target: those that are on it have.
        away = matrix * (np.arange(7) != target)
        missed = (np.arange(7) != target) * (away @ away @ np.ones(7))
        by_child = np.where(children < 0, 1.0, missed[children])
        expected += 1.0 - np.mean([by_child[list(some)].prod() for some in combinations(range(5), lineages)])
    assert by(children) == pytest.approx(expected, rel=1e-9)


def test_before_there_are_births_nobody_is_known_to_go_anywhere():
    by = OffspringLineages(NICHES, 3, 2)
    by.refresh()
    assert by(np.array([-1, -1])) == 0.0


def account(config: BuildConfig, rows: list[dict]) -> dict[int, int]:
    """Who holds each niche after so many births, by their table alone."""
    m = config.offspring
    elite: dict[int, int] = {}
    contest: dict[int, int] = {}
    born: dict[int, int] = {}
    children: dict[int, list[int | None]] = {}

    def value(uid: int) -> float:
        return mean_distinct(children[uid], m, nowhere=[None])

    def settle() -> None:
        for niche, uid in list(contest.items()):
            both = elite[niche], uid
            if all(len(children[one]) >= m for one in both):
                if value(uid) > value(elite[niche]) + 1e-6:
                    elite[niche] = uid
                del contest[niche]

    for step in sorted({row["step"] for row in rows}):
        # Those that judge come first, and take all that is not of lineages.
        lacking = [
            one
            for niche, uid in contest.items()
            for one in (elite[niche], uid)
            for _ in range(m - len(children[one]))
        ]
        slot = Stretch.of_build(config).slots(step)[0]
        for row in (row for row in rows if row["step"] == step):
            free = step and slot[row["uid"] - Stretch.of_build(config).uid(step)] < 0
            judges = bool(free and lacking)
            if judges:
                assert row["parent_uid"] == lacking.pop(0)
            elif step and not row["lineage"]:
                assert row["parent_uid"] == elite[row["parent_niche"]]
            niche, uid = row["child_niche"], row["uid"]
            children.setdefault(row["parent_uid"], []).append(niche)
            children.setdefault(uid, [])
            born[uid] = niche
            assert row["accepted"] == (niche not in elite)
            if niche not in elite:
                elite[niche] = uid
            elif not judges and not row["lineage"] and niche not in contest:
                contest[niche] = uid
        if sum(row["step"] == step for row in rows) == (config.batch if step else config.initial):
            settle()
    return elite


@pytest.mark.parametrize("share", [0.0, 0.2])
def test_elites_and_parents_are_those_of_an_account_of_the_births(tmp_path, share):
    config = replace(CONFIG, evaluations=900, offspring=3, lineage_share=share)
    with Threads(1) as executor:
        archive = build(config, tmp_path / "a", executor)
    rows = archive.births().replace({np.nan: None}).to_dict("records")
    held = account(config, rows)
    elites = archive.elites
    assert dict(zip(elites.niche.tolist(), elites.uid.tolist(), strict=True)) == held
    judged = elites.key[elites.key >= 0.0]
    assert judged.size > 5
    assert judged.max() <= 3.0


@pytest.mark.parametrize("l", [1, 3])
def test_workers_and_interruptions_change_nothing_and_verify_replays(tmp_path, l):
    config = replace(CONFIG, objective_l=l)
    with Processes(2) as executor:
        build(config, tmp_path / "whole", executor)
    with Threads(1) as executor:
        for evaluations in (20, 73, 400, 401, 777, 1500):
            build(replace(config, evaluations=evaluations), tmp_path / "often", executor)
            if evaluations == 777:
                state = load(tmp_path / "often")
                assert verify(state, sample=20).ok
    for path in (tmp_path / "whole").rglob("*"):
        if path.is_file() and path.name != ".lock":
            assert (
                path.read_bytes() == (tmp_path / "often" / path.relative_to(tmp_path / "whole")).read_bytes()
            )
    assert verify(tmp_path / "whole", sample=None).ok


class Failing:
    """An executor that raises at one of its calls."""

    def __init__(self, call: int) -> None:
        self._left = call

    def evaluate(self, domain, genotypes, on_done=None):  # noqa: ARG002
        self._left -= 1
        if not self._left:
            raise KeyboardInterrupt
        return evaluate_rows(domain, genotypes)


def test_what_an_interrupt_leaves_is_verified_and_goes_on(tmp_path):
    config = replace(CONFIG, evaluations=600, offspring=3)
    with Threads(1) as executor:
        whole = build(config, tmp_path / "whole", executor)
        assert (whole.elites.key >= 0).sum() > 5
        for call in range(2, 15):
            folder = tmp_path / str(call)
            with pytest.raises(KeyboardInterrupt):
                build(config, folder, Failing(call))
            assert verify(folder, sample=0).ok
            build(config, folder, executor)
            assert (folder / "meta.json").read_bytes() == (tmp_path / "whole" / "meta.json").read_bytes()


def test_a_state_that_is_not_that_of_the_births_is_refused(tmp_path, monkeypatch):
    config = replace(CONFIG, evaluations=400)
    with Threads(1) as executor:
        build(config, tmp_path / "a", executor)
        state = read.read_state(tmp_path / "a", read.read_meta(tmp_path / "a"))
        assert len(state.contenders)
        fewer = replace(state, contenders=state.contenders[1:])
        monkeypatch.setattr(read, "read_state", lambda *_: fewer)
        with pytest.raises(ArchiveError, match="its elites or contenders are not those of its births"):
            build(replace(config, evaluations=500), tmp_path / "a", executor)


def test_it_keeps_what_the_map_makes_evolvable(tmp_path):
    """Of the cosinus map, b = 5 cos(π/2 + 2π g0 / (11 − 1.8 g1)): the larger g1, the farther children go."""
    config = replace(CONFIG, evaluations=4000, offspring=10)
    gene = {}
    with Threads(1) as executor:
        for name, one in {
            "direct": config,
            "plain": replace(config, objective="domain", replacement="random"),
        }.items():
            archive = build(one, tmp_path / name, executor)
            gene[name] = np.clip(archive.elites.genotype[:, 1], -5.0, 5.0)
    assert np.median(gene["direct"]) > 4.0
    assert np.median(gene["plain"]) < 3.0


def test_other_searches_have_no_contests():
    assert make_contests(replace(CONFIG, objective="domain"), GridNiches((20,), CONFIG.bounds)) is None
