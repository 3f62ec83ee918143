"""How far a build is, in a notebook."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from nichechain.archive.filling import BuildProgress


@contextmanager
def bar_in_notebook(total: int) -> Iterator[Callable[[BuildProgress], None] | None]:
    """A bar of births under the cell that runs; None where there is no notebook or nothing to show it.

    Parameters
    ----------
    total : int
        Births that there will be.
    """
    # Rich draws a bar there by means of ipywidgets, and warns where they are missing.
    if not in_notebook() or importlib.util.find_spec("ipywidgets") is None:
        yield None
        return
    from rich.progress import Progress

    with Progress() as bar:
        task = bar.add_task("", total=total)

        def tell(now: BuildProgress) -> None:
            text = f"{now.births} of {total} births, {now.filled} niches"
            bar.update(task, completed=now.births, description=text)

        yield tell


def in_notebook() -> bool:
    """Whether a kernel of Jupyter runs this, not a terminal or a script."""
    # What was never imported runs nothing.
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ in ("ZMQInteractiveShell", "Shell")
