"""Build on a Ray cluster of two nodes, lose one of them on the way, and get the same archive.

Both nodes are on this machine, with one processor each: Ray's own utility for testing clusters
starts them. On a real cluster this script needs none of that, only ``execution.make("ray")`` on
the head node. It needs nichechain's extra ``ray`` and takes about half a minute.
"""

import os
import tempfile
from pathlib import Path

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

import ray  # after the line that tells it not to report its use
from ray.cluster_utils import Cluster

import nichechain as nc
from nichechain import domains, execution
from nichechain.archive import BuildProgress

domain = domains.make("fetch")
config = nc.BuildConfig("fetch", (20, 20), domain.bounds, evaluations=400, seed=0)
domain.evaluate(domain.sample(1, seed=0))  # compiles the engine, if it never ran on this machine

memory = 128 * 2**20
cluster = Cluster(
    initialize_head=True,
    head_node_args={"num_cpus": 1, "object_store_memory": memory, "include_dashboard": False},
)
second = cluster.add_node(num_cpus=1, object_store_memory=memory)
ray.init(address=cluster.address, logging_level="ERROR", log_to_driver=False)
lost = False


def watch(progress: BuildProgress) -> None:
    """Report, and take the second node away at half the budget."""
    global lost
    print(f"\r{progress.births} births, {progress.filled} niches filled", end="", flush=True)
    if progress.births >= config.evaluations // 2 and not lost:
        lost = True
        cluster.remove_node(second, allow_graceful=True)
        print("; one node of two is lost")


try:
    with tempfile.TemporaryDirectory() as folder:
        there, here = Path(folder, "cluster"), Path(folder, "threads")
        with execution.make("ray") as executor:
            print(f"{ray.cluster_resources()['CPU']:.0f} processors on {len(ray.nodes())} nodes")
            nc.build(config, there, executor, domain=domain, on_progress=watch)
        print()
        with nc.Threads() as threads:
            nc.build(config, here, threads, domain=domain)
        parts = "births/*.parquet"
        same = [
            a.read_bytes() == b.read_bytes() for a, b in zip(there.glob(parts), here.glob(parts), strict=True)
        ]
        print(nc.load(there))
        print("births are equal to the byte to those of a build with threads:", all(same))
finally:
    ray.shutdown()
    cluster.shutdown()
