"""The comparison of searches, by numbers whose ratios are known, and the one that is shipped."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import direct_search

ROOT = Path(__file__).parents[2]
SHIPPED = ROOT / "examples" / "results" / "direct"


def test_ratios_are_geometric_means_over_seeds():
    rows = pd.DataFrame(
        [
            {"task": "cosinus", "search": name, "seed": seed, **dict.fromkeys(direct_search.MEASURES, value)}
            for seed, plain in enumerate((2.0, 4.0, 8.0))
            for name in direct_search.SEARCHES
            for value in [plain if name == "plain" else plain * (2.0 if seed else 0.5)]
        ]
    )
    found = direct_search.compare(rows)
    other = found[found["search"] != "plain"]
    # 0.5, 2 and 2: a third of their logarithms is log 2.
    np.testing.assert_allclose(other["ratio"], 2.0 ** (1 / 3))
    np.testing.assert_allclose(np.sqrt(other["low"] * other["high"]), other["ratio"])
    assert (found.loc[found["search"] == "plain", ["ratio", "low", "high"]] == 1.0).all(axis=None)


def test_what_is_shipped_follows_from_its_table():
    rows = pd.read_csv(SHIPPED / "measured.csv")
    assert rows.groupby(["task", "search"]).size().nunique() == 1
    told = pd.DataFrame(json.loads((SHIPPED / "statistics.json").read_text()))
    found = direct_search.compare(rows)
    assert told["search"].tolist() == found["search"].tolist()
    for name in ("mean", "ratio", "low", "high"):
        np.testing.assert_allclose(told[name], found[name], rtol=1e-6)
    report = (SHIPPED / "report.md").read_text()
    assert direct_search.report(rows, report.split("`")[-2]) == report


@pytest.mark.parametrize("page", ["docs/concepts/direct.md"])
def test_the_docs_show_the_numbers_of_the_report(page):
    shown = (ROOT / page).read_text()
    for row in json.loads((SHIPPED / "statistics.json").read_text()):
        if row["search"] == "direct, 10 offspring" and row["measure"] != "filled":
            assert f"{row['ratio']:.3f} ({row['low']:.3f} to {row['high']:.3f})" in shown
