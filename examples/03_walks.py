"""Walk a behavior landscape under more and less evolutionary pressure, on the planar arm.

Three kinds of walk start alike: the highly selective one follows its most novel child, the adaptive
one any of the best quarter, the random one any. The arm is no Fetch robot: here pressure visits more
niches, yet the offspring that it leaves behind differ *less* from each other, where the paper finds
more on Fetch. It takes about ten seconds and leaves ``walks.png`` in the current folder.
"""

import numpy as np
from matplotlib.figure import Figure
from scipy import stats

import nichechain as nc
from nichechain import variation, walks
from nichechain.niches import GridNiches

RUNS, STEPS = 30, 50
arm = nc.domains.PlanarArm()
niches = GridNiches((20, 20), arm.bounds)
kinds = {
    "selective": (walks.Selective(), "#d1495b"),
    "adaptive (0.25)": (walks.TopFraction(0.25), "#e8a33d"),
    "random": (walks.Uniform(), "#35618f"),
}

figure = Figure(figsize=(15, 4.6), layout="constrained")
left, middle, right = figure.subplots(1, 3)
for name, (selection, color) in kinds.items():
    config = walks.WalkConfig(selection=selection, seed=0)
    result = walks.walk(arm, variation.gaussian(0.1), config, runs=RUNS, steps=STEPS, niches=niches)

    # η* of every state, and its 95 % t-interval over the walks.
    eta = result.series("expected_evolvability")[..., 0]
    mean, error = eta.mean(axis=1), stats.sem(eta, axis=1) * stats.t.ppf(0.975, RUNS - 1)
    steps = np.arange(STEPS + 1)
    left.fill_between(steps, mean - error, mean + error, color=color, alpha=0.2, linewidth=0)
    left.plot(steps, mean, color=color, label=name)

    # Niches that a walk has stood in so far.
    stood = result.series("niche")[..., 0]
    visited = np.array([[len(set(walk[: step + 1])) for walk in stood.T] for step in steps])
    middle.plot(steps, visited.mean(axis=1), color=color, label=name)

    # One walk of each kind over behavior space.
    path = result.series("behavior")[:, 0, 0]
    right.plot(*path.T, "-", color=color, linewidth=0.8, marker=".", markersize=5, label=name)
    print(f"{name:>16}: η* {mean[0]:.3f} → {mean[-1]:.3f}, {visited[-1].mean():.1f} niches stood in")

left.set(xlabel="step", ylabel="η*, mean distance between offspring (arm lengths)", ylim=(0, None))
middle.set(xlabel="step", ylabel="niches that a walk has stood in", ylim=(0, None))
right.set(xlabel="x (arm lengths)", ylabel="y (arm lengths)", xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
left.set_title(
    f"What the offspring of each state are worth ({RUNS} walks, 95 % intervals)", fontsize="medium"
)
middle.set_title("How far the walks get", fontsize="medium")
right.set_title("One walk of each kind", fontsize="medium")
left.legend(frameon=False)
figure.savefig("walks.png", dpi=130)
print("wrote walks.png")
