"""MAP-Elites of QDax inside ``jit`` and ``scan``, recorded by three added lines.

The search is QDax's arm repertoire. What is added for nichechain is marked with ``# +``. Run it anywhere
after installing nichechain with its extra ``qdax``; it takes some seconds on a CPU and leaves
``qdax_arm.png`` in the current folder.
"""

import functools
import tempfile

import jax
from matplotlib.figure import Figure
from qdax.core.containers.mapelites_repertoire import compute_euclidean_centroids
from qdax.core.emitters.mutation_operators import isoline_variation
from qdax.core.emitters.standard_emitters import MixingEmitter
from qdax.core.map_elites import MAPElites
from qdax.tasks.arm import arm_scoring_function
from qdax.utils.metrics import default_qd_metrics

import nichechain as nc
from nichechain import plots
from nichechain.archive import Axes
from nichechain.qdax import RecordingEmitter, from_qdax  # +

JOINTS, BATCH, STEPS = 8, 128, 200

variation = functools.partial(isoline_variation, iso_sigma=0.02, line_sigma=0.1)
emitter = MixingEmitter(None, variation, variation_percentage=1.0, batch_size=BATCH)
emitter = RecordingEmitter(emitter)  # +
search = MAPElites(arm_scoring_function, emitter, functools.partial(default_qd_metrics, qd_offset=1.0))

key, first = jax.random.split(jax.random.key(0))
genotypes = jax.random.uniform(first, (BATCH, JOINTS))
centroids = compute_euclidean_centroids((16, 16), minval=[0.0, 0.0], maxval=[1.0, 1.0])
repertoire, emitter_state, _ = search.init(genotypes, centroids, key)
scan = jax.jit(lambda carry: jax.lax.scan(search.scan_update, carry, (), length=STEPS))
(repertoire, emitter_state, _), metrics = scan((repertoire, emitter_state, key))
print(f"QDax: {float(metrics['coverage'][-1]):.0f} % of cells filled")

with tempfile.TemporaryDirectory() as folder:
    bounds = ((0.0, 1.0), (0.0, 1.0))
    axes = Axes(("x", "y"), "of the arm's reach")
    found = from_qdax(emitter, repertoire, emitter_state, folder, bounds=bounds, axes=axes)  # +
    print(found)

    chain = found.chain()
    scores = nc.niche_evolvability(chain, l=5, lineages=100)
    print(scores.ranking(chain)[["index", "value", "low", "high", "births"]].head().round(1))

    figure = Figure(figsize=(7.5, 6))
    plots.plot_evolvability(found, scores, figure.subplots())
    figure.savefig("qdax_arm.png", dpi=150, bbox_inches="tight")
print("wrote qdax_arm.png")
