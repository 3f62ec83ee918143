"""How well an estimator foretold what lineages did."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
from scipy import stats
from truth_data import GENERATIONS, Truth
from truth_models import Estimator, Forecast, Model, Roots, Steps

from nichechain import Niches
from nichechain.births import NONE
from nichechain.core.randomness import Purpose, keyed
from nichechain.validation.rollouts import niches_reached

HISTORY, FOLDS, HALVES = 12, 3, 200
THINNINGS, THINNED_AT = 3, 5
SHOWN = (1, 2, 3, 4, 5, GENERATIONS)
INTERVAL = (0.05, 0.95)
_STEPS_PER_ELITE = 200


def score(estimator: Estimator, truth: Truth, births: int, share: float, seed: int = 0) -> pd.DataFrame:
    """Every figure of one estimator on one data set.

    Parameters
    ----------
    estimator : callable
    truth : Truth
    births : int
        Budget of the search that the estimator is given: the first births of the archive. Roots
        whose niche nobody was born in by then are left out, and so is the ``elite`` start of roots
        that were born later. Roots are always elites of the whole archive, so a smaller budget is
        judged by elites older than its own: what drifts over a search shows as well.
    share : float
        Of these births that were spent on lineages without selection.

    Returns
    -------
    DataFrame
        One row per start and generation: ``elites``; ``reached`` and ``predicted``, means;
        ``level``, their ratio, with the 90 % interval that the model gives it; ``bias``, predicted
        minus reached, with a 95 % t-interval over elites; ``covered``, see the notes; ``spearman``,
        and ``expected``, its median were the model right; ``ceiling``, see :func:`ceiling`. The
        same in every row are ``births_log`` and ``births_impossible`` of held-out births,
        ``steps_log`` and ``steps_impossible`` of steps of the lineages (means of the logarithm of
        the probability; share of probability 0), and seconds of the processor to ``fit`` and to
        ``forecast``.

    Notes
    -----
    An interval of a niche's l-evolvability is about an expectation, and what was observed of an
    elite is one number of U lineages. So the interval that is judged is that of the number which U
    lineages of the model reach: simulated on each draw of what births leave unknown. A right model
    covers 90 % (a little more, as the numbers are whole).
    """
    table, niches = truth.given(births, share), truth.niches
    began = time.process_time()
    model = estimator(table, niches)
    fitted = time.process_time() - began
    born = set(np.unique(_column(table, "child_niche")).tolist())
    kept = np.array([int(root) in born for root in truth.lineages.roots])
    roots = Roots(truth.lineages.roots[kept], truth.uid[kept], truth.lineages.offspring[kept])
    states = truth.lineages.states[kept]
    began = time.process_time()
    forecasts = model.forecast(roots, GENERATIONS, states.shape[1], seed)
    foretold = time.process_time() - began
    real = niches_reached(states, len(niches))
    recorded = np.isin(roots.uid, _column(table, "uid"))
    rows = []
    for start, forecast in forecasts.items():
        mask = recorded if start == "elite" else np.ones(recorded.size, bool)
        if mask.sum() < 3:
            continue
        best = ceiling(states[mask], len(niches), seed)
        rows += [
            {"start": start, **_row(forecast, real, mask, generation), "ceiling": best[generation - 1]}
            for generation in SHOWN
        ]
    frame = pd.DataFrame(rows)
    frame["births_log"], frame["births_impossible"] = held_out(estimator, table, niches, seed)
    frame["steps_log"], frame["steps_impossible"] = _mean(
        model.log_probability(lineage_steps(table, replace_roots(truth, kept)))
    )
    frame["fit"], frame["forecast"] = fitted, foretold
    return frame


def replace_roots(truth: Truth, kept: np.ndarray) -> Truth:
    """The truth of some of the roots."""
    lineages = truth.lineages
    some = replace(
        lineages,
        roots=lineages.roots[kept],
        states=lineages.states[kept],
        offspring=lineages.offspring[kept],
    )
    return replace(truth, uid=truth.uid[kept], lineages=some)


def ceiling(states: np.ndarray, niches: int, seed: int = 0) -> np.ndarray:
    """Spearman that full knowledge of every elite would have with the numbers reached, (l,).

    The mean correlation of two random halves of the lineages says how reliable a number of U/2 is
    (r); Spearman and Brown that of U is 2r / (1 + r), and a perfect predictor correlates with it
    by the square root.
    """
    rng = keyed(seed, Purpose.RESAMPLING)
    lineages = states.shape[1]
    found = np.empty((HALVES, states.shape[2]))
    for repeat in range(HALVES):
        order = rng.permutation(lineages)
        halves = (
            niches_reached(states[:, part], niches)
            for part in (order[: lineages // 2], order[lineages // 2 :])
        )
        one, other = (stats.rankdata(half, axis=0) for half in halves)
        with np.errstate(invalid="ignore"):
            one, other = one - one.mean(axis=0), other - other.mean(axis=0)
            found[repeat] = (one * other).sum(axis=0) / np.sqrt((one**2).sum(axis=0) * (other**2).sum(axis=0))
    half = np.maximum(found.mean(axis=0), 0.0)
    return np.sqrt(2 * half / (1 + half))


def thinned(estimator: Estimator, truth: Truth, births: int, share: float, seed: int = 0) -> pd.DataFrame:
    """Whether a fifth of what is known gives the same number, give or take its interval.

    Returns
    -------
    DataFrame
        One row per repeat and ``kept``, a fifth of the ``births`` or of the ``elites`` with all
        their children: ``whole``, the mean of niche l-evolvability over the roots at l = 5 from all
        births; ``fifth``, that from a fifth, with its 90 % interval ``low`` to ``high``; and
        whether the whole one lies ``inside``.
    """
    table, niches = truth.given(births, share), truth.niches
    roots = Roots(truth.lineages.roots, truth.uid, truth.lineages.offspring)
    everyone = np.ones(roots.niche.size, bool)
    lineages = truth.lineages.states.shape[1]

    def forecast(rows: pa.Table) -> Forecast:
        return estimator(rows, niches).forecast(roots, THINNED_AT, lineages, seed)["niche"]

    whole = float(forecast(table).value[:, -1].mean())
    elite = _column(table, "parent_uid")
    rows = []
    for repeat in range(THINNINGS):
        rng = keyed(seed, Purpose.THINNING, repeat)
        masks = {
            "births": rng.random(len(table)) < 0.2,
            "elites": (rng.random(int(elite.max()) + 2) < 0.2)[elite],
        }
        for kept, mask in masks.items():
            part = forecast(table.filter(pa.array(mask | (elite == NONE))))
            low, high = _level(part, everyone, THINNED_AT - 1)
            fifth = float(part.value[:, -1].mean())
            found = {"whole": whole, "fifth": fifth, "low": low, "high": high}
            rows.append({"kept": kept, "repeat": repeat, **found, "inside": low <= whole <= high})
    return pd.DataFrame(rows)


def held_out(estimator: Estimator, births: pa.Table, niches: Niches, seed: int = 0) -> tuple[float, float]:
    """Mean log-probability of births, and the share of impossible ones.

    Elites are dealt into three folds; the births of a fold's elites are foretold from all others.
    """
    elite, child = _column(births, "parent_uid"), _column(births, "child_niche")
    parents = np.unique(elite[elite != NONE])
    dealt = keyed(seed, Purpose.FOLDS).integers(FOLDS, size=parents.size)
    fold = np.where(
        elite == NONE, NONE, dealt[np.searchsorted(parents, elite, side="left").clip(0, parents.size - 1)]
    )
    steps = birth_steps(births)
    found = []
    for k in range(FOLDS):
        model: Model = estimator(births.filter(pa.array(fold != k)), niches)
        found.append(model.log_probability(_some(steps, (fold == k) & (child != NONE))))
    return _mean(np.concatenate(found))


def birth_steps(births: pa.Table) -> Steps:
    """Every birth as a step, with its ancestors as far as births know them."""
    elite, child, depth = (_column(births, name) for name in ("parent_uid", "child_niche", "depth"))
    return Steps(child, _histories(births, elite), elite, np.zeros_like(child), depth - 1)


def lineage_steps(births: pa.Table, truth: Truth) -> Steps:
    """Steps of lineages: at most 200 of each elite, so that all data sets weigh alike."""
    uid, depth = _column(births, "uid"), _column(births, "depth")
    lineages = truth.lineages
    take = max(1, _STEPS_PER_ELITE // GENERATIONS)
    states = lineages.states[:, :take]
    size, take, generations = states.shape
    root = np.broadcast_to(lineages.roots[:, None, None], (size, take, 1))
    path = np.concatenate([root, states], axis=2).reshape(-1, generations + 1)
    # Where the root is a birth that is known, what came before it belongs to the history.
    own = np.where(np.isin(truth.uid, uid), truth.uid, NONE)
    before = np.repeat(_histories(births, own)[:, 1:], take, axis=0)
    place = {int(u): int(d) for u, d in zip(uid, depth, strict=True)}
    root_depth = np.repeat([place.get(int(u), 0) for u in own], take)
    parts = []
    for k in range(generations):
        history = np.full((len(path), HISTORY), NONE)
        whole = np.concatenate([path[:, k::-1], before], axis=1)[:, :HISTORY]
        history[:, : whole.shape[1]] = whole
        since = np.full(len(path), k)
        step = Steps(path[:, k + 1], history, np.repeat(own, take), since, root_depth + k)
        parts.append(_some(step, path[:, k + 1] != NONE))
    return Steps(*(np.concatenate([getattr(p, name) for p in parts]) for name in Steps.__dataclass_fields__))


def _histories(births: pa.Table, last: np.ndarray) -> np.ndarray:
    """States of the births ``last``, their parents and so on, (N, HISTORY)."""
    uid, elite, child = (_column(births, name) for name in ("uid", "parent_uid", "child_niche"))
    size = int(max(uid.max(initial=0), elite.max(initial=0), last.max(initial=0))) + 1
    state, above = np.full(size, NONE), np.full(size, NONE)
    state[uid], above[uid] = child, elite
    history = np.full((last.size, HISTORY), NONE)
    here = last.copy()
    for k in range(HISTORY):
        known = here != NONE
        history[known, k] = state[here[known]]
        here = np.where(known, above[here], NONE)
    return history


def _row(forecast: Forecast, real: np.ndarray, mask: np.ndarray, generation: int) -> dict[str, float]:
    k = generation - 1
    value, number, checks = forecast.value[mask, k], real[mask, k], forecast.simulated[mask, k]
    low, high = np.quantile(checks, INTERVAL, axis=1, method="weibull")
    least, most = _level(forecast, mask, k)
    bias = value - number
    width = stats.t.ppf(0.975, bias.size - 1) * bias.std(ddof=1) / np.sqrt(bias.size)
    return {
        "generation": generation,
        "elites": bias.size,
        "reached": number.mean(),
        "predicted": value.mean(),
        "level": value.mean() / number.mean(),
        "level_low": least / number.mean(),
        "level_high": most / number.mean(),
        "bias": bias.mean(),
        "bias_low": bias.mean() - width,
        "bias_high": bias.mean() + width,
        "covered": np.mean((number >= low) & (number <= high)),
        "spearman": _spearman(value, number),
        "expected": np.median([_spearman(value, check) for check in checks.T]),
    }


def _level(forecast: Forecast, mask: np.ndarray, k: int) -> tuple[float, float]:
    """90 % interval of the mean over roots."""
    low, high = np.quantile(forecast.draws[:, mask, k].mean(axis=1), INTERVAL, method="weibull")
    return float(low), float(high)


def _spearman(one: np.ndarray, other: np.ndarray) -> float:
    if np.ptp(one) == 0 or np.ptp(other) == 0:
        return float("nan")
    return float(stats.spearmanr(one, other).statistic)


def _mean(logs: np.ndarray) -> tuple[float, float]:
    return float(logs.mean()), float(np.isneginf(logs).mean())


def _some(steps: Steps, mask: np.ndarray) -> Steps:
    return Steps(*(getattr(steps, name)[mask] for name in Steps.__dataclass_fields__))


def _column(births: pa.Table, name: str) -> np.ndarray:
    return births[name].fill_null(NONE).to_numpy().astype(np.int64)
