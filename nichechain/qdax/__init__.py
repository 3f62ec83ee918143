"""QDax and nichechain: record MAP-Elites of QDax as births, also inside ``jit`` and ``scan``.

A repertoire keeps elites, but not which of them an offspring came from. An emitter that is wrapped
notes it, and nothing else of a script changes::

    from nichechain.qdax import RecordingEmitter, from_qdax          # 1

    emitter = RecordingEmitter(emitter)                              # 2
    map_elites = MAPElites(scoring_function, emitter, metrics_function)
    ...
    archive = from_qdax(emitter, repertoire, emitter_state, "archives/mine", bounds=bounds)  # 3

The package is written for QDax 0.5, the extra ``qdax``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nichechain.core.lazy import lazily
from nichechain.core.optional import missing

if TYPE_CHECKING:
    from nichechain.qdax.conversion import from_qdax
    from nichechain.qdax.emitter import RecordingEmitter

__all__ = ["RecordingEmitter", "from_qdax"]

_load, __dir__ = lazily(__name__, conversion="from_qdax", emitter="RecordingEmitter")


def __getattr__(name: str) -> Any:
    """Names that need JAX, which is an extra."""
    try:
        return _load(name)
    except ModuleNotFoundError as error:
        raise missing(error, f"nichechain.qdax.{name}") from error
