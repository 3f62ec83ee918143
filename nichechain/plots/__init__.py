"""Figures. Every ``plot_`` function draws on a matplotlib Axes and returns it."""

from nichechain.plots.classes import plot_classes, plot_transitions_by_class
from nichechain.plots.episode import plot_motion, watch_elite
from nichechain.plots.explorer import write_explorer
from nichechain.plots.graphs import plot_reachability, plot_wormholes
from nichechain.plots.growth import plot_generations, plot_lineages
from nichechain.plots.maps import plot_elites, plot_evolvability, plot_reach, plot_uncertainty, plot_visits
from nichechain.plots.matrix import plot_transitions
from nichechain.plots.searches import plot_filled
from nichechain.plots.validation import (
    plot_calibration,
    plot_filling,
    plot_reached,
    plot_scores,
    plot_stability,
    plot_surprise,
)
from nichechain.plots.walks import draw_study, plot_runs, plot_walks

__all__ = [
    "draw_study",
    "plot_calibration",
    "plot_classes",
    "plot_elites",
    "plot_evolvability",
    "plot_filled",
    "plot_filling",
    "plot_generations",
    "plot_lineages",
    "plot_motion",
    "plot_reach",
    "plot_reachability",
    "plot_reached",
    "plot_runs",
    "plot_scores",
    "plot_stability",
    "plot_surprise",
    "plot_transitions",
    "plot_transitions_by_class",
    "plot_uncertainty",
    "plot_visits",
    "plot_walks",
    "plot_wormholes",
    "watch_elite",
    "write_explorer",
]
