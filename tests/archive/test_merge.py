"""Archives of several runs as one: what adds, what wins, what is refused."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import nichechain as nc
from nichechain.archive import read
from nichechain.archive.merge import merge
from nichechain.core.errors import ArchiveError, NichechainError

CONFIG = nc.BuildConfig(
    "arm", (5, 4), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=300, initial=40, batch=32, scale=0.5
)


def built(folder, **changes):
    with nc.Threads(1) as threads:
        nc.build(replace(CONFIG, **changes), folder, threads)
    return folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    root = tmp_path_factory.mktemp("merging")
    return [built(root / f"seed{seed}", seed=seed, evaluations=300 + 10 * seed) for seed in range(3)]


def merged(folders, out):
    merge(folders, out)
    return nc.load(out)


def test_counts_are_the_sum_of_the_parts(runs, tmp_path):
    whole = merged(runs, tmp_path / "all")
    parts = [nc.load(run) for run in runs]
    pooled = parts[0].counts + parts[1].counts + parts[2].counts
    np.testing.assert_array_equal(whole.counts.matrix.toarray(), pooled.matrix.toarray())
    np.testing.assert_array_equal(whole.counts.visits, pooled.visits)
    # Elites of different runs stay apart, whatever their numbers.
    assert sorted(map(tuple, whole.counts.families[:, [0, 2, 3]])) == sorted(
        map(tuple, pooled.families[:, [0, 2, 3]])
    )
    for number, part in enumerate(parts):
        np.testing.assert_array_equal(
            whole.counts_of(run=number).matrix.toarray(), part.counts.matrix.toarray()
        )


def test_births_are_those_of_the_parts_numbered_on(runs, tmp_path):
    whole = merged(runs, tmp_path / "all")
    births = whole.births()
    assert births["uid"].tolist() == list(range(930))
    assert births.groupby("run").size().tolist() == [300, 310, 320]
    for number, run in enumerate(runs):
        first = whole.meta.origin["runs"][number]["first_uid"]
        own = births[births["run"] == number].reset_index(drop=True)
        own = own.assign(run=0, uid=own["uid"] - first, parent_uid=own["parent_uid"] - first)
        pd.testing.assert_frame_equal(own, nc.load(run).births(), check_dtype=False)


@pytest.mark.parametrize("replacement", ["random", "first", "newest", "objective"])
def test_elites_have_the_largest_key_of_all(tmp_path, replacement):
    parts = [built(tmp_path / f"{seed}", seed=seed, replacement=replacement) for seed in range(2)]
    whole = merged(parts, tmp_path / "all")
    births = whole.births().set_index("uid")
    archives = [nc.load(part) for part in parts]
    for row, state in enumerate(whole.elites.niche.tolist()):
        rivals = [
            (archive.elites.key[k], -run, archive.elites.genotype[k])
            for run, archive in enumerate(archives)
            for k in np.flatnonzero(archive.elites.niche == state)
        ]
        key, _, genotype = max(rivals, key=lambda rival: rival[:2])
        assert whole.elites.key[row] == key
        np.testing.assert_array_equal(whole.elites.genotype[row], genotype)
        # Its number is that of its birth.
        birth = births.loc[whole.elites.uid[row]]
        assert birth["child_niche"] == state
        assert [birth["behavior_x"], birth["behavior_y"]] == whole.elites.behavior[row].tolist()
    assert set(whole.elites.niche) == {
        state for archive in archives for state in archive.elites.niche.tolist()
    }


def test_order_and_grouping_do_not_matter(runs, tmp_path):
    forth = merged(runs, tmp_path / "forth")
    back = merged(runs[::-1], tmp_path / "back")
    merge(runs[1:], tmp_path / "pair")
    grouped = merged([runs[0], tmp_path / "pair"], tmp_path / "grouped")
    for other in (back, grouped):
        np.testing.assert_array_equal(other.counts.matrix.toarray(), forth.counts.matrix.toarray())
        np.testing.assert_array_equal(other.elites.genotype, forth.elites.genotype)
        np.testing.assert_array_equal(other.elites.key, forth.elites.key)
    assert grouped.births().equals(forth.births())
    assert grouped.meta.origin == forth.meta.origin


def test_no_build_goes_on_with_it(runs, tmp_path):
    whole = merged(runs, tmp_path / "all")
    with (
        nc.Threads(1) as threads,
        pytest.raises(ArchiveError, match="was merged, so no build can go on with it"),
    ):
        nc.build(replace(whole.config, evaluations=2000), whole.folder, threads)
    # But all else is there.
    assert (
        whole.domain.evaluate(whole.elites.genotype[:1]).behavior[0].tolist()
        == whole.elites.behavior[0].tolist()
    )
    assert whole.chain().counts.births.sum() == whole.counts.births.sum()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"domain_seed": 1}, "has domain_seed 0 and .* has 1"),
        ({"shape": (4, 5)}, r"has shape \(5, 4\) and .* has \(4, 5\)"),
        ({"bounds": ((-1, 1), (-1, 1))}, "has bounds"),
        ({"outside": "clip"}, "has outside state and .* has clip"),
        ({"mutation": "gaussian"}, "has mutation cauchy and .* has gaussian"),
        ({"scale": 0.4}, "has scale 0.5 and .* has 0.4"),
        ({"replacement": "first"}, "has replacement random and .* has first"),
        ({"evaluations": 200}, "both have the run of seed 0"),
    ],
)
def test_archives_that_do_not_belong_together(runs, tmp_path, changes, said):
    other = built(tmp_path / "other", **({"seed": 7} if "evaluations" not in changes else {}), **changes)
    with pytest.raises(NichechainError, match=said):
        merge([runs[0], other], tmp_path / "all")
    assert not (tmp_path / "all").exists()


@pytest.mark.parametrize(
    ("name", "row", "value", "said"),
    [
        ("uid", 60, 59, "does not number its births from 0, each once"),
        ("parent_uid", 60, 60, "parents are no earlier births"),
        ("parent_uid", 60, 299, "parents are no earlier births"),
        ("parent_uid", 60, -7, "parents are no earlier births"),
        ("parent_uid", 60, 10**12, "parents are no earlier births"),
    ],
)
def test_a_record_that_no_search_leaves_is_refused(runs, tmp_path, monkeypatch, name, row, value, said):
    read_births = read.read_births

    def forged(folder, meta):
        births = read_births(folder, meta)
        column = births[name].to_pylist()
        column[row] = value
        place = births.column_names.index(name)
        return births.set_column(place, births.schema.field(name), pa.array(column, pa.int64()))

    monkeypatch.setattr(read, "read_births", forged)
    with pytest.raises(ArchiveError, match=said):
        merge(runs[:2], tmp_path / "all")
    assert not (tmp_path / "all").exists()


def test_other_refusals(runs, tmp_path):
    with pytest.raises(NichechainError, match="1 archive cannot be merged"):
        merge(runs[:1], tmp_path / "all")
    with pytest.raises(ArchiveError, match="already holds an archive"):
        merge(runs[:2], runs[2])
    with pytest.raises(ArchiveError, match="no such folder"):
        merge([runs[0], tmp_path / "nowhere"], tmp_path / "all")
    merge(runs[:2], tmp_path / "pair")
    with pytest.raises(NichechainError, match="both have the run of seed 1"):
        merge([tmp_path / "pair", runs[1]], tmp_path / "all")
