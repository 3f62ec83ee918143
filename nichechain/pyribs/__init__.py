"""pyribs and nichechain: record a search of pyribs as births, and hand archives over and back.

pyribs keeps elites, but not which of them a solution came from. :func:`record` notes it while a
pyribs script runs, with three added lines::

    from nichechain.pyribs import from_ribs, record   # 1

    scheduler = Scheduler(archive, emitters)
    recording = record(scheduler)                      # 2
    for _ in range(iterations):
        solutions = scheduler.ask()
        scheduler.tell(*evaluate(solutions))

    births = from_ribs(recording, "archives/mine")     # 3

The package is written for pyribs 0.12. Of its emitters, those that draw elites are recorded as they
are; evolution strategies follow a convention, see :class:`Recording`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.core.lazy import lazily
from nichechain.pyribs.conversion import from_ribs, to_ribs
from nichechain.pyribs.recording import Recording
from nichechain.pyribs.schedulers import record

if TYPE_CHECKING:
    from nichechain.pyribs.emitters import MutationEmitter

__all__ = ["MutationEmitter", "Recording", "from_ribs", "record", "to_ribs"]

# An emitter is a class of pyribs, whose import takes seconds.
__getattr__, __dir__ = lazily(__name__, emitters="MutationEmitter")
