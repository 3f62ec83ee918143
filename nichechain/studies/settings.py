"""What all conditions of a study have in common: plain values, which are options of ``nichechain walks``."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Literal

MetricName = Literal["knn", "knn-no-archive", "parent", "ancestors", "kde", "evolvability"]
Mode = Literal["factor", "length"]


@dataclass(frozen=True)
class WalkSettings:
    """How walks are walked, whatever they select for; every default is the paper's ("Hyperparameters").

    Parameters
    ----------
    offspring : int
        Children of a state in each step.
    mutation : str
        Mutation operator: cauchy, gaussian, student-t or uniform-ball.
    scale : float
        Scale of the mutation.
    step_bound : str, optional
        How far a child can be from its parent: per-coordinate:2 truncates the noise on every weight,
        rescaled:50 shortens a step that is longer.
    k : int
        Neighbours of the kNN metrics.
    bandwidth : float
        Smoothing parameter of the KDE metric.
    mode : {"factor", "length"}
        What it multiplies: the covariance of the behaviors, or nothing (a length in units of
        behavior).
    decay : float
        Discount of the KDE metric by age, a factor per step.
    archive_limit : int
        Behaviors that a novelty archive holds at most.
    archive_scope : {"walk", "configuration"}
        Whether each walk has a novelty archive of its own, or all of a kind share one.
    states : int, optional
        States of a multi-state walk at a time, whose population is measured too; by default a walk has one.
    litter : int
        Offspring of its own by which the metric evolvability scores each candidate.
    other_niche : bool
        Only a child in another niche than its parent may follow.
    initialisation : str
        First genotypes: domain, domain:S, normal:S, uniform:S, xavier-normal, ..., or elites:PATH.
    """

    _: KW_ONLY
    offspring: int = 30
    mutation: str = "cauchy"
    scale: float = 1.0
    k: int = 15
    bandwidth: float = 0.5
    mode: Mode = "factor"
    decay: float = 1.0
    archive_limit: int = 1200
    archive_scope: Literal["walk", "configuration"] = "walk"
    step_bound: str | None = None
    states: int | None = None
    litter: int = 10
    other_niche: bool = False
    initialisation: str = "domain"
