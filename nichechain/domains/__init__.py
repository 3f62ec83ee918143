"""Domains: behavior functions from genotypes to behaviors."""

from __future__ import annotations

from nichechain.domains.arm import PlanarArm
from nichechain.domains.base import Domain, Evaluation
from nichechain.domains.descriptors import Episode
from nichechain.domains.fetch import FetchPickAndPlace, FetchPush, FetchReach, FetchSlide
from nichechain.domains.gym import GymDomain
from nichechain.domains.noise import Noise, Noisy, Perturbable, WithSensitivity, noise_sensitivity
from nichechain.domains.registry import make, names
from nichechain.domains.toy import CosinusMap, LinearMap
from nichechain.domains.watching import Film, Motion, Watchable, watch

__all__ = [
    "CosinusMap",
    "Domain",
    "Episode",
    "Evaluation",
    "FetchPickAndPlace",
    "FetchPush",
    "FetchReach",
    "FetchSlide",
    "Film",
    "GymDomain",
    "LinearMap",
    "Motion",
    "Noise",
    "Noisy",
    "Perturbable",
    "PlanarArm",
    "Watchable",
    "WithSensitivity",
    "make",
    "names",
    "noise_sensitivity",
    "watch",
]
