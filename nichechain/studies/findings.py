"""What reproduced and what did not, in words that the numbers decide by fixed rules."""

from __future__ import annotations

from dataclasses import dataclass

from nichechain.core.text import rounded
from nichechain.studies import paper
from nichechain.studies.analysis import Analysis, Asked
from nichechain.studies.results import Effect, Interval

ALPHA = 0.05
"""Level of significance, the paper's."""

RULES = (
    f"A correlation or a difference is reproduced if it has the paper's sign and p < {ALPHA}, and is the "
    f"opposite if it has the other sign and p < {ALPHA}.",
    "A gain or a loss is reproduced if the 95 % interval of the mean change within runs lies on its "
    "side of 0; each interval is by itself, not adjusted for their number.",
    "Else it is not found, which is no proof that it is not there: fewer runs find less.",
    "An order of means agrees or differs by the means alone, whether or not a test tells them apart.",
)

REPRODUCED, OPPOSITE, NOT_FOUND = "reproduced", "the opposite", "not found"
AGREES, DIFFERS, NEITHER, OPEN = "agrees", "differs", "significant in neither", "cannot be said yet"


@dataclass(frozen=True)
class Finding:
    """A statement of the paper beside ours.

    Parameters
    ----------
    claim : str
        What the paper says.
    paper, ours : str
        The numbers.
    verdict : str
    """

    claim: str
    paper: str
    ours: str
    verdict: str


def find(analysis: Analysis) -> tuple[Finding, ...]:
    """What the finished runs say to each statement of the paper on this kind of study.

    Parameters
    ----------
    analysis : Analysis

    Returns
    -------
    tuple of Finding
        Empty for a sensitivity study, on which the paper has no numbers.
    """
    if analysis.study.kind == "pressure":
        return _pressure(analysis)
    if analysis.study.kind == "metrics":
        return tuple(finding for step in reversed(analysis.steps) for finding in _metrics(analysis, step))
    return ()


def with_interval(effect: Effect) -> str:
    """The value of an effect with its interval."""
    if effect.interval is None:
        return rounded(effect.value)
    return f"{rounded(effect.value)} [{rounded(effect.interval.low)}, {rounded(effect.interval.high)}]"


def _pressure(analysis: Analysis) -> tuple[Finding, ...]:
    step = analysis.last
    found = [_trend(analysis, step)]
    found += [_trend(analysis, other) for other in analysis.steps if other != step]
    changes = {asked.conditions[0]: asked for asked in analysis.answers("change", step)}
    levels = {condition.label: condition.level for condition in analysis.study.conditions}
    for level, sign, claim in (
        ("selective", 1, "The highly selective walk gains evolvability"),
        ("random", -1, "The random walk loses evolvability"),
    ):
        label = next((label for label, of in levels.items() if of == level), None)
        if label is not None:
            said = "rises over the steps" if sign > 0 else "clear degradation over the steps"
            found.append(_change(claim, said, changes.get(label), sign, step))
    some = {label: changes.get(label) for label, level in levels.items() if level != "random"}
    if some:
        found.append(_preserved(some, step))
    found += [_same_start(asked, _missing(analysis)) for asked in analysis.answers("groups", 0)]
    return tuple(found)


def _missing(analysis: Analysis) -> list[str]:
    """Conditions without two finished runs: what is said of all of them must wait."""
    return [label for label, n in analysis.finished.items() if n < 2]


def _trend(analysis: Analysis, step: int) -> Finding:
    claim = f"More pressure, more evolvability (Spearman's r over runs at step {step})"
    # The paper tests its last step, which is the one of its figure.
    its = f"r = {paper.PRESSURE_R}, p < {paper.PRESSURE_P:.0e}, step {paper.FIGURE_STEP}"
    (asked,) = analysis.answers("trend", step)
    if asked.test is None:
        return Finding(claim, its, f"no test: {asked.reason}", OPEN)
    test = asked.test
    ours = f"r = {with_interval(test.effect)}, p = {rounded(test.p)}, n = {test.n}"
    missing = _missing(analysis)
    if missing:
        return Finding(claim, its, f"{ours}; without {', '.join(missing)}", OPEN)
    if test.effect.interval is not None:
        ours += f"; the paper's r lies {_where(paper.PRESSURE_R, test.effect.interval)}"
    return Finding(claim, its, ours, _sign_verdict(test.statistic, test.p))


def _change(claim: str, its: str, asked: Asked | None, sign: int, step: int) -> Finding:
    claim = f"{claim} (mean change of η* from step 0 to step {step})"
    if asked is None or asked.test is None:
        reason = "no finished runs" if asked is None else asked.reason
        return Finding(claim, its, f"no test: {reason}", OPEN)
    interval = asked.test.effect.interval
    assert interval is not None
    ours = f"{with_interval(asked.test.effect)}, p = {rounded(asked.test.p)}, n = {asked.test.n}"
    return Finding(claim, its, ours, {sign: REPRODUCED, -sign: OPPOSITE, 0: NOT_FOUND}[_side(interval)])


def _preserved(changes: dict[str, Asked | None], step: int) -> Finding:
    intervals = {
        label: asked.test.effect.interval
        for label, asked in changes.items()
        if asked is not None and asked.test is not None and asked.test.effect.interval is not None
    }
    sides = {label: _side(interval) for label, interval in intervals.items()}
    named = [
        f"{word}: {', '.join(label for label, side in sides.items() if side == wanted)}"
        for wanted, word in ((1, "gain"), (0, "neither shown"), (-1, "loss"))
        if wanted in sides.values()
    ]
    waiting = [label for label in changes if label not in sides]
    if waiting:
        named.append(f"too few runs: {', '.join(waiting)}")
    verdict = DIFFERS if -1 in sides.values() else OPEN if waiting else AGREES
    return Finding(
        f"Even modest pressure preserves or enhances evolvability (levels but random, to step {step})",
        "no level but random loses",
        "; ".join(named),
        verdict,
    )


def _same_start(asked: Asked, missing: list[str]) -> Finding:
    claim = "Walks start from about the same mean evolvability (step 0)"
    if asked.test is None:
        return Finding(claim, "approximately the same", f"no test: {asked.reason}", OPEN)
    ours = f"{asked.test.name}: p = {rounded(asked.test.p)}, n = {asked.test.n}"
    if missing:
        return Finding(claim, "approximately the same", f"{ours}; without {', '.join(missing)}", OPEN)
    return Finding(claim, "approximately the same", ours, DIFFERS if asked.test.p < ALPHA else AGREES)


def _metrics(analysis: Analysis, step: int) -> list[Finding]:
    """Statements on the paper's metrics alone, without any that were walked besides."""
    answers = [a for a in analysis.answers("groups", step) if set(a.conditions) <= set(paper.METRICS)]
    at = f"step {step}"
    its_step = f"step {paper.METRICS_STEP}"
    claim = f"The metric makes a difference ({at})"
    its = f"Kruskal-Wallis p = {paper.METRICS_P}, {its_step}"
    if not answers or answers[-1].groups is None:
        reason = answers[-1].reason if answers else "none of the paper's metrics has two finished runs"
        return [Finding(claim, its, f"no test: {reason}", OPEN)]
    asked, groups = answers[-1], answers[-1].groups
    assert groups is not None
    test = groups.test
    ours = (
        f"{test.name} p = {rounded(test.p)}, {test.symbol} = {rounded(test.statistic)}, "
        f"{test.effect.name} = {with_interval(test.effect)}, n = {test.n}"
    )
    if len(asked.conditions) < len(paper.METRICS):
        ours += f"; only {', '.join(asked.conditions)}"
    found = [Finding(claim, its, ours, REPRODUCED if test.p < ALPHA else NOT_FOUND)]
    for pair in groups.pairs:
        its_p = paper.METRICS_HOLM.get((pair.first, pair.second))
        flipped = paper.METRICS_HOLM.get((pair.second, pair.first))
        if its_p is None and flipped is None:
            continue
        p = flipped if its_p is None else its_p
        assert p is not None
        kde_leads = pair.effect.value > 0 if pair.first == "kde" else pair.effect.value < 0
        found.append(
            Finding(
                f"{pair.first} against {pair.second} ({at})",
                f"p = {rounded(p) if p == 1 else p}, {its_step}",
                f"p = {rounded(pair.p)}, {pair.effect.name} = {with_interval(pair.effect)}",
                _pair_verdict(p < ALPHA, pair.p < ALPHA, kde_leads),
            )
        )
    if len(asked.conditions) == len(paper.METRICS):
        means = {label: analysis.summary(label, step).mean for label in asked.conditions}
        best, worst = max(means, key=means.__getitem__), min(means, key=means.__getitem__)
        listed = ", ".join(f"{label} {rounded(mean)}" for label, mean in means.items())
        for wanted, got, claim in (
            ("kde", best, "KDE dominates (largest mean η*)"),
            ("knn-no-archive", worst, "kNN without archive is lowest (smallest mean η*)"),
        ):
            verdict = AGREES if got == wanted else DIFFERS
            found.append(Finding(f"{claim} ({at})", wanted, f"{got} of {listed}", verdict))
    return found


def _pair_verdict(its: bool, ours: bool, kde_leads: bool) -> str:
    """Whether two metrics differ; where the paper's do, the KDE metric is the larger."""
    if its and ours:
        return REPRODUCED if kde_leads else OPPOSITE
    if its:
        return NOT_FOUND
    return DIFFERS if ours else NEITHER


def _sign_verdict(statistic: float, p: float) -> str:
    if p >= ALPHA:
        return NOT_FOUND
    return REPRODUCED if statistic > 0 else OPPOSITE


def _side(interval: Interval) -> int:
    """On which side of 0 an interval lies, 0 where it holds it."""
    return int(interval.low > 0) - int(interval.high < 0)


def _where(value: float, interval: Interval) -> str:
    if value in interval:
        return "inside this interval"
    return "above it" if value > interval.high else "below it"
