"""A pyribs script that learns which postures lead furthest, with three added lines.

The search is the well-known arm repertoire: reach every place with the smoothest posture. What is
added for nichechain is marked with ``# +``. Run it anywhere after installing nichechain with its extra
``visualize``; it takes about half a minute and leaves ``pyribs_arm.png`` in the current folder.
"""

import tempfile

import numpy as np
from matplotlib.figure import Figure
from ribs.archives import GridArchive
from ribs.emitters import GaussianEmitter, IsoLineEmitter
from ribs.schedulers import Scheduler
from ribs.visualize import grid_archive_heatmap

import nichechain as nc
from nichechain import plots
from nichechain.archive import Axes
from nichechain.pyribs import from_ribs, record  # +

JOINTS = 12


def evaluate(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Minus the variance of the joint angles, and where the hand of a unit arm is."""
    directions = angles.cumsum(axis=1)
    hand = np.stack([np.cos(directions).mean(axis=1), np.sin(directions).mean(axis=1)], axis=1)
    return -angles.var(axis=1), hand


archive = GridArchive(solution_dim=JOINTS, dims=(20, 20), ranges=[(-1, 1), (-1, 1)], seed=0)
start = np.zeros(JOINTS)
emitters = [
    GaussianEmitter(archive, sigma=0.1, x0=start, batch_size=50, seed=1),
    IsoLineEmitter(archive, iso_sigma=0.05, line_sigma=0.2, x0=start, batch_size=50, seed=2),
]
scheduler = Scheduler(archive, emitters)
recording = record(scheduler)  # +
for _ in range(300):
    scheduler.tell(*evaluate(scheduler.ask()))

print(f"pyribs: {archive.stats.num_elites} cells filled, best {archive.stats.obj_max:.3f}")
with tempfile.TemporaryDirectory() as folder:
    found = from_ribs(recording, folder, axes=Axes(("x", "y"), "arm lengths"))  # +
    print(found)
    for emitter in recording.conventions():
        print(f"  {emitter['emitter']}: parent is {emitter['parent']}")

    # A lineage of this chain is born from emitter to emitter, as often as the search used each.
    chain = found.chain()
    scores = nc.niche_evolvability(chain, l=5, lineages=100)
    print(scores.ranking(chain)[["index", "value", "low", "high", "births"]].head().round(1))

    figure = Figure(figsize=(13.5, 6))
    left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.4})
    bar = {"label": "minus the variance of joint angles (rad²)", "fraction": 0.046, "pad": 0.04}
    grid_archive_heatmap(found.to_ribs(), ax=left, aspect="equal", vmin=-0.3, vmax=0, cbar_kwargs=bar)
    left.set(title="Elites, drawn by pyribs", xlabel="x (arm lengths)", ylabel="y (arm lengths)")
    plots.plot_evolvability(found, scores, right)
    figure.savefig("pyribs_arm.png", dpi=150, bbox_inches="tight")
print("wrote pyribs_arm.png")
