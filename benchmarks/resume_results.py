"""A folder for ``nichechain walks resume`` with the runs of a shipped result already in it.

``python benchmarks/resume_results.py examples/results/pressure FOLDER`` and then
``nichechain walks resume FOLDER --runs 50`` walk the runs that are missing. Shipped results have no
births, so the folder has those of the new runs only. ``--metrics parent`` adds what a study of metrics
lacks.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import pyarrow.compute as pc
import pyarrow.parquet as pq

from nichechain.core.machine import library_versions
from nichechain.studies import Study
from nichechain.studies.study import metric_conditions


def main() -> None:
    """Lay out the folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("result", type=Path, help="folder with records.parquet and statistics.json")
    parser.add_argument("folder", type=Path, help="to make")
    parser.add_argument("--metrics", default="", help="to compare as well, separated by commas")
    given = parser.parse_args()
    shipped = json.loads((given.result / "statistics.json").read_text("utf-8"))
    old = Study.from_json(shipped["study"])
    others = metric_conditions([name for name in given.metrics.split(",") if name], old.conditions[0])
    study = replace(old, conditions=(*old.conditions, *others))
    records = pq.read_table(given.result / "records.parquet")
    given.folder.mkdir(parents=True)
    for name in ("records", "births"):
        (given.folder / name).mkdir()
    about = {
        "format": 1,
        "study": study.to_json(),
        "unit": study.make_domain().unit,
        "versions": library_versions(),
    }
    (given.folder / "study.json").write_text(json.dumps(about, indent=1), "utf-8")
    for condition in old.conditions:
        rows = records.filter(pc.equal(records["condition"], condition.label)).drop_columns(["condition"])
        last = pc.max(rows["run"]).as_py()
        name = f"{condition.slug}-0000-{last:04d}.parquet"
        pq.write_table(rows, given.folder / "records" / name, compression="zstd", write_page_checksum=True)


if __name__ == "__main__":
    main()
