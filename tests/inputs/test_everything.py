"""Nothing public goes untried: every parameter of every public function is in a table of bad input."""

# every row of a table takes the world, whether it needs it or not

from __future__ import annotations

import enum
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from typing import Any

import nichechain

from . import (
    test_chain,
    test_domains,
    test_evolvability,
    test_experiments,
    test_files,
    test_landscape,
    test_plots,
    test_walks,
)
from .table import Call

CALLS: tuple[Call, ...] = sum(
    (
        module.CALLS
        for module in (
            test_chain,
            test_domains,
            test_evolvability,
            test_experiments,
            test_files,
            test_landscape,
            test_plots,
            test_walks,
        )
    ),
    (),
)

# Their options have a table of their own, tests/inputs/commands.py.
# What needs an extra is tried beside its tests.
_ELSEWHERE = ("nichechain.cli", "nichechain.qdax")


def _public() -> dict[str, Any]:
    """Functions and classes that packages have for users, by where they were defined."""
    found: dict[str, Any] = {}
    packages = [info.name for info in pkgutil.walk_packages(nichechain.__path__, "nichechain.") if info.ispkg]
    for package in ("nichechain", *sorted(set(packages) - set(_ELSEWHERE))):
        loaded = importlib.import_module(package)
        for name in loaded.__all__:
            value = getattr(loaded, name)
            made_by_users = inspect.isclass(value) and not issubclass(value, (Exception, enum.Enum))
            if made_by_users or inspect.isfunction(value):
                found[f"{value.__module__}.{value.__qualname__}"] = value
    return found


def _untried() -> Iterator[tuple[str, str]]:
    tried: dict[Any, set[str]] = {}
    for call in CALLS:
        tried.setdefault(call.function, set()).update(call.bad)
    for name, value in _public().items():
        if getattr(value, "_is_protocol", False) or name.rpartition(".")[2] in RESULTS:
            continue
        for parameter in inspect.signature(value).parameters.values():
            kinds = set(re.findall(r"[A-Za-z_.]+", str(parameter.annotation)))
            if parameter.name not in tried.get(value, ()) and not kinds <= OBJECTS:
                yield name, parameter.name


# What the package itself makes and types check: a wrong object is a mistake in a program, not a bad value.
OBJECTS = {
    "Any",
    "Archive",
    "ArchiveRule",
    "Axes",
    "Bound",
    "BuildConfig",
    "BuildProgress",
    "Callable",
    "Condition",
    "DirectCheck",
    "Domain",
    "Elite",
    "Evaluation",
    "Executor",
    "Landscape",
    "LinearOperator",
    "LevelCourse",
    "LevelDrift",
    "Lineages",
    "Matrix",
    "Metric",
    "Motion",
    "Mutation",
    "MutationNoise",
    "NicheChain",
    "NicheEvolvability",
    "Niches",
    "Noise",
    "None",
    "OnDone",
    "RankStability",
    "Reach",
    "SearchState",
    "Selection",
    "SelectionStudy",
    "Study",
    "Sweep",
    "Transition",
    "TransitionCounts",
    "Triples",
    "ValidationConfig",
    "VerificationProgress",
    "WalkConfig",
    "WalkState",
    "bool",
    "np.random.Generator",
    "nx.DiGraph",
}

# Made by functions that check, and read by users.
RESULTS = {
    "Film",
    "Motion",
    "BuildProgress",
    "Check",
    "Comparison",
    "Contrast",
    "ContrastRow",
    "Correlation",
    "Difference",
    "DirectCheck",
    "DirichletPosterior",
    "Dissimila",
    "Elite",
    "Episode",
    "Evaluation",
    "Evolvability",
    "GenotypeMeasures",
    "GridSize",
    "Landscape",
    "LevelCourse",
    "LevelDrift",
    "Lineages",
    "LocalMeasures",
    "MarkovTest",
    "Measure",
    "MetastableSets",
    "NicheBand",
    "MetaEvolvability",
    "NicheEvolvability",
    "NoveltyArchive",
    "Offspring",
    "PosteriorInterval",
    "Prediction",
    "QuasiStationary",
    "RankStability",
    "Reach",
    "ReactiveFlux",
    "Step",
    "StepRecord",
    "Surroundings",
    "Sweep",
    "TransitionCounts",
    "Triples",
    "Validation",
    "Verification",
    "VerificationProgress",
    "VisitMetrics",
    "WalkResult",
    "WalkState",
}

_TEXT = "a text for people, which may be anything"
_WITHIN = "called by this package with what it has checked"
_LATER = "opened or made when it is needed, where a command's table tries it"

EXEMPT: dict[tuple[str, str], str] = {
    (f"nichechain.{name}", parameter): reason
    for name, parameters, reason in (
        ("chain.model.NicheChain", "estimator", _TEXT),
        ("domains.gym.GymDomain", "unit", _TEXT),
        ("archive.archive.Archive", "folder", "a Path that load, which is tried, has looked at"),
        ("archive.imported.Axes", "names unit", _TEXT),
        (
            "archive.log_columns.Columns",
            "parent child run uid elite step lineage objective",
            "names of columns, which import_births looks for",
        ),
        ("search.config.BuildConfig", "domain epsilon", _LATER),
        ("core.randomness.keyed", "seed purpose index", "called for every birth; NumPy refuses no seeds"),
        ("niches.parsing.parse_bounds", "name", _TEXT),
        ("niches.parsing.parse_niche", "name", _TEXT),
        ("niches.parsing.parse_niches", "name", _TEXT),
        ("niches.parsing.parse_shape", "name", _TEXT),
        ("pyribs.conversion.from_ribs", "objective_name", _TEXT),
        ("births.table.check_columns", "births names", _WITHIN),
        ("births.table.schema", "axes", _WITHIN),
        ("births.table.make_table", "offspring child_niche accepted step run", _WITHIN),
        ("evolvability.coverage.sampled_coverage", "first own", _WITHIN),
        ("evolvability.coverage.expected_coverage", "own", _WITHIN),
        ("execution.base.evaluate_rows", "genotypes", _WITHIN),
        ("studies.running.run", "on_progress", _WITHIN),
        ("studies.searches.running.run_searches", "on_progress", _WITHIN),
        ("landscape.archives.measure_archive", "on_done", _WITHIN),
        ("validation.contrast.contrast", "on_done", _WITHIN),
        ("validation.grid_size.sweep", "on_done", _WITHIN),
        ("validation.stability.rank_stability", "on_done", _WITHIN),
        ("landscape.niche_table.niche_table", "on_done", _WITHIN),
        ("evolvability.elites.elite_evolvability", "on_done", _WITHIN),
        ("evolvability.genotypes.genotype_evolvability", "on_done", _WITHIN),
        ("evolvability.reach.reach", "on_done", _WITHIN),
        ("evolvability.meta.meta_evolvability", "on_done", _WITHIN),
        ("validation.held_out.compare_estimators", "on_done", _WITHIN),
        ("evolvability.uncertainty.bootstrap_elites", "on_done", _WITHIN),
        ("evolvability.uncertainty.prior_sensitivity", "on_done", _WITHIN),
        ("plots.explorer.page.write_explorer", "on_done", _WITHIN),
        ("search.making.make_niches", "centroids", _WITHIN),
        ("plots.graphs.plot_wormholes", "found", _WITHIN),
        ("evolvability.reach.visit_probability", "first steps", _WITHIN),
        ("walks.state.record_table", "records", _WITHIN),
        (
            "domains.registry.make",
            "options",
            "tried one by one: joints, noise, repeats, and one that is not there",
        ),
        ("execution.ray.Ray", "address cache_memory", _LATER),
        ("studies.stored.is_study", "folder", "asks whether there is one: any path has an answer"),
        ("studies.running.run", "folder", _LATER),
        ("studies.study.Study", "domain domain_options", _LATER),
        ("landscape.archives.measure_archive", "keep", _LATER),
        ("validation.rollouts.run_lineages", "keep", _LATER),
        ("validation.report.validate", "keep", _LATER),
        (
            "pyribs.recording.Recording",
            "emitters outside strategy_parent",
            "what record() hands on, which is tried",
        ),
        (
            "pyribs.conversion.from_ribs",
            "folder",
            "tests/pyribs/test_conversion.py, where there are archives of pyribs",
        ),
    )
    for parameter in parameters.split()
}


def test_every_parameter_of_every_public_function_is_tried() -> None:
    missing = [f"{name}: {parameter}" for name, parameter in _untried() if (name, parameter) not in EXEMPT]
    assert not missing, "no bad value is tried of " + "; ".join(missing)


def test_every_exemption_is_of_something() -> None:
    """What is gone, or has a table by now, is no exemption."""
    assert set(EXEMPT) <= set(_untried())
