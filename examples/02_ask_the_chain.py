"""Ask one niche of the shipped archive what becomes of its descendants.

Where do they go, how soon, how many niches do more generations or more lineages reach, and which
transitions are shortcuts? It takes about ten seconds and leaves ``ask_the_chain.png`` in the
current folder.
"""

import numpy as np
from matplotlib.figure import Figure

import nichechain as nc
from nichechain import plots
from nichechain.chain.structure import mean_first_passage_times, wormholes
from nichechain.evolvability import reach

archive = nc.load("fetch-pick-and-place")
chain = archive.chain()

scores = nc.niche_evolvability(chain, l=5, lineages=100)
root = int(scores.ranking(chain).loc[0, "niche"])
print(f"niche {chain.label(root)}: {scores.value[root]:.1f} niches within 5 generations")

# Where: the probability that at least one of 100 lineages visits a niche.
seen = reach(chain, niche=root, l=5, lineages=100)
certain = int((seen.at_least_one > 0.9).sum())
print(f"{certain} niches are visited with a probability above 0.9")

# When: generations until the first descendant of a single lineage arrives.
far = int(np.argmin(np.where(seen.at_least_one > 0.5, seen.at_least_one, 1.0)))
times = mean_first_passage_times(chain, far)
print(f"a single lineage needs {times[root]:.0f} generations on average to niche {chain.label(far)}")

# Shortcuts: transitions far more probable than how far, and where, children usually land.
found = wormholes(chain, beyond="both")
print(found.loc[found["wormhole"], ["parent_index", "child_index", "count", "probability"]].head())

figure = Figure(figsize=(14, 6.5))
left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.4})
plots.plot_reach(archive, seen, left, niche=root)
plots.plot_generations(chain, right, niches=[root])
figure.savefig("ask_the_chain.png", dpi=150, bbox_inches="tight")
print("wrote ask_the_chain.png")
