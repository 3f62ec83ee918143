"""Whether the numbers are right: predictions beside what real lineages reached.

    python benchmarks/truth.py make [--only NAME ...] [--workers N]
    python benchmarks/truth.py score [--only NAME ...] [--estimators NAME ...] [--births N ...]
                                     [--share S ...] [--prototype MODULE:FUNCTION ...]
    python benchmarks/truth.py report [--out examples/results/truth]

``make`` builds the archives of ``truth_data.py`` and runs lineages without selection from 100
elites of each; ``score`` judges estimators by them, see ``truth_scores.py``; ``report`` writes the
tables. All of it goes on where it was interrupted, from what ``--folder`` holds. Arms and maps take
seconds, mazes a quarter of an hour each and Fetch half an hour each on two processors.

Data sets for development may be looked at while an estimator is made. Those held out are left
out unless ``--held-out`` asks for them: they are for the last look at an estimator that is frozen.
"""

from __future__ import annotations

import argparse
import importlib
import itertools
import time
from pathlib import Path

import pandas as pd
from truth_data import BIRTHS, DATASETS, load, make
from truth_models import ESTIMATORS, Estimator
from truth_scores import score, thinned

from nichechain import execution

_LEVELS = (1, 2, 3, 4, 5, 10)
_FEWEST = 2_000
_HEAD = """# Predictions beside what real lineages reached

Made by `benchmarks/truth.py`, which says how; every figure is in `scores.csv` and `thinned.csv`.

- *level*: niches predicted over niches reached, both means over elites, after l generations.
- *covered*: share of elites whose number lies in the 90 % interval of what as many simulated lineages
  reach. An interval of the expected number alone would be too narrow for one observed number.
- *ρ*: Spearman's correlation at l = 5, beside its ceiling, that of full knowledge of every elite.
- *births*, *steps*: means of the logarithm of the probability of held-out births, and of steps of the
  lineages.
- *of lineages*: share of the births that were spent on lineages without selection.

With 8,000 or 2,000 births an estimator is given the first births of the archive, while the lineages
begin at elites of the whole one. So those rows show two things together: fewer births, and what
changes over the course of a search."""
_THINNED_HEAD = """Mean niche l-evolvability of the same niches at l = 5, three times for each kind of fifth.
*inside*: how often the number from all births lies in the interval."""


def main() -> None:
    """Do what is asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("verb", choices=("make", "score", "report"))
    parser.add_argument(
        "--folder", type=Path, default=Path("build/truth"), help="where data sets and scores are kept"
    )
    parser.add_argument("--only", nargs="+", choices=tuple(DATASETS), help="these data sets")
    parser.add_argument("--held-out", action="store_true", help="those held out as well")
    parser.add_argument("--workers", default=None, help="as nichechain has it, such as 4 or processes:4")
    parser.add_argument("--estimators", nargs="+", default=["empirical-bayes", "mle"])
    parser.add_argument("--prototype", nargs="+", default=[], metavar="MODULE:FUNCTION")
    parser.add_argument("--births", nargs="+", type=int, default=[40_000, 8_000, _FEWEST])
    parser.add_argument("--share", nargs="+", type=float, default=[0.0], help="births spent on lineages")
    parser.add_argument("--again", action="store_true", help="score anew what was scored before")
    parser.add_argument("--out", type=Path, default=Path("examples/results/truth"))
    given = parser.parse_args()
    names = given.only or [name for name, data in DATASETS.items() if data.development or given.held_out]
    if given.verb == "make":
        with execution.make(given.workers) as executor:
            for name in names:
                make(name, given.folder, executor, _tell)
    elif given.verb == "score":
        estimators = {name: ESTIMATORS[name] for name in given.estimators}
        estimators |= {text.partition(":")[2]: _prototype(text) for text in given.prototype}
        for name in names:
            for split in DATASETS[name].splits:
                _score(given, name, split, estimators)
    else:
        _report(given.folder, names, given.out)


def _score(given: argparse.Namespace, name: str, split: str, estimators: dict[str, Estimator]) -> None:
    truth = load(name, given.folder, split)
    if truth is None:
        _tell(f"{name} {split}: not made yet")
        return
    for label, births, share in itertools.product(estimators, given.births, given.share):
        if share and truth.extra is None:
            continue
        about = {"data": name, "split": split, "births": births, "share": share, "estimator": label}
        for kind, (judge, line) in _KINDS.items():
            if kind == "thinned" and births < BIRTHS:
                continue
            path = given.folder / name / kind / f"{split}-{births}-{share:g}-{label}.parquet"
            if given.again or not path.exists():
                frame = judge(estimators[label], truth, births, share)
                for place, (column, value) in enumerate(about.items()):
                    frame.insert(place, column, value)
                path.parent.mkdir(exist_ok=True)
                frame.to_parquet(path)
            _tell(" ".join(map(str, about.values())) + line(pd.read_parquet(path)))


def _scores_line(frame: pd.DataFrame) -> str:
    """The most telling figures."""
    text = ""
    for start, rows in frame.groupby("start", sort=False):
        levels = " ".join(f"{value:.2f}" for value in rows["level"])
        five = rows.set_index("generation").loc[5]
        text += (
            f" | {start} {levels} covered {five.covered:.2f} "
            f"rho {five.spearman:.2f} (model {five.expected:.2f}, ceiling {five.ceiling:.2f})"
        )
    first = frame.iloc[0]
    return (
        f"{text} | births {first.births_log:.3f} steps {first.steps_log:.3f} "
        f"| fit {first.fit:.2g} s, forecast {first.forecast:.2g} s"
    )


def _thinned_line(frame: pd.DataFrame) -> str:
    text = f" | all {frame.whole[0]:.1f}"
    for kept, rows in frame.groupby("kept"):
        text += f" | a fifth of {kept}:"
        text += ",".join(f" {r.fifth:.1f} [{r.low:.1f}, {r.high:.1f}]" for r in rows.itertuples())
    return text


_KINDS = {"scores": (score, _scores_line), "thinned": (thinned, _thinned_line)}


def _report(folder: Path, names: list[str], out: Path) -> None:
    """Tables of all scores: two with every figure, and ``report.md`` to be read."""
    scores, fifths = (_read(folder, names, kind) for kind in _KINDS)
    out.mkdir(parents=True, exist_ok=True)
    scores.round(5).to_csv(out / "scores.csv", index=False)
    fifths.round(5).to_csv(out / "thinned.csv", index=False)
    text = [_HEAD]
    for development, title in ((True, "For development"), (False, "Held out")):
        chosen = scores[scores["development"] == development]
        if len(chosen):
            text += ["", f"## {title}", "", *_table(chosen)]
    if len(fifths):
        text += [
            "",
            "## From a fifth of the births, or of the elites",
            "",
            _THINNED_HEAD,
            "",
            *_fifths(fifths),
        ]
    (out / "report.md").write_text("\n".join(text) + "\n")


def _read(folder: Path, names: list[str], kind: str) -> pd.DataFrame:
    parts = [pd.read_parquet(p) for name in names for p in sorted((folder / name / kind).glob("*.parquet"))]
    if not parts:
        raise SystemExit(f"{folder} holds no {kind}: run score first")
    whole = pd.concat(parts, ignore_index=True)
    whole.insert(1, "development", [DATASETS[name].development for name in whole["data"]])
    return whole


def _fifths(frame: pd.DataFrame) -> list[str]:
    lines = ["data | of lineages | estimator | from all | a fifth of | from a fifth [90 %] | inside"]
    lines.append(" | ".join(["---"] * 7))
    for (data, split, share, estimator, kept), rows in frame.groupby(
        ["data", "split", "share", "estimator", "kept"], sort=False
    ):
        parts = ", ".join(f"{r.fifth:.1f} [{r.low:.1f}, {r.high:.1f}]" for r in rows.itertuples())
        cells = [f"{data} {split}", f"{share:.0%}", estimator, f"{rows.whole.iloc[0]:.1f}", kept, parts]
        lines.append(" | ".join([*cells, f"{rows.inside.sum()} of {len(rows)}"]))
    return [f"| {line} |" for line in lines]


def _table(scores: pd.DataFrame) -> list[str]:
    head = ["data", "births", "of lineages", "estimator", "start"]
    head += [f"level l = {level}" for level in _LEVELS]
    head += ["bias l = 5 [95 %]", "covered l = 1", "l = 5", "ρ / ceiling", "births", "steps"]
    lines = [" | ".join(head), " | ".join("---" for _ in head)]
    by = ["data", "split", "births", "share", "estimator", "start"]
    for (data, split, births, share, estimator, start), rows in scores.groupby(by, sort=False):
        at = rows.set_index("generation")
        five = at.loc[5]
        cells = [f"{data} {split}", f"{births:,}", f"{share:.0%}", estimator, start]
        cells += [f"{at.loc[level, 'level']:.2f}" for level in _LEVELS]
        cells += [f"{five.bias:+.1f} [{five.bias_low:+.1f}, {five.bias_high:+.1f}]"]
        cells += [
            f"{at.loc[1, 'covered']:.2f}",
            f"{five.covered:.2f}",
            f"{five.spearman:.2f} / {five.ceiling:.2f}",
        ]
        cells += [f"{five.births_log:.3f}", f"{five.steps_log:.3f}"]
        lines.append(" | ".join(cells))
    return [f"| {line} |" for line in lines]


def _prototype(text: str) -> Estimator:
    module, _, name = text.partition(":")
    estimator: Estimator = getattr(importlib.import_module(module), name)
    return estimator


def _tell(text: str) -> None:
    print(time.strftime("%H:%M:%S"), text, flush=True)


if __name__ == "__main__":
    main()
