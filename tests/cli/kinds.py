"""Small archives of every kind, and questions of every command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from nichechain.cli import main

ARM = (
    "build",
    "arm",
    "--evaluations",
    "600",
    "--initial",
    "60",
    "--scale",
    "0.3",
    "--grid",
    "5x5",
    "--workers",
    "1",
)
POLE = (
    *("build", "gym:CartPole-v1", "--evaluations", "160", "--initial", "40", "--controller", "mlp:4"),
    *("--steps", "8", "--workers", "1"),
)
BUILDS: dict[str, tuple[str, ...]] = {
    "state": (*ARM, "--seed", "5"),
    "other": (*ARM, "--seed", "6"),
    "absorb": (*ARM, "--outside", "absorb", "--bounds=-.5,1,-.5,.5"),
    "clip": (*ARM, "--outside", "clip", "--bounds=-.5,1,-.5,.5"),
    "noisy": (*ARM, "--noise", "action:0.1", "--repeats", "2"),
    "cvt": (*ARM[:-4], "--niches", "cvt:20", "--workers", "1"),
    "self-adaptive": (*ARM, "--self-adaptive"),
    "1-D": ("build", "linear", "--evaluations", "300", "--grid", "8", "--scale", "0.3", "--workers", "1"),
    "3-D": (
        *POLE,
        "--grid",
        "3x3x3",
        "--descriptor",
        "final-observation:0,1,2",
        "--bounds=-.2,.2,-1,1,-.2,.2",
    ),
    "6-D": (
        *("build", "gym:Acrobot-v1", "--evaluations", "160", "--initial", "40", "--controller", "mlp:4"),
        *(
            "--steps",
            "5",
            "--grid",
            "3x3x3x3x3x3",
            "--descriptor",
            "final-observation:0,1,2,3,4,5",
            "--workers",
            "1",
        ),
        "--bounds=-1,1,-1,1,-1,1,-1,1,-12.6,12.6,-28.3,28.3",
    ),
    "all outside": (*ARM, "--bounds=5,6,5,6"),
}


def _merged(root: Path, out: Path) -> None:
    assert main(["merge", str(made(root, "state")), str(made(root, "other")), "--out", str(out)]) == 0


def _imported(_: Path, out: Path) -> None:
    rng = np.random.default_rng(0)
    log = out.with_suffix(".csv")
    rows = [f"{p},{c}" for p, c in rng.integers(0, 6, (400, 2))]
    log.write_text("\n".join(["parent_niche,child_niche", *rows]))
    assert main(["import", str(log), "--grid", "3x2", "--bounds", "0,3,0,2", "--out", str(out)]) == 0


def _recorded(_: Path, out: Path) -> None:
    from ribs.archives import GridArchive
    from ribs.emitters import GaussianEmitter
    from ribs.schedulers import Scheduler

    from nichechain.pyribs import from_ribs, record

    archive = GridArchive(solution_dim=4, dims=(5, 5), ranges=((-1, 1), (-1, 1)), seed=1)
    start = np.random.default_rng(2).uniform(-1, 1, (20, 4))
    scheduler = Scheduler(
        archive, [GaussianEmitter(archive, sigma=0.3, initial_solutions=start, batch_size=20, seed=3)]
    )
    recording = record(scheduler)
    for _step in range(12):
        solutions = scheduler.ask()
        angles = np.cumsum(solutions, axis=1)
        measures = np.stack([np.cos(angles).mean(axis=1), np.sin(angles).mean(axis=1)], axis=1)
        scheduler.tell(-solutions.var(axis=1), measures)
    from_ribs(recording, out)


MADE: dict[str, Callable[[Path, Path], None]] = {
    "merged": _merged,
    "imported": _imported,
    "recorded": _recorded,
}
KINDS = (*(kind for kind in BUILDS if kind != "other"), *MADE)


def made(root: Path, kind: str) -> Path:
    """The archive of that kind, built when it is first asked for."""
    out = root / kind.replace(" ", "-")
    if not (out / "meta.json").exists():
        if kind in MADE:
            MADE[kind](root, out)
        else:
            assert main([*BUILDS[kind], "--out", str(out)]) == 0
    return out


_PLOTS = (
    *("elites", "visits", "evolvability", "uncertainty", "growth", "reach", "reachability", "wormholes"),
    *("classes", "transitions", "transitions-by-class"),
)
_QUICK = ("--l", "2", "--lineages", "10")

QUESTIONS: dict[str, tuple[str, ...]] = {
    "info": ("info", "{archive}"),
    "info as JSON": ("info", "{archive}", "--json"),
    "evolvability": ("evolvability", "{archive}", *_QUICK, "--draws", "5", "--min-births", "1"),
    "evolvability of a niche": ("evolvability", "{archive}", *_QUICK, "--niche", "{niche}", "--draws", "5"),
    "evolvability of outside": ("evolvability", "{archive}", *_QUICK, "--niche", "outside", "--draws", "5"),
    "evolvability of an elite": (
        *("evolvability", "{archive}", *_QUICK, "--elite", "{niche}", "--draws", "5", "--offspring", "4"),
        *("--workers", "1"),
    ),
    "evolvability of the outside elite": (
        *("evolvability", "{archive}", *_QUICK, "--elite", "outside", "--draws", "5", "--offspring", "4"),
        *("--workers", "1"),
    ),
    "evolvability by mle": ("evolvability", "{archive}", *_QUICK, "--estimator", "mle"),
    "evolvability by bootstrap": (
        *("evolvability", "{archive}", *_QUICK, "--uncertainty", "bootstrap", "--repeats", "3"),
    ),
    "list": ("list", "{out}"),
    "table": ("table", "{archive}", *_QUICK, "--draws", "3", "--children", "2"),
    "table by mle": ("table", "{archive}", *_QUICK, "--estimator", "mle", "--format", "csv"),
    "landscape": (
        *("landscape", "{archive}", *_QUICK, "--offspring", "4", "--elites", "3", "--workers", "1"),
        *("--out", "{out}/landscape.csv", "--min-births", "1"),
    ),
    "estimate": ("estimate", "{archive}"),
    "estimate --compare": ("estimate", "{archive}", "--compare", "--folds", "2"),
    "estimate --stability": ("estimate", "{archive}", "--stability", "--repeats", "2", "--min-births", "1"),
    "compare": ("compare", "{archive}", "{archive}", *_QUICK, "--resamples", "5"),
    "compare with another": ("compare", "{archive}", "{other}", *_QUICK, "--resamples", "5"),
    "verify": ("verify", "{archive}", "--sample", "4", "--workers", "1"),
    "merge": ("merge", "{archive}", "{other}", "--out", "{out}/merged"),
    "import": ("import", "{births}", "--grid", "5x5", "--bounds=-1,1,-1,1", "--out", "{out}/imported"),
    "watch": ("watch", "{archive}", "--niche", "{niche}", "--out", "{out}/arm.png"),
    "explore": ("explore", "{archive}", *_QUICK, "--draws", "3", "--out", "{out}/explore.html"),
    "sweep": (
        *("sweep", "{archive}", *_QUICK, "--sizes", "2,3", "--draws", "3", "--min-births", "1"),
        *("--out", "{out}/sweep.png"),
    ),
    "validate": (
        *("validate", "{archive}", "--elites", "3", "--lineages", "3", "--l", "2", "--permutations", "9"),
        *("--workers", "1", "--out", "{out}/validation"),
    ),
    "walks from its elites": (
        *(
            "walks",
            "pressure",
            "arm",
            "--runs",
            "2",
            "--offspring",
            "3",
            "--initialisation",
            "elites:{archive}",
        ),
        *("--grid", "3x3", "--bounds=-1,1,-1,1", "--steps", "2", "--workers", "1", "--out", "{out}/walks"),
    ),
    **{
        f"plot {kind}": (
            "plot",
            "{archive}",
            kind,
            *_QUICK,
            "--out",
            f"{{out}}/{kind}.png",
            "--min-births",
            "1",
        )
        for kind in _PLOTS
    },
}
