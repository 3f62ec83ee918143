"""``nichechain evolvability``: niches by how many niches their descendants will reach."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from nichechain.cli import meta, output, parsing, progress, workers
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.core.text import some

if TYPE_CHECKING:
    import pandas as pd

    from nichechain.archive.archive import Archive
    from nichechain.chain import NicheChain

_TOP = 10
_LABELS = {"posterior": "90 % interval", "prior": "prior band", "bootstrap": "90 % bootstrap"}


@dataclass(frozen=True)
class EvolvabilityCommand:
    """l-evolvability of niches, or of the genotype of an elite."""

    path: parsing.ArchivePath
    l: int = 5
    """Generations to look ahead."""
    lineages: int = 100
    """Independent lineages U: l times U descendants."""
    niche: Annotated[str | None, parsing.option("I,J", "none")] = None
    """One niche, by grid index or number."""
    elite: Annotated[str | None, parsing.option("I,J", "none")] = None
    """The genotype of a niche's elite: the children recorded of it begin the lineages."""
    rank: Annotated[Literal["niches", "elites"] | None, parsing.option("{niches,elites}", "niches")] = None
    """What to rank: niches, or elites by the children recorded of each."""
    top: Annotated[int | None, parsing.option("INT", "10")] = None
    """So many of the best."""
    method: Literal["auto", "exact", "monte-carlo"] = "auto"
    """In closed form, or by the paper's simulation; auto is in closed form up to 1,000 states, and beyond
    simulates lineages on rows of T that are drawn where they are entered."""
    convention: Literal["definition", "procedure"] = "definition"
    """Whether the descendants alone count, or the root's own niche as well."""
    estimator: parsing.EstimatorName = "empirical-bayes"
    """T from births: posteriors around a pooled or a uniform base, or row-normalised counts."""
    unvisited: Annotated[
        Literal["self", "uniform", "base", "absorb"] | None,
        parsing.option("{self,uniform,base,absorb}", "self"),
    ] = None
    """For mle: a row without births stays, goes anywhere, goes where most children go, or leaves for good."""
    offspring: Annotated[int | None, parsing.option("INT", "0")] = None
    """For --elite: so many offspring more, evaluated now."""
    fresh_only: bool = False
    """For --elite: only offspring evaluated now count, not those that are recorded."""
    meta: Annotated[int | None, parsing.option("INT", "none")] = None
    """For --elite: meta-evolvability, the mean 1-evolvability of so many of its children, measured by
    --offspring (by default 10) offspring of each."""
    min_births: int = 20
    """Niches with fewer births behind their row of T are not ranked."""
    draws: int = 50
    """Posterior draws of T to average over."""
    uncertainty: Literal["posterior", "prior", "bootstrap"] = "posterior"
    """Interval over posterior draws, band over other priors, or bootstrap over each niche's elites."""
    repeats: int = 100
    """Simulations, for --method monte-carlo."""
    steps: parsing.Steps = None
    seed: int = 0
    """Seed of draws, simulations and offspring."""
    workers: Annotated[str | None, parsing.option("WORKERS", "one thread per processor")] = None
    """Who evaluates an elite's offspring: a number of threads, processes:N, ray or ray://HOST:PORT."""
    cache_memory: parsing.CacheMemory = None
    format: Literal["table", "csv", "json"] = "table"
    """How to write it."""

    def asked(self) -> dict[str, Any]:
        """What every kind of score is told."""
        names = ("l", "lineages", "method", "convention", "repeats", "draws", "seed")
        return {name: getattr(self, name) for name in names}


def run(arguments: Sequence[str]) -> int:
    """Score niches or an elite."""
    command = parsing.parse(EvolvabilityCommand, arguments)
    _check(command)
    from nichechain.archive.archive import load
    from nichechain.evolvability.question import Question

    Question(command.l, command.lineages)
    if command.meta is not None:
        return meta.show(command, load(command.path))
    archive = parsing.seen(load(command.path), command.steps)
    chain = progress.estimated(archive, command.estimator, unvisited=command.unvisited)
    if command.niche is not None or command.elite is not None:
        frame = _one(command, archive, chain)
    elif command.rank == "elites":
        frame = _best_elites(command, archive, chain)
    else:
        frame = _best(command, chain)
    frame["uncertainty"] = command.uncertainty
    if command.uncertainty != "posterior":
        _set_band(frame, command, archive)
    elif frame["low"].isna().all():
        frame["uncertainty"] = None
    _write(frame, command, _drift(command, archive, chain))
    return 0


def _check(command: EvolvabilityCommand) -> None:
    chosen = {"--niche": command.niche, "--elite": command.elite, "--top": command.top}
    given = [name for name, value in chosen.items() if value is not None]
    if len(given) > 1:
        raise NichechainError(f"{' and '.join(given)} exclude each other: ask for one of them")
    if command.rank is not None and (command.niche is not None or command.elite is not None):
        one = "--niche" if command.niche is not None else "--elite"
        raise NichechainError(f"--rank and {one} exclude each other: ask for one of them")
    _check_elite(command)
    if command.uncertainty != "posterior":
        wanted = f"--uncertainty {command.uncertainty}"
        if command.elite is not None:
            raise NichechainError(f"{wanted} is of niches, but --elite asks for a genotype: ask for --niche")
        if command.rank == "elites":
            raise NichechainError(f"{wanted} is of niches, but --rank asks for elites: ask for niches")
        if command.estimator != "empirical-bayes":
            raise NichechainError(f"{wanted} belongs to empirical-bayes, not to {command.estimator}")
        if command.method == "monte-carlo":
            raise NichechainError(f"{wanted} is not computed by {command.method}")
    if command.rank == "elites" and command.method == "monte-carlo":
        raise NichechainError(f"elites are ranked in closed form, not by {command.method}")
    for name in ("top", "draws", "repeats"):
        if getattr(command, name) is not None:
            check_at_least(1, **{f"--{name}": getattr(command, name)})
    check_at_least(0, **{"--seed": command.seed, "--min-births": command.min_births})


def _check_elite(command: EvolvabilityCommand) -> None:
    """Refuse what belongs to --elite where it is not given."""
    if command.offspring is not None:
        check_at_least(0, **{"--offspring": command.offspring})
    for name, given in {"--offspring": command.offspring, "--fresh-only": command.fresh_only}.items():
        if given and command.elite is None:
            raise NichechainError(f"{name} belongs to --elite, which is not given")
    if command.meta is not None:
        meta.check(command)
    if command.fresh_only and not command.offspring:
        raise NichechainError("--fresh-only needs offspring: give --offspring at least 1")


def _one(command: EvolvabilityCommand, archive: Archive, chain: NicheChain) -> pd.DataFrame:
    """One row, for a niche or the genotype of its elite."""
    import pandas as pd

    from nichechain.evolvability import genotype_evolvability
    from nichechain.evolvability.niches import answer
    from nichechain.evolvability.question import Question, Root
    from nichechain.niches import parse_niche

    if command.niche is not None:
        niche = parse_niche(command.niche, "--niche")
        state = archive.niches.state(niche)
        with _drawing(command, chain) as tell:
            result = answer(chain, Root(chain, niche=niche), Question(**command.asked()), tell)
    else:
        assert command.elite is not None
        elite = archive.elite(parse_niche(command.elite, "--elite"))
        state = elite.state
        with (
            workers.hired(command.workers, command.cache_memory) as executor,
            _drawing(command, chain) as tell,
        ):
            result = genotype_evolvability(
                archive,
                elite,
                offspring=command.offspring or 0,
                record=not command.fresh_only,
                chain=chain,
                executor=executor,
                on_done=tell,
                **command.asked(),
            )
    values = {name: value for name, value in asdict(result).items() if value is not None}
    root = {"niche": state, "index": archive.niches.label(state)}
    return pd.DataFrame([{**root, "root": "niche" if command.niche is not None else "elite", **values}])


def _drawing(
    command: EvolvabilityCommand, chain: NicheChain
) -> AbstractContextManager[Callable[[int], None]]:
    """A bar of draws of T, for one root; a genotype has draws of its own where T has none."""
    drawn = command.elite is not None or chain.posterior is not None
    return progress.adding(command.draws if drawn else 1, "draws of T")


def _best_elites(command: EvolvabilityCommand, archive: Archive, chain: NicheChain) -> pd.DataFrame:
    """The best elites, best first."""
    from nichechain.evolvability import elite_evolvability

    asked = {name: value for name, value in command.asked().items() if name not in ("method", "repeats")}
    with progress.adding(command.draws, "draws of T") as tell:
        ranking = elite_evolvability(archive, chain=chain, on_done=tell, **asked)
    ranking = ranking[ranking["births"] >= command.min_births]
    _check_enough(len(ranking), command)
    frame = ranking.head(command.top or _TOP).copy()
    frame.insert(2, "root", "elite")
    for name in ("l", "lineages", "convention"):
        frame[name] = getattr(command, name)
    frame["estimator"] = chain.estimator
    return frame


def _check_enough(ranked: int, command: EvolvabilityCommand) -> None:
    """Refuse an empty ranking."""
    if not ranked:
        raise NichechainError(
            f"no niche has {command.min_births} births behind its row of T: "
            "lower --min-births or build further"
        )


def _best(command: EvolvabilityCommand, chain: NicheChain) -> pd.DataFrame:
    """The best niches, best first."""
    import numpy as np

    from nichechain.evolvability.niches import answer_for_niches
    from nichechain.evolvability.question import Question

    question = Question(**command.asked())
    # Only niches that are ranked have to be scored.
    births = np.zeros(chain.n_niches) if chain.births is None else chain.births[: chain.n_niches]
    ranked = np.flatnonzero(births >= command.min_births)
    _check_enough(ranked.size, command)
    draws = 1 if chain.posterior is None else command.draws
    with progress.adding(draws, "draws of T") as tell:
        best = command.top or _TOP
        scores = answer_for_niches(chain, question, roots=ranked, best=best, on_done=tell)
    ranking = scores.ranking(chain, min_births=command.min_births)
    frame = ranking.head(command.top or _TOP).copy()
    frame.insert(2, "root", "niche")
    for name in ("l", "lineages", "method", "convention", "estimator", "saturated"):
        frame[name] = getattr(scores, name)
    return frame


def _drift(command: EvolvabilityCommand, archive: Archive, chain: NicheChain) -> str:
    """What to say where early and late births disagree on the level, else nothing."""
    from nichechain.chain.filters import COUNTED
    from nichechain.evolvability.question import MOST_EXACT
    from nichechain.validation.drift import level_drift

    # Beyond, a level in closed form would take longer than what was asked for.
    if command.steps is not None or command.format != "table" or archive.niches.states > MOST_EXACT:
        return ""
    births = archive.table(list(COUNTED))
    asked = {"l": command.l, "lineages": command.lineages, "seed": command.seed}
    try:
        found = level_drift(births, archive.niches, **asked, like=chain.posterior)
    except NichechainError:
        # Too few births to say so, or births without a step.
        return ""
    return found.answer if found.disagrees else ""


def _set_band(frame: pd.DataFrame, command: EvolvabilityCommand, archive: Archive) -> None:
    """Put the bounds of another band in place of the posterior's interval."""
    from nichechain.evolvability import bootstrap_elites, prior_sensitivity
    from nichechain.evolvability.uncertainty import RESAMPLES

    if command.uncertainty == "prior":
        with progress.adding(5, "priors") as tell:
            band = prior_sensitivity(
                archive.counts,
                l=command.l,
                lineages=command.lineages,
                convention=command.convention,
                draws=command.draws,
                seed=command.seed,
                on_done=tell,
            )
    else:
        with progress.adding(RESAMPLES, "resamples") as tell:
            band = bootstrap_elites(
                archive.counts,
                on_done=tell,
                l=command.l,
                lineages=command.lineages,
                convention=command.convention,
                seed=command.seed,
            )
    niche = frame["niche"].to_numpy()
    # The bootstrap's own value may come from another number of draws than the one shown.
    frame["low"] = frame["value"] + (band.low - band.value)[niche]
    frame["high"] = frame["value"] + (band.high - band.value)[niche]


def _write(frame: pd.DataFrame, command: EvolvabilityCommand, drift: str) -> None:
    if command.format == "csv":
        print(frame.to_csv(index=False), end="")
        return
    if command.format == "json":
        print(json.dumps(output.records(frame), indent=2))
        return
    first = frame.iloc[0]
    shown = output.console()
    shown.print(
        f"[bold]{command.l}-evolvability[/]: niches that {some(command.lineages, 'lineage')} of "
        f"{some(command.l, 'generation')} {'reaches' if command.lineages == 1 else 'reach'}"
    )
    shown.print(
        f"[dim]estimator: {first.estimator}; convention: {first.convention}; method: {first.method}[/]"
    )
    if first.root == "elite":
        shown.print(f"[dim]{_where_they_begin(frame, command)}[/]")
    # Without a posterior there is no interval.
    given = bool(frame["low"].isna().all())
    columns = [first.root, "niches reached", *([] if given else [_LABELS[command.uncertainty]]), "± s.e."]
    own = ["children"] if "recorded" in frame else []
    table = output.table(*columns, "births behind the row", *own)
    for row in frame.itertuples():
        interval = [] if given else [f"{row.low:.2f} to {row.high:.2f}"]
        recorded = [str(row.recorded)] if own else []
        error = f"{row.standard_error:.2f}"
        table.add_row(row.index, f"{row.value:.2f}", *interval, error, str(row.births), *recorded)
    shown.print(table)
    if given:
        shown.print("No interval: T is a single estimate, and no posterior says what births leave open.")
    few = frame[frame["births"] < command.min_births]
    if len(few):
        shown.print(
            f"Fewer than {command.min_births} births behind the row: "
            "this is mostly what niches in general do."
        )
    if first.saturated:
        shown.print(
            "Nearly all niches that can be reached are: fewer --lineages would tell roots apart better."
        )
    if drift:
        shown.print(drift)


def _where_they_begin(frame: pd.DataFrame, command: EvolvabilityCommand) -> str:
    """Whose children the first generation of an elite is drawn from."""
    if command.rank == "elites":
        none = int((frame["recorded"] == 0).sum())
        without = f"; {none} without any begin as their niche does" if none else ""
        return f"lineages begin at the niches of the children recorded of each elite{without}"
    first = frame.iloc[0]
    fresh = f"{first.offspring} offspring evaluated now" if command.offspring else ""
    if first.recorded:
        recorded = f"{first.recorded} recorded children"
        return f"lineages begin at the niches of {recorded}{' and of ' if fresh else ''}{fresh}"
    if fresh:
        return f"lineages begin at the niches of {fresh}"
    return "no children are recorded of this elite: lineages begin as its niche does (see --offspring)"
