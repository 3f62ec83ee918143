"""The algorithms of pyribs' sphere example, small: which archives and emitters each is made of."""

from __future__ import annotations

from functools import partial

import numpy as np
from ribs.archives import CVTArchive, DensityArchive, DiscountArchive, GridArchive, ProximityArchive
from ribs.emitters import (
    EvolutionStrategyEmitter,
    GaussianEmitter,
    GradientArborescenceEmitter,
    GradientOperatorEmitter,
    IsoLineEmitter,
)
from ribs.schedulers import BanditScheduler, Scheduler

DIM = 6
RANGES = [(-DIM / 2 * 5.12, DIM / 2 * 5.12)] * 2
BATCH = 8


def grid(**options):
    return GridArchive(solution_dim=DIM, dims=(10, 10), ranges=RANGES, seed=1, **options)


def cvt():
    centroids = np.random.default_rng(0).uniform(*zip(*RANGES, strict=True), (60, 2))
    return CVTArchive(solution_dim=DIM, centroids=centroids, ranges=RANGES, seed=1)


def proximity(**options):
    return ProximityArchive(solution_dim=DIM, measure_dim=2, k_neighbors=5, seed=1, **options)


def density(method="kde"):
    return DensityArchive(measure_dim=2, buffer_size=100, density_method=method, bandwidth=5.0, seed=1)


def discount(result_archive):
    import torch
    from ribs.discount_models import MLP, DiscountModelManager

    torch.manual_seed(0)
    model = MLP(layer_specs=[[2, 8], [8, 1]], activation=torch.nn.ReLU)
    low, high = zip(*RANGES, strict=True)
    manager = DiscountModelManager(
        model=model,
        optimizer=torch.optim.Adam(model.parameters(), lr=1e-3),
        device=torch.device("cpu"),
        measures_low=low,
        measures_high=high,
        discount_low=0.0,
        discount_high=100.0,
        train_epochs=1,
        train_cutoff_loss=0.05,
        train_batch_size=32,
        normalize_measures="negative_one_one",
        normalize_discount="zero_one",
    )
    archive = DiscountArchive(
        solution_dim=DIM,
        measure_dim=2,
        learning_rate=0.1,
        threshold_min=0,
        discount_model_manager=manager,
        result_archive=result_archive,
        init_train_points=20,
        empty_points=5,
        seed=1,
    )
    archive.init_discount_model()
    return archive


gaussian = partial(GaussianEmitter, sigma=0.5)
line = partial(IsoLineEmitter, iso_sigma=0.5, line_sigma=0.2)
strategy = partial(EvolutionStrategyEmitter, sigma0=0.5)
operator = partial(GradientOperatorEmitter, sigma=0.5, sigma_g=0.5)
arborescence = partial(GradientArborescenceEmitter, sigma0=10.0, lr=1.0, grad_opt="gradient_ascent")
mu = {"selection_rule": "mu"}
basic = {"selection_rule": "mu", "restart_rule": "basic"}
imp, rd, nov = {"ranker": "2imp"}, {"ranker": "2rd"}, {"ranker": "nov"}
mae = partial(grid, learning_rate=0.01, threshold_min=0)
near = partial(proximity, novelty_threshold=0.5)
local = partial(proximity, novelty_threshold=0.5, local_competition=True)

# Archive, result archive, emitters.
ALGORITHMS = {
    "map_elites": (grid, None, [gaussian]),
    "line_map_elites": (grid, None, [line]),
    "cvt_map_elites": (cvt, None, [gaussian]),
    "line_cvt_map_elites": (cvt, None, [line]),
    "me_map_elites": (
        grid,
        None,
        [partial(strategy, ranker=name) for name in ("obj", "2rd", "2imp")] + [line],
    ),
    "cma_me_imp": (grid, None, [partial(strategy, **imp)] * 2),
    "cma_me_imp_mu": (grid, None, [partial(strategy, **imp, **mu)] * 2),
    "cma_me_basic": (grid, None, [partial(strategy, **imp, **basic)] * 2),
    "cma_me_rd": (grid, None, [partial(strategy, **rd)] * 2),
    "cma_me_rd_mu": (grid, None, [partial(strategy, **rd, **mu)] * 2),
    "cma_me_opt": (grid, None, [partial(strategy, ranker="obj", **basic)] * 2),
    "cma_me_mixed": (grid, None, [partial(strategy, **rd), partial(strategy, **imp)]),
    "og_map_elites": (grid, None, [partial(operator, measure_gradients=False, normalize_grad=False)]),
    "omg_mega": (grid, None, [partial(operator, sigma=0.0, sigma_g=10.0, measure_gradients=True)]),
    "cma_mega": (grid, None, [partial(arborescence, **mu)] * 2),
    "cma_mega_adam": (grid, None, [partial(arborescence, lr=0.002, grad_opt="adam", **mu)] * 2),
    "cma_mae": (mae, grid, [partial(strategy, ranker="imp", **basic)] * 2),
    "cma_maega": (mae, grid, [partial(arborescence, ranker="imp", restart_rule="basic")] * 2),
    "ns_cma": (near, grid, [partial(strategy, **nov, **basic)] * 2),
    "nslc": (local, grid, [partial(strategy, ranker="nslc")] * 2),
    "nslc_cma_imp": (local, grid, [partial(strategy, **imp)] * 2),
    "dds": (density, grid, [partial(strategy, ranker="density", **basic)] * 2),
    "dds_kde_sklearn": (
        partial(density, "kde_sklearn"),
        grid,
        [partial(strategy, ranker="density", **basic)] * 2,
    ),
    "dms": (discount, grid, [partial(strategy, ranker="imp", **basic)] * 2),
}
WITH_GRADIENTS = ("og_map_elites", "omg_mega", "cma_mega", "cma_mega_adam", "cma_maega")
ELITES_OF_RESULT = ("dds", "dds_kde_sklearn", "dms")


def scheduler(name):
    """A small scheduler of one of the algorithms."""
    make, make_result, emitters = ALGORITHMS[name]
    result = None if make_result is None else make_result()
    archive = make(result) if make is discount else make()
    drawn_from = result if name in ELITES_OF_RESULT else archive
    made = [
        each(drawn_from, x0=np.zeros(DIM), batch_size=BATCH, seed=number)
        for number, each in enumerate(emitters)
    ]
    if name == "me_map_elites":
        return BanditScheduler(archive, made, result, num_active=2, reselect="terminated")
    return Scheduler(archive, made, result)


def sphere(solutions):
    """Objective, measures and their gradients of solutions (n, DIM)."""
    shift = 5.12 * 0.4
    worst = (5.12 + shift) ** 2 * DIM
    objective = 100 * (1 - np.square(solutions - shift).sum(axis=1) / worst)
    far = np.abs(solutions) > 5.12
    bent = np.where(far, 5.12 / np.where(far, solutions, 1), solutions)
    slope = np.where(far, -5.12 / np.square(np.where(far, solutions, 1)), 1)
    half = DIM // 2
    measures = np.stack([bent[:, :half].sum(axis=1), bent[:, half:].sum(axis=1)], axis=1)
    first = np.arange(DIM) < half
    gradients = np.stack([-2 * (solutions - shift), slope * first, slope * ~first], axis=1)
    return objective, measures, gradients


def run(search, iterations, *, gradients):
    """Run a search; returns every solution that was added, in order."""
    added = []
    for _ in range(iterations):
        if gradients:
            points = search.ask_dqd()
            added.append(points.copy())
            search.tell_dqd(*sphere(points))
        solutions = search.ask()
        added.append(solutions.copy())
        search.tell(*sphere(solutions)[:2])
        if isinstance(search.archive, DiscountArchive):
            search.archive.train_discount_model()
    return np.concatenate(added)
