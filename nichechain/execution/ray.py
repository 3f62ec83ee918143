"""A Ray cluster: where one machine ends. Needs the extra ``nichechain[ray]``."""

from __future__ import annotations

import importlib
import os
from concurrent.futures import Future
from typing import Any

from nichechain.core.errors import NichechainError
from nichechain.execution.base import available_cpus
from nichechain.execution.fleet import Fleet, Outcome, Rows, Workbench, Worker


class Ray(Fleet):
    """Evaluates in Ray actors, one per processor of the cluster.

    nichechain has to be installed on every node. Nodes that join are used from the next batch on;
    rows of those that leave are evaluated elsewhere.

    Parameters
    ----------
    address : str, optional
        ``ray://host:port`` of a cluster's client server. By default what this process is
        connected to, or else the cluster that RAY_ADDRESS names or that runs on this machine, or
        else one that is started here and ends with the executor.
    cache_memory : int, optional
        Bytes that caches of a domain may take on each node; by default as many as the domain says.

    Raises
    ------
    NichechainError
        If Ray is not installed, no cluster answers at the address, or ``cache_memory`` is below 0.
    """

    def __init__(self, address: str | None = None, *, cache_memory: int | None = None) -> None:
        super().__init__(cache_memory)
        self._ray = _import_ray()
        self._connected_here = address is not None or not self._ray.is_initialized()
        if self._connected_here:
            _connect(self._ray, address)
        errors = self._ray.exceptions
        self._lost = (errors.RayActorError, errors.WorkerCrashedError, errors.ObjectLostError)
        self._actor = self._ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0)(Workbench)
        self._pickled: Any = None

    def _size(self) -> int:
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def _neighbours(self) -> int:
        nodes = (node["Resources"].get("CPU", 1) for node in self._ray.nodes() if node["Alive"])
        return max(1, int(max(nodes, default=1)))

    def _send(self, domain: bytes) -> None:
        # Put once, fetched once by each node.
        self._pickled = self._ray.put(domain)

    def _hire(self) -> Worker:
        return _Actor(self._ray, self._actor.remote(self._pickled, self._cache_share))

    def close(self) -> None:
        """End the actors, and the connection if it was made here."""
        if not self._ray.is_initialized():
            return
        super().close()
        self._pickled = None
        if self._connected_here:
            self._ray.shutdown()


class _Actor(Worker):
    def __init__(self, ray: Any, handle: Any) -> None:
        super().__init__()
        self._ray = ray
        self._handle = handle
        self.ready = handle.prepare.remote().future()

    def submit(self, rows: Rows) -> Future[Outcome]:
        future: Future[Outcome] = self._handle.evaluate.remote(rows).future()
        return future

    def stop(self, *, kill: bool) -> None:  # noqa: ARG002  # an idle actor has nothing to leave behind
        self._ray.kill(self._handle)


def _import_ray() -> Any:
    # Ray counts who uses it, unless told not to; nobody asked for that.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise NichechainError(
            f"workers on Ray need Ray, which is not installed ({error}): pip install 'nichechain[ray]'"
        ) from error


def _connect(ray: Any, address: str | None) -> None:
    try:
        ray.init(address=address or "auto", logging_level="ERROR")
    except (ConnectionError, ValueError) as error:
        if address is not None:
            # A client without the token that its cluster wants sees no more than this.
            raise NichechainError(
                f"no Ray cluster answers at {address}, or it wants a token in RAY_AUTH_TOKEN, with "
                f"RAY_AUTH_MODE=token: {error}"
            ) from error
        ray.init(address="local", num_cpus=available_cpus(), include_dashboard=False, logging_level="ERROR")
