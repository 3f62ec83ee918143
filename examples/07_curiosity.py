"""Does curiosity see what l-evolvability sees? The paper leaves the question open; ask an archive.

The curiosity of a niche is how often children of its elites entered the archive. Its l-evolvability
is how many niches its descendants will reach. The intervals take niches as independent, which
neighbours are not quite. Run it anywhere after installing nichechain; it takes about ten seconds
and leaves ``curiosity.png`` in the current folder.
"""

import numpy as np
from matplotlib.figure import Figure
from scipy import stats

import nichechain as nc
from nichechain import plots
from nichechain.search import curiosity

L, LINEAGES, MIN_BIRTHS = 5, 100, 20

archive = nc.load("fetch-pick-and-place")
births = archive.births()
n = len(archive.niches)


def rank_correlation(x: np.ndarray, y: np.ndarray) -> str:
    """Spearman's rank correlation over niches, with a 95 % bootstrap interval."""

    def statistic(a: np.ndarray, b: np.ndarray) -> float:
        return float(stats.spearmanr(a, b).statistic)

    interval = stats.bootstrap(
        (x, y), statistic, paired=True, vectorized=False, n_resamples=999, method="percentile", rng=0
    ).confidence_interval
    return f"{statistic(x, y):+.2f} ({interval.low:+.2f} to {interval.high:+.2f})"


scores = nc.niche_evolvability(archive.chain(), l=L, lineages=LINEAGES)
table = curiosity(births, by="niche")
table = table[(table["niche"] < n) & (table["children"] >= MIN_BIRTHS)]
niches = table["niche"].to_numpy()
reached = scores.value[niches]

# Scores of the elites of today, which were reset whenever a niche changed hands.
elites = curiosity(births).set_index("uid")["score"]
uids = dict(zip(archive.elites.niche.tolist(), archive.elites.uid.tolist(), strict=True))
today = np.array([elites.get(uids[niche], 0.0) for niche in niches.tolist()])

print(archive)
print(f"{len(niches)} niches with at least {MIN_BIRTHS} children; rank correlation with {L}-evolvability")
print(f"  share of children that entered     {rank_correlation(table['rate'].to_numpy(), reached)}")
print(f"  curiosity score, never reset       {rank_correlation(table['score'].to_numpy(), reached)}")
print(f"  curiosity score of today's elite   {rank_correlation(today, reached)}")

# Few children enter an archive that is nearly full, so a score that is never reset mostly says how
# few children a niche has had, that is how late it was found.
print(f"  number of children, for comparison {rank_correlation(table['children'].to_numpy(), reached)}")

figure = Figure(figsize=(15, 6.5))
left, middle, right = figure.subplots(1, 3, gridspec_kw={"wspace": 0.55})
rates = np.full(n, np.nan)
rates[niches] = table["rate"]
(x0, x1), (y0, y1) = archive.niches.bounds
image = left.imshow(archive.niches.as_grid(rates).T, origin="lower", extent=(x0, x1, y0, y1), cmap="viridis")
figure.colorbar(image, cax=left.inset_axes((1.03, 0, 0.045, 1)), label="share of children that entered")
left.set(title="Curiosity", xlabel="x (m)", ylabel="y (m)")
plots.plot_evolvability(archive, scores, middle, min_births=MIN_BIRTHS)
points = right.scatter(table["rate"], reached, c=table["children"], s=14, cmap="cividis")
figure.colorbar(points, cax=right.inset_axes((1.03, 0, 0.045, 1)), label="children")
right.set(
    title="One point per niche",
    box_aspect=1.4,
    xlabel="share of children that entered",
    ylabel=f"niches reached in {L} generations by {LINEAGES} lineages",
)
figure.savefig("curiosity.png", dpi=150, bbox_inches="tight")
print("wrote curiosity.png")
