"""What is genuine is verified, what was altered is found and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nichechain.archive.archive import Archive, load
from nichechain.archive.merge import merge
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.machine import library_versions
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains import PlanarArm
from nichechain.execution import Threads
from nichechain.execution.base import WORKER_DIED
from nichechain.niches import CVTNiches
from nichechain.search.config import BuildConfig
from nichechain.verification import Verification, VerificationProgress, verify

from .conftest import CONFIG, Forgery, RoughArm, built


def found(result: Verification) -> dict[str, tuple[int, ...]]:
    """Names of what does not hold, with the births that were named."""
    return {check.name: check.uids for check in result.mismatched}


def test_a_genuine_archive_is_verified_in_full(genuine: Archive) -> None:
    result = verify(genuine, sample=None)
    assert result.ok
    assert result.causes == result.unverified == result.differences == ()
    assert (result.births, result.elites) == (333, len(genuine.elites))
    assert (result.sampled_births, result.sampled_elites) == (333, len(genuine.elites))
    compared = {check.name: check.checked for check in result.checks}
    rows = genuine.births()
    failed = int(rows["failed"].notna().sum())
    assert failed > 10
    assert compared["uids number the births from 0"] == 333
    assert compared["births fail or not, for the recorded reason"] == 333
    assert compared["births have the recorded behavior"] == 333 - failed
    assert compared["a parent's niche is the one that it was born in"] == 333 - 50
    assert compared["genotypes of elites grow from their roots"] == len(genuine.elites)
    # The last step ends with uid 50 + 9 * 32 = 338.
    assert compared["pending children are the rest of the last step"] == 338 - 333


@pytest.mark.parametrize(
    "values",
    [
        {"outside": "absorb"},
        {"outside": "clip"},
        {"replacement": "first"},
        {"replacement": "newest"},
        {"replacement": "objective"},
        {"mutation": "uniform-ball", "scale": 2.0},
        {"niches": "cvt", "shape": (30,)},
        {"self_adaptive": True},
        {"selection": "curiosity"},
        {"objective": "l-evolvability", "replacement": "objective", "offspring": 3},
        {"step_bound": ("rescaled", 0.5)},
        {"evaluations": 30},
        {"evaluations": 338},
    ],
    ids=str,
)
def test_archives_of_any_configuration_are_verified(values: dict[str, Any], tmp_path: Path) -> None:
    result = verify(built(tmp_path, replace(CONFIG, **values)), sample=None)
    assert result.ok, found(result)
    assert not result.unverified


def test_the_result_is_that_of_any_workers(genuine: Archive) -> None:
    with Threads(1) as executor:
        one = verify(genuine, sample=40, executor=executor)
    with Threads(3) as executor:
        three = verify(genuine, sample=40, executor=executor)
    assert one == three == verify(genuine, sample=40)
    assert one.sampled_births == 40


def test_the_seed_decides_who_is_evaluated(genuine: Archive) -> None:
    def asked(seed: int) -> list[bytes]:
        seen: list[bytes] = []

        class Watched(RoughArm):
            def evaluate(self, genotypes: Any) -> Any:
                """Note what is evaluated."""
                seen.extend(row.tobytes() for row in genotypes)
                return super().evaluate(genotypes)

        with Threads(1) as executor:
            result = verify(load(genuine.folder, domain=Watched()), sample=7, seed=seed, executor=executor)
        assert result.ok
        return seen

    assert len(asked(3)) == 14
    assert asked(3) == asked(3)
    assert asked(3) != asked(4)


def test_progress_ends_with_all_done(genuine: Archive) -> None:
    last: dict[str, VerificationProgress] = {}
    verify(genuine, sample=9, on_progress=lambda now: last.update({now.stage: now}))
    assert {stage: now.done for stage, now in last.items()} == {
        stage: now.total for stage, now in last.items()
    }
    assert last["search"].total == 333
    assert last["evaluations"].total == 18


def _nudged(value: float) -> float:
    return float(np.nextafter(value, np.inf))


def _fine(forgery: Forgery) -> int:
    """A birth of the last steps that is nobody's parent, no elite, and did not fail."""
    births = forgery.births
    parents = {*births["parent_uid"].dropna().astype(int), *forgery.state.pending.parent_uid.tolist()}
    elites = set(forgery.state.elites.uid.tolist())
    return next(
        uid
        for uid in reversed(range(333))
        if uid not in parents | elites and births.loc[uid, "failed"] is None and births.loc[uid, "depth"] > 1
    )


def _sibling(forgery: Forgery, uid: int) -> int:
    """Another birth that could have been its parent, as far as niche and depth tell."""
    births = forgery.births
    row = births.loc[uid]
    alike = births[
        (births["child_niche"] == row["parent_niche"])
        & (births["depth"] == row["depth"] - 1)
        & (births["uid"] != row["parent_uid"])
        & (births["uid"] < 50)
    ]
    return int(alike["uid"].iloc[0])


def _alter(name: str, change: Callable[[Any], Any]) -> Callable[[Forgery], int]:
    def alter(forgery: Forgery) -> int:
        uid = _fine(forgery)
        forgery.set(uid, **{name: change(forgery.births.loc[uid, name])})
        return uid

    return alter


def _other_parent(forgery: Forgery) -> int:
    births = forgery.births
    for uid in range(50, 333):
        if births.loc[uid, "depth"] == 1:
            try:
                forgery.set(uid, parent_uid=_sibling(forgery, uid))
            except IndexError:
                continue
            return uid
    raise AssertionError


def _other_parent_in_a_brood(forgery: Forgery) -> int:
    """One of the first births of a brood becomes the child of an elite of its own."""
    births = forgery.births
    flagged = births[births["lineage"].astype(bool)]
    begun = sorted(uid for uid in flagged["parent_uid"] if not births.loc[uid, "lineage"])
    for uid in begun:
        if births.loc[uid, "parent_uid"] == births.loc[uid - 1, "parent_uid"]:
            other = births.loc[uid - 12]
            forgery.set(uid, **{name: other[name] for name in ("parent_uid", "parent_niche", "depth")})
            return int(uid)
    raise AssertionError


def _becomes_failed(forgery: Forgery) -> int:
    uid = _fine(forgery)
    nothing = dict.fromkeys(("behavior_0", "behavior_1", "objective", "child_niche"))
    forgery.set(uid, failed="the first joint broke", accepted=False, **nothing)
    return uid


def _becomes_fine(forgery: Forgery) -> int:
    births = forgery.births
    uid = int(births["uid"][births["failed"].notna()].iloc[-1])
    like = births.loc[_fine(forgery), ["behavior_0", "behavior_1", "objective", "child_niche"]]
    forgery.set(uid, failed=None, **like.to_dict())
    return uid


def _other_reason(forgery: Forgery) -> int:
    uid = int(forgery.births["uid"][forgery.births["failed"].notna()].iloc[0])
    forgery.set(uid, failed="the second joint broke")
    return uid


def _moves_on_the_quiet(forgery: Forgery) -> int:
    """A birth lands elsewhere, and its niche says so too."""
    uid = _fine(forgery)
    other = forgery.births["behavior_0"].notna() & (
        forgery.births["child_niche"] != forgery.births.loc[uid, "child_niche"]
    )
    like = forgery.births[other].iloc[-1]
    forgery.set(uid, **{name: like[name] for name in ("behavior_0", "behavior_1", "child_niche")})
    return uid


def _initial_with_parent(forgery: Forgery) -> int:
    forgery.set(40, parent_uid=3, parent_niche=forgery.births.loc[3, "child_niche"], depth=1)
    return 40


def _elite(row: int, name: str, change: Callable[[Any], Any]) -> Callable[[Forgery], int]:
    def alter(forgery: Forgery) -> int:
        elites = forgery.state.elites
        forgery.elite(row, **{name: change(getattr(elites, name)[row])})
        return int(elites.uid[row])

    return alter


def _one_weight(genotype: Any) -> Any:
    altered = genotype.copy()
    altered[4] = np.nextafter(altered[4], np.float32(9))
    return altered


def _better_behaved_elite(forgery: Forgery) -> int:
    """An elite and its birth, both moved by one bit within their niche."""
    elites = forgery.state.elites
    uid = int(elites.uid[3])
    moved = elites.behavior[3].copy()
    moved[1] = _nudged(moved[1])
    forgery.elite(3, behavior=moved)
    forgery.set(uid, behavior_1=moved[1])
    return uid


def _other_elite(forgery: Forgery) -> int:
    """A birth that lost takes a niche, with everything that belongs to it."""
    births, elites = forgery.births, forgery.state.elites
    for uid in range(50):
        niche = births.loc[uid, "child_niche"]
        if niche != niche or niche is None or uid in elites.uid:
            continue
        row = int(np.flatnonzero(elites.niche == niche)[0])
        roots = RoughArm().sample(50, seed=keyed(CONFIG.seed, Purpose.INITIAL))
        forgery.elite(
            row,
            uid=uid,
            depth=0,
            genotype=roots[uid],
            behavior=births.loc[uid, ["behavior_0", "behavior_1"]].to_numpy(float),
            objective=births.loc[uid, "objective"],
            key=keyed(CONFIG.seed, Purpose.REPLACEMENT, 0).random(50)[uid],
        )
        return uid
    raise AssertionError


def _dropped_elite(forgery: Forgery) -> int:
    niche = forgery.state.elites.niche[5]
    forgery.drop_elite(5)
    return int(forgery.births["uid"][forgery.births["child_niche"] == niche].iloc[0])


def _pending(name: str, change: Callable[[Any], Any]) -> Callable[[Forgery], int]:
    def alter(forgery: Forgery) -> int:
        forgery.pending(2, **{name: change(getattr(forgery.state.pending, name)[2])})
        return 335

    return alter


def _under_way(name: str, change: Callable[[Any], Any]) -> Callable[[Forgery], int]:
    def alter(forgery: Forgery) -> int:
        lineages = forgery.state.lineages
        forgery.lineage(1, **{name: change(getattr(lineages, name)[1])})
        return int(forgery.state.lineages.uid[1])

    return alter


def _flag(lineage: bool) -> Callable[[Forgery], int]:
    def alter(forgery: Forgery) -> int:
        births = forgery.births
        uid = int(births["uid"][(births["uid"] >= 50) & (births["lineage"] != lineage)].iloc[3])
        forgery.set(uid, lineage=lineage)
        return uid

    return alter


@pytest.mark.parametrize(
    ("alter", "name"),
    [
        (
            _alter("parent_niche", lambda niche: (niche + 1) % 30),
            "a parent's niche is the one that it was born in",
        ),
        (_alter("depth", lambda depth: depth + 1), "a birth is one generation deeper than its parent"),
        (_alter("child_niche", lambda niche: (niche + 1) % 30), "a birth's niche is that of its behavior"),
        (_alter("behavior_0", _nudged), "births have the recorded behavior"),
        (_alter("objective", _nudged), "births have the recorded objective"),
        (_alter("accepted", lambda kept: not kept), "births are accepted that have the largest key so far"),
        (_other_parent, "parents are those that the seed draws"),
        (_other_parent_in_a_brood, "parents are those that the seed draws"),
        (_becomes_failed, "births fail or not, for the recorded reason"),
        (_becomes_fine, "births fail or not, for the recorded reason"),
        (_other_reason, "births fail or not, for the recorded reason"),
        (_moves_on_the_quiet, "births have the recorded behavior"),
        (_moves_on_the_quiet, "births land in the recorded niche"),
        (_initial_with_parent, "initial births, and no others, have no parent"),
        (_elite(2, "genotype", _one_weight), "genotypes of elites grow from their roots"),
        (_elite(2, "genotype", _one_weight), "elites have the recorded behavior"),
        (_elite(6, "objective", _nudged), "an elite's objective is that of its birth"),
        (_elite(6, "objective", _nudged), "elites have the recorded objective"),
        (_elite(6, "depth", lambda depth: depth + 1), "an elite's depth is that of its birth"),
        (_elite(6, "behavior", lambda place: place + 1e-9), "an elite's behavior is that of its birth"),
        (_elite(1, "key", _nudged), "an elite's key is that of its birth"),
        (_better_behaved_elite, "elites have the recorded behavior"),
        (_better_behaved_elite, "births have the recorded behavior"),
        (_other_elite, "elites have the largest key of their niche"),
        (_dropped_elite, "every niche that was reached has an elite"),
        (_pending("genotype", _one_weight), "genotypes of pending children grow from their roots"),
        (_pending("depth", lambda depth: depth + 1), "pending children have parents, niche and depth"),
        (_pending("parent_uid", lambda uid: uid - 1), "pending children are the rest of the last step"),
        (_pending("lineage", lambda lineage: not lineage), "pending children are the rest of the last step"),
        (_flag(True), "births of lineages are flagged, and no others"),
        (_flag(False), "births of lineages are flagged, and no others"),
        (_under_way("genotype", _one_weight), "genotypes of lineages under way grow from their roots"),
        (_under_way("depth", lambda d: d + 1), "lineages under way have the niche and depth of their births"),
        (_under_way("uid", lambda uid: uid - 1), "lineages under way are at their latest births"),
        (_under_way("uid", lambda _: 999), "lineages under way are births that did not fail"),
    ],
)
def test_what_was_altered_is_found_and_named(
    alter: Callable[[Forgery], int], name: str, forgery: Forgery, tmp_path: Path
) -> None:
    uid = alter(forgery)
    result = verify(forgery.sealed(tmp_path), sample=None)
    assert uid in found(result)[name]
    assert result.unexplained
    assert result.causes


@pytest.mark.parametrize(
    ("uid", "values", "name"),
    [
        (7, {"uid": 8}, "uids number the births from 0"),
        (7, {"run": 1}, "births belong to the run that their uid says"),
        (7, {"step": 3}, "births belong to the step of their uid"),
        (300, {"parent_uid": 310}, "parents are earlier births of the same run"),
        (300, {"parent_uid": None, "parent_niche": None}, "initial births, and no others, have no parent"),
        (7, {"child_niche": None}, "births have a niche, or failed and have none"),
        (7, {"depth": 2}, "initial births have depth 0 and no parent's niche"),
    ],
)  # fmt: skip
def test_a_record_that_contradicts_itself(
    uid: int, values: dict[str, Any], name: str, forgery: Forgery, tmp_path: Path
) -> None:
    forgery.set(uid, **values)
    result = verify(forgery.sealed(tmp_path), sample=None)
    assert uid in found(result)[name]
    assert result.unexplained


def test_without_an_outside_state_nobody_is_born_there(tmp_path: Path) -> None:
    forgery = Forgery(built(tmp_path / "genuine", replace(CONFIG, outside="clip")))
    forgery.set(7, child_niche=30)
    names = found(verify(forgery.sealed(tmp_path / "forged")))
    assert names["niches are states of the chain"] == (7,)


def test_centroids_that_were_moved_are_found(tmp_path: Path) -> None:
    forgery = Forgery(built(tmp_path / "genuine", replace(CONFIG, niches="cvt", shape=(30,))))
    assert isinstance(forgery.niches, CVTNiches)
    centroids = forgery.niches.centroids.copy()
    centroids[4, 0] = np.nextafter(centroids[4, 0], 0)
    forgery.niches = CVTNiches(centroids, CONFIG.bounds)
    result = verify(forgery.sealed(tmp_path / "forged"), sample=0)
    assert list(found(result)) == ["the tessellation is that of its seed"]
    assert result.unexplained


def test_the_size_of_a_difference_is_told(forgery: Forgery, tmp_path: Path) -> None:
    uid = _fine(forgery)
    behavior = forgery.births.loc[uid, "behavior_0"]
    forgery.set(uid, behavior_0=behavior + 2.0**-40)
    result = verify(forgery.sealed(tmp_path), sample=None)
    (check,) = [check for check in result.mismatched if check.name == "births have the recorded behavior"]
    assert check.mismatches == 1
    assert check.difference == abs(behavior + 2.0**-40 - behavior)


def test_a_consistent_forgery_is_found_only_where_it_is_evaluated(forgery: Forgery, tmp_path: Path) -> None:
    uid = _fine(forgery)
    forgery.set(uid, objective=_nudged(forgery.births.loc[uid, "objective"]))
    archive = forgery.sealed(tmp_path)
    assert verify(archive, sample=0).ok
    # Each sample of two thirds misses it with probability 1/3; the seeds are fixed.
    assert any(not verify(archive, sample=222, seed=seed).ok for seed in range(8))


def test_another_initialisation_shows_in_all_that_grow_from_it(genuine: Archive) -> None:
    class Other(RoughArm):
        def sample(self, n: int, *, seed: int | np.random.Generator) -> Any:
            """Another initialisation."""
            return super().sample(n, seed=seed) * np.float32(0.5)

    result = verify(load(genuine.folder, domain=Other()), sample=20)
    names = found(result)
    assert "genotypes of elites grow from their roots" in names
    assert "births have the recorded behavior" in names
    assert "elites have the recorded behavior" not in names
    assert any("the initialisation" in cause for cause in result.causes)


class Seeded(RoughArm):
    """An arm that stands where its seed says."""

    @property
    def start(self) -> Any:
        """Its hand."""
        return np.array([1.0, float(self.seed)])


def test_a_domain_with_another_seed_is_named(genuine: Archive) -> None:
    result = verify(load(genuine.folder, domain=Seeded(seed=1)), sample=5)
    (check,) = result.mismatched
    assert check.group == "domain"
    assert check.mismatches == 2
    assert check.difference == 1.0
    assert result.causes == ("the domain here has another seed than the archive's, or has been edited",)
    assert result.unexplained


class Edited(RoughArm):
    """An arm that is not the one that it was."""

    def evaluate(self, genotypes: Any) -> Any:
        """A little longer."""
        fine = super().evaluate(genotypes)
        return replace(fine, behavior=fine.behavior * (1 + 1e-9))


def test_an_edited_domain_is_named(genuine: Archive) -> None:
    result = verify(load(genuine.folder, domain=Edited()), sample=50)
    assert set(found(result)) == {"births have the recorded behavior", "elites have the recorded behavior"}
    assert all(0 < check.difference < 1e-8 for check in result.mismatched)  # type: ignore[operator]
    assert len(result.causes) == 1
    assert "the domain's code or files" in result.causes[0]
    assert result.unexplained


@pytest.mark.parametrize(
    ("name", "explains"),
    [("mujoco", True), ("numba", True), ("simd", True), ("libm", True), ("machine", True), ("ribs", False)],
)
def test_another_library_or_machine_explains_other_evaluations(
    name: str, explains: bool, genuine: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    from nichechain.verification import verifying

    where = "library_versions" if name in library_versions() else "machine"
    present = {**getattr(verifying, where)(), name: "9.9"}
    monkeypatch.setattr(verifying, where, lambda: present)
    result = verify(load(genuine.folder, domain=Edited()), sample=5)
    assert [difference.name for difference in result.differences] == [name]
    assert not result.ok
    assert bool(result.unexplained) != explains
    told = any(f"{name} was " in cause and "here it is 9.9" in cause for cause in result.causes)
    assert told == explains
    # Where nothing differs, other versions are no news.
    assert verify(genuine, sample=5).ok


def test_no_library_explains_a_contradiction(
    forgery: Forgery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    forgery.set(_fine(forgery), depth=1)
    archive = forgery.sealed(tmp_path)
    changed = dict.fromkeys(library_versions(), "9.9")
    monkeypatch.setattr("nichechain.verification.verifying.library_versions", lambda: changed)
    result = verify(archive, sample=5)
    assert [check.group for check in result.unexplained] == ["record"]


def test_an_archive_that_does_not_tell_its_machine(genuine: Archive, tmp_path: Path) -> None:
    import json

    from nichechain.archive.read import checksum

    for path in genuine.folder.rglob("*.*"):
        copy = tmp_path / path.relative_to(genuine.folder)
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(path.read_bytes())
    meta = json.loads((tmp_path / "meta.json").read_text())
    del meta["sha256"], meta["machine"]
    (tmp_path / "meta.json").write_text(json.dumps({**meta, "sha256": checksum(meta)}, indent=2))
    result = verify(load(tmp_path, domain=RoughArm()), sample=5)
    assert result.ok
    assert not result.machine_recorded
    assert result.differences == ()
    edited = verify(load(tmp_path, domain=Edited()), sample=5)
    assert edited.unexplained
    assert "another CPU is possible" in edited.causes[-1]


def test_an_archive_of_the_first_format_is_verified() -> None:
    archive = load(Path(__file__).parents[1] / "data" / "format-1", domain=RoughArm())
    result = verify(archive, sample=None)
    assert not result.unverified
    assert result.sampled_births == 1000
    # Whatever the machine: how an arm's hand is rounded may differ, its record and its search may not.
    assert {check.group for check in result.mismatched} <= {"births evaluated", "elites evaluated"}
    assert all((check.difference or 0.0) < 1e-12 for check in result.mismatched)


@pytest.fixture(scope="module")
def merged(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    folder = tmp_path_factory.mktemp("merged")
    built(folder / "5")
    built(folder / "6", replace(CONFIG, seed=6, evaluations=200, batch=20))
    merge([folder / "5", folder / "6"], folder / "both")
    built(folder / "7", replace(CONFIG, seed=7, evaluations=100))
    merge([folder / "7", folder / "both"], folder / "all")
    return load(folder / "all", domain=RoughArm())


def test_merged_archives_are_verified_run_by_run(merged: Archive) -> None:
    result = verify(merged, sample=None)
    assert result.ok, found(result)
    assert not result.unverified
    assert result.sampled_births == 100 + 333 + 200


@pytest.mark.parametrize("first", [0, 100, 433])
def test_forgeries_in_a_merged_archive_are_named(first: int, merged: Archive, tmp_path: Path) -> None:
    forgery = Forgery(merged)
    births = forgery.births
    row = next(k for k, uid in enumerate(forgery.state.elites.uid) if first <= uid < first + 100)
    uid = int(forgery.state.elites.uid[row])
    forgery.elite(row, genotype=_one_weight(forgery.state.elites.genotype[row]))
    other = next(u for u in range(first, first + 90) if births.loc[u, "failed"] is None and u != uid)
    forgery.set(other, objective=_nudged(births.loc[other, "objective"]))
    names = found(verify(forgery.sealed(tmp_path), sample=None))
    assert names["genotypes of elites grow from their roots"] == (uid,)
    assert other in names["births have the recorded objective"]


def test_runs_that_overlap(merged: Archive, tmp_path: Path) -> None:
    forgery = Forgery(merged)
    assert forgery.meta.origin is not None
    runs = [dict(run) for run in forgery.meta.origin["runs"]]
    runs[1]["births"] += 1
    forgery.meta = replace(forgery.meta, origin={"kind": "merged", "runs": runs})
    try:
        result = verify(forgery.sealed(tmp_path))
    except ArchiveError:
        return
    assert "runs follow one another" in found(result)
    assert "it is not known which births are of which run" in result.unverified[-1]


def test_an_unknown_domain_leaves_the_record_and_the_search(genuine: Archive, tmp_path: Path) -> None:
    forgery = Forgery(genuine)
    forgery.meta = replace(forgery.meta, config=replace(CONFIG, domain="somebody's"))
    forgery.sealed(tmp_path)
    result = verify(tmp_path)
    assert result.ok
    assert {check.group for check in result.checks} == {"record", "search"}
    (reason,) = result.unverified
    assert 'genotypes and evaluations: domain is "somebody\'s"' in reason
    assert (result.sampled_births, result.sampled_elites) == (0, 0)


def test_a_domain_of_another_length_is_not_verified(genuine: Archive) -> None:
    result = verify(load(genuine.folder, domain=PlanarArm(joints=4)))
    assert "genotypes of 10 parameters, but arm has 4" in result.unverified[0]
    assert result.ok


def test_imported_births_are_verified_as_far_as_they_go(tmp_path: Path) -> None:
    from nichechain.archive import Columns, import_births
    from nichechain.niches import GridNiches

    (tmp_path / "log.csv").write_text("px,py,x,y\n,,0.1,0.2\n0.1,0.2,0.5,-0.5\n0.1,0.2,,\n")
    niches = GridNiches((6, 5), ((-0.7, 1.0), (-0.9, 0.8)))
    columns = Columns(parent=("px", "py"), child=("x", "y"))
    import_births(tmp_path / "log.csv", tmp_path / "archive", niches, columns=columns)
    result = verify(tmp_path / "archive")
    assert result.ok
    assert "the births were imported" in result.unverified[0]
    forgery = Forgery(load(tmp_path / "archive"))
    forgery.set(1, child_niche=3)
    assert found(verify(forgery.sealed(tmp_path / "forged"))) == {
        "a birth's niche is that of its behavior": (1,)
    }


def test_a_genotype_that_cost_a_worker_is_left_alone(forgery: Forgery, tmp_path: Path) -> None:
    failed = forgery.births["uid"][forgery.births["failed"].notna()].tolist()
    forgery.set(failed[0], failed=WORKER_DIED)
    forgery.set(failed[1], failed=WORKER_DIED)
    result = verify(forgery.sealed(tmp_path), sample=None)
    assert result.ok
    assert result.sampled_births == 333 - 2
    assert result.unverified == ("2 births that cost a worker: evaluating them could end this process",)


@pytest.mark.parametrize(
    ("values", "said"),
    [({"sample": -1}, "sample is -1, but must not be negative"), ({"seed": -2}, "seed is -2")],
)
def test_bad_values_are_refused(values: dict[str, int], said: str, genuine: Archive) -> None:
    with pytest.raises(NichechainError, match=said):
        verify(genuine, **values)  # type: ignore[arg-type]


def test_checksums_come_first(genuine: Archive, tmp_path: Path) -> None:
    for path in genuine.folder.rglob("*.*"):
        copy = tmp_path / path.relative_to(genuine.folder)
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(path.read_bytes())
    (part,) = (tmp_path / "births").glob("*.parquet")
    content = bytearray(part.read_bytes())
    content[100] ^= 1
    part.write_bytes(content)
    with pytest.raises(ArchiveError, match=part.name):
        verify(tmp_path)
    with pytest.raises(ArchiveError, match="no such folder"):
        verify(tmp_path / "nowhere")


def test_json_has_every_check(genuine: Archive) -> None:
    import json

    content = json.loads(json.dumps(verify(genuine, sample=3).to_json()))
    assert content["ok"] is True
    assert content["unexplained"] == content["causes"] == []
    assert len(content["checks"]) > 30
    assert BuildConfig.from_json(genuine.config.to_json()) == genuine.config
