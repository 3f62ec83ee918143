"""Ask a shipped archive which niches lead furthest, and draw the answer.

Run it anywhere after installing nichechain; it takes about ten seconds and leaves
``quickstart.png`` in the current folder.
"""

from matplotlib.figure import Figure

import nichechain as nc
from nichechain import plots

archive = nc.load("fetch-pick-and-place")
print(archive)

# Births from niche to niche give a Markov chain; its rows are estimated, with what is unknown.
chain = archive.chain()
print(chain)

# Which niches will reach the most others within five generations?
scores = nc.niche_evolvability(chain, l=5, lineages=100)
print(scores.ranking(chain, min_births=20)[["index", "value", "low", "high", "births"]].head().round(1))

# One niche, by its grid index: exact for every posterior draw of the chain, then averaged.
best = int(scores.ranking(chain).loc[0, "niche"])
print(nc.l_evolvability(chain, niche=best, l=5, lineages=100))
print(nc.l_evolvability(chain, niche=best, l=1, lineages=30))

# Any row-stochastic matrix is a chain too: two niches that lead on, and one that does not.
toy = nc.NicheChain([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])
print(nc.l_evolvability(toy, niche=0, l=2, lineages=10).value)

figure = Figure(figsize=(13, 7))
left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.45})
plots.plot_evolvability(archive, scores, left)
plots.plot_reachability(archive, chain, right, threshold=0.03)
figure.savefig("quickstart.png", dpi=150, bbox_inches="tight")
print("wrote quickstart.png")
