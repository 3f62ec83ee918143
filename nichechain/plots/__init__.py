"""Figures. Every function draws on a matplotlib Axes and returns it."""

from nichechain.plots.calibration import plot_calibration, plot_reached
from nichechain.plots.maps import plot_elites, plot_evolvability, plot_visits
from nichechain.plots.matrix import plot_transitions
from nichechain.plots.reachability import plot_reachability

__all__ = [
    "plot_calibration",
    "plot_elites",
    "plot_evolvability",
    "plot_reachability",
    "plot_reached",
    "plot_transitions",
    "plot_visits",
]
