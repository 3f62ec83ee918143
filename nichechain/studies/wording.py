"""The report of a study in words and tables, all of them decided by its numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from nichechain.core.intervals import LEVEL
from nichechain.core.text import rounded
from nichechain.landscape import QUANTILES
from nichechain.studies import findings, paper
from nichechain.studies.analysis import MAIN, POPULATION, Analysis, Asked, Summary, tested, varied
from nichechain.studies.conditions import Condition
from nichechain.studies.dissimila import OUTCOMES, Relation
from nichechain.studies.document import (
    Block,
    Bullets,
    Code,
    Document,
    Heading,
    Paragraph,
    Picture,
    Table,
)
from nichechain.studies.findings import with_interval

_LEVEL = f"{100 * LEVEL:.0f} %"
_TITLES = {
    "pressure": "Evolutionary pressure and evolvability",
    "metrics": "Diversity metrics and evolvability",
    "sensitivity": "Evolvability when one setting varies",
    "population": "Diversity metrics and the evolvability of a population",
}
_MEASURES = {POPULATION: "ρ*", MAIN: "η*", "evolvability": "η", "coverage": "d/n"}


def title(analysis: Analysis) -> str:
    """Title of the report and of its figure."""
    name = varied(analysis.study)
    said = _TITLES[analysis.study.kind] if name is None else f"Evolvability when {name} varies"
    return f"{said}, on {analysis.study.domain}"


def compose(
    analysis: Analysis, *, command: str, unit: str, figure: str, versions: dict[str, str]
) -> Document:
    """The report in words, tables and the figure.

    Parameters
    ----------
    analysis : Analysis
    command : str
        What made the runs.
    unit : str
        Unit of behavior.
    figure : str
        File of the figure.
    versions : dict of str to str
        Of libraries.
    """
    blocks: list[Block] = [Paragraph(_progress(analysis))]
    blocks += _beside_the_paper(analysis)
    blocks.append(Picture(figure, _caption(analysis)))
    blocks += _means(analysis, unit)
    blocks += _tests(analysis)
    blocks += _dissimila(analysis)
    blocks += _made_by(analysis, command, versions)
    return Document(title(analysis), tuple(blocks))


def _progress(analysis: Analysis) -> str:
    study, finished = analysis.study, analysis.finished
    done = sum(finished.values())
    planned = study.runs * len(study.conditions)
    text = (
        f"{done} of {planned} runs are finished: {study.steps} steps each, {len(study.conditions)} "
        "conditions, "
        f"{analysis.evaluations:,} evaluations."
    )
    if done < planned:
        by = ", ".join(f"{label} {n} of {study.runs}" for label, n in finished.items())
        text += f" The study is not complete, and what follows may change with the rest of it ({by})."
    return text


def _beside_the_paper(analysis: Analysis) -> Iterator[Block]:
    found = findings.find(analysis)
    if not found:
        return
    yield Heading("What reproduced")
    counted = Counter(f.verdict for f in found)
    verdicts = ", ".join(f"{verdict}: {n}" for verdict, n in counted.most_common())
    yield Paragraph(f"Of {len(found)} statements: {verdicts}.")
    notes = list(_reservations(analysis))
    yield Table(
        f"The paper's statements beside the runs here. Brackets hold {_LEVEL} intervals.",
        ("Statement", "Paper", "Here", "Verdict"),
        tuple((f.claim, f.paper, f.ours, f.verdict) for f in found),
    )
    yield Bullets((*notes, *findings.RULES))


def _reservations(analysis: Analysis) -> Iterator[str]:
    """Where this is another experiment than the paper's."""
    study = analysis.study
    runs = sorted(set(analysis.finished.values()))
    if runs != [paper.RUNS]:
        spread = str(runs[0]) if len(runs) == 1 else f"{runs[0]} to {runs[-1]}"
        yield (
            f"The paper walked {paper.RUNS} runs of each condition, here {spread} are finished: a "
            "p-value depends "
            "on that number, so compare effect sizes and intervals, not p-values."
        )
    if study.domain != paper.DOMAIN:
        yield (
            f"The paper's experiment is on Fetch Pick and Place, this one on {study.domain}: it can "
            "show the same "
            "pattern, but cannot reproduce the paper's numbers."
        )
    usual = Condition(label="x")
    compared = {"label", "level" if study.kind == "pressure" else "metric"}
    for name in Condition.names():
        values = {getattr(condition, name) for condition in study.conditions}
        ours = getattr(usual, name)
        if name not in compared and values != {ours}:
            listed = ", ".join(sorted(map(str, values)))
            yield f"Setting {name} is {listed} here, and {ours} by default, our reading of the paper."
    if study.kind == "pressure":
        yield (
            "The paper does not say which diversity metric its pressure experiment used; its word is novelty."
        )
    if study.paired:
        yield (
            "Runs share their starts across conditions, so tests between conditions are paired, unlike the "
            "paper's; a correlation across conditions still takes runs as independent."
        )
    first = paper.METRICS_STEP if study.kind == "metrics" else paper.FIGURE_STEP
    if first not in analysis.steps:
        yield f"The paper tests step {first}; these walks are compared at step {analysis.last}."
    elif study.kind == "metrics":
        yield (
            f"The paper's figure of this experiment ends at step {paper.FIGURE_STEP} and its text tests step "
            f"{paper.METRICS_STEP}, so both are given."
        )


def _caption(analysis: Analysis) -> str:
    if not analysis.last:
        return "η*, η and d/n of every run at step 0, with medians and quartiles."
    if analysis.main == POPULATION:
        return (
            "Mean over runs of population evolvability ρ*, the mean distance between two of the states that "
            f"follow, and of η* and d/n of a state, with {_LEVEL} t-intervals, and ρ* of every run at step "
            f"{analysis.last}."
        )
    return (
        f"Mean over runs of expected evolvability η*, evolvability η and coverage d/n at each step, with "
        f"{_LEVEL} t-intervals, and η* of every run at step {analysis.last}."
    )


def _means(analysis: Analysis, unit: str) -> Iterator[Block]:
    labels = [label for label, n in analysis.finished.items() if n]
    steps = sorted({0, *analysis.steps})
    # Nothing has changed by step 0.
    later = [step for step in analysis.steps if step]
    rows = []
    for label in labels:
        cells = [_mean(analysis.summary(label, step)) for step in steps]
        for step in later:
            (asked,) = (a for a in analysis.answers("change", step) if a.conditions == (label,))
            cells.append(asked.reason if asked.test is None else with_interval(asked.test.effect))
        others = [_mean(analysis.summary(label, analysis.last, m)) for m in tested(analysis.study)[1:]]
        rows.append((label, str(analysis.finished[label]), *cells, *others))
    yield Heading("Evolvability")
    inside = f", in {unit}; d/n has no unit" if unit else ""
    yield Table(
        f"Means over runs with {_LEVEL} t-intervals{inside}.",
        (
            "Condition",
            "Runs",
            *(f"{_MEASURES[analysis.main]} at {step}" for step in steps),
            *(f"Change 0 to {step}" for step in later),
            *(f"{_MEASURES[m]} at {analysis.last}" for m in tested(analysis.study)[1:]),
        ),
        tuple(rows),
    )


def _mean(summary: Summary) -> str:
    if not summary.low < summary.high:
        return rounded(summary.mean)
    return f"{rounded(summary.mean)} [{rounded(summary.low)}, {rounded(summary.high)}]"


def _tests(analysis: Analysis) -> Iterator[Block]:
    yield Heading("Tests")
    asked = [a for a in analysis.asked if a.asking != "change"]
    conditions = sum(n > 0 for n in analysis.finished.values())
    yield Table(
        "Between conditions. ε² and W cannot be below 0, so their intervals do not tell whether "
        "there is an effect.",
        ("Measure", "Step", "Conditions", "Test", "Statistic", "p", "n", "Effect"),
        tuple(_test_row(analysis, a) for a in asked),
    )
    for a in asked:
        # The pairs of the paper's metrics alone stand beside the paper's.
        apart = a.measure == analysis.main and a.step > 0 and len(a.conditions) == conditions
        if a.groups is None or not apart:
            continue
        names = ", ".join(f"{label} {rank:.2f}" for label, rank in a.groups.mean_ranks.items())
        yield Table(
            f"Pairs at step {a.step}, {_MEASURES[a.measure]}: {a.groups.post_hoc}; each interval is of its "
            f"pair alone. Mean ranks, 1 for the smallest: {names}.",
            ("Pair", "p", a.groups.pairs[0].effect.name),
            tuple(
                (f"{pair.first} against {pair.second}", rounded(pair.p), with_interval(pair.effect))
                for pair in a.groups.pairs
            ),
        )


def _test_row(analysis: Analysis, asked: Asked) -> tuple[str, ...]:
    everything = len(asked.conditions) == len(analysis.study.conditions)
    said = (
        _MEASURES[asked.measure],
        str(asked.step),
        "all" if everything else ", ".join(asked.conditions) or "none",
    )
    if asked.test is None:
        return (*said, f"none: {asked.reason}", "", "", "", "")
    test = asked.test
    return (
        *said,
        test.name,
        f"{test.symbol} = {rounded(test.statistic)}",
        rounded(test.p),
        str(test.n),
        f"{test.effect.name} = {with_interval(test.effect)}",
    )


def _dissimila(analysis: Analysis) -> Iterator[Block]:
    study = analysis.dissimila
    if study is None:
        return
    yield Heading("Dissimila: do points of a low r* hold walks back?")
    yield Paragraph(
        "r* = η*/(LS* + ε) is small where offspring resemble each other more than their parent. The "
        "paper suspects "
        "such points to deceive novelty search as local optima deceive a search for fitness, and has "
        "no numbers. "
        f"Of {study.points:,} states, {study.neutral:,} are neutral (no offspring behaves otherwise) "
        "and left out; "
        f"{study.runs_left_out} runs have too few others, or no differences. Within each run, r* of a "
        "state is "
        "correlated by rank with what comes after; a test over runs then asks whether these "
        "correlations lie about "
        "0. Above 0, less follows a low r*."
    )
    yield Paragraph(_deception(analysis))
    cells = {(relation.condition, relation.outcome): _relation(relation) for relation in study.relations}
    yield Table(
        "Median over runs of the rank correlation with r*, and p of Wilcoxon's signed-rank test over runs, "
        "adjusted by Holm's method for the whole table.",
        ("Condition", *(said.format(h=study.horizon) for said in OUTCOMES.values())),
        tuple(
            (label or "all together", *(cells[label, outcome] for outcome in OUTCOMES))
            for label in (None, *study.quantiles)
        ),
    )
    yield Table(
        "Quantiles of r* over the states that are not neutral.",
        ("Condition", *(f"{q:.0%}" for q in QUANTILES)),
        tuple((label, *map(rounded, values)) for label, values in study.quantiles.items()),
    )


def _relation(relation: Relation) -> str:
    if relation.test is None or relation.adjusted is None:
        return f"no test: {relation.reason}"
    return f"{with_interval(relation.test.effect)}, p = {rounded(relation.adjusted)}, n = {relation.test.n}"


def _deception(analysis: Analysis) -> str:
    """What the runs of all conditions together say, in a sentence."""
    study = analysis.dissimila
    assert study is not None
    relation = next(r for r in study.relations if r.condition is None and r.outcome == "gain")
    if relation.test is None or relation.adjusted is None:
        return f"Whether they do cannot be said yet: {relation.reason}."
    held = f"At equal η* now, over all runs the median correlation is {with_interval(relation.test.effect)}"
    held += f" (p = {rounded(relation.adjusted)})"
    if relation.adjusted >= findings.ALPHA:
        return f"{held}: no sign that low-r* points hold walks back, or help them."
    if relation.test.effect.value > 0:
        return f"{held}: after a low r* walks are less evolvable, as the paper suspects."
    return f"{held}: after a low r* walks are more evolvable, against what the paper suspects."


def _made_by(analysis: Analysis, command: str, versions: dict[str, str]) -> Iterator[Block]:
    study = analysis.study
    yield Heading("How it was made")
    if command:
        yield Code(command)
    yield Bullets(
        (
            f"Seed {study.seed}, the domain's {study.domain_seed}; starts "
            + ("shared by all conditions." if study.paired else "of their own in each condition."),
            f"Coverage on a grid of {' x '.join(map(str, study.shape))} within "
            + " x ".join(f"[{low:g}, {high:g}]" for low, high in study.bounds)
            + ".",
            f"{analysis.evaluations:,} of {study.evaluations:,} evaluations are those of finished runs; "
            f"{analysis.failed:,} of {analysis.offspring:,} offspring failed; {analysis.stalls:,} "
            "steps had no "
            "candidate.",
            "Versions: " + ", ".join(f"{name} {version}" for name, version in versions.items()) + ".",
        )
    )
    names = Condition.names()
    yield Table(
        "Settings of each condition.",
        names,
        tuple(tuple(str(getattr(condition, name)) for name in names) for condition in study.conditions),
    )
