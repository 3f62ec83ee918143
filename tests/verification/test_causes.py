"""Where evaluations differ: which of domain, library and machine may be the cause, and what explains none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nichechain.archive.archive import Archive, load
from nichechain.archive.read import checksum
from nichechain.core.machine import library_versions
from nichechain.verification import verify, verifying

from ..arms import RoughArm
from .forgeries import Forgery, found


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
    forgery.set(forgery.fine(), depth=1)
    archive = forgery.sealed(tmp_path)
    changed = dict.fromkeys(library_versions(), "9.9")
    monkeypatch.setattr("nichechain.verification.verifying.library_versions", lambda: changed)
    result = verify(archive, sample=5)
    assert [check.group for check in result.unexplained] == ["record"]


def test_an_archive_that_does_not_tell_its_machine(genuine: Archive, tmp_path: Path) -> None:
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
