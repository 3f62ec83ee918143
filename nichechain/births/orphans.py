"""Births whose parent is not known although they should have one."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

_FEWEST = 0.5
"""Share of births with a parent, after the first batch, below which parents were lost rather than absent."""


def orphan_note(births: pa.Table) -> str | None:
    """What to say where most births after the first batch have no parent; None where all is well.

    Parameters
    ----------
    births : pyarrow.Table
        With the columns ``parent_niche`` and ``step``. Where no step is told all births count.
    """
    step = births["step"].fill_null(0).to_numpy()
    known = births["parent_niche"].is_valid().to_numpy()
    later = step > step.min(initial=0)
    if not later.any():
        later = np.ones(len(births), bool)
    number, parents = int(np.count_nonzero(later)), int(np.count_nonzero(known & later))
    if parents >= _FEWEST * number:
        return None
    which = "" if later.all() else " after the first batch"
    many = (
        f"only {parents} of {number} births{which} have" if parents else f"none of {number} births{which} has"
    )
    return (
        f"{many} a known parent: T rests on births whose parent is known, so find out where parents were "
        "lost before you trust it"
    )
