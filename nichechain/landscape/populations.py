"""The population's side of a search: how far apart the births of each step are, in behavior and in niches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nichechain.births.table import check_columns
from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.landscape.behaviors import one_hot_evolvability, population_evolvability
from nichechain.niches import Niches

if TYPE_CHECKING:
    import pandas as pd


def population_course(births: pd.DataFrame, niches: Niches) -> pd.DataFrame:
    """Population evolvability ρ* of every step of a search, from its births alone.

    Parameters
    ----------
    births : DataFrame
        Such as of :meth:`nichechain.Archive.births`.
    niches : Niches
        Those of the births.

    Returns
    -------
    DataFrame
        A row for each run and step: ``run`` and ``step``; ``births``, those that did not fail;
        ``population_evolvability``, ρ*, the mean distance between two of them, in units of behavior, NaN
        where there is one; ``one_hot_evolvability``, the share of all niches that they are in, which grows
        with their number. The row of step i + 1 is ρ* of generation i.

    Raises
    ------
    NichechainError
        If the births lack a column, or have other axes than the niches.

    Notes
    -----
    Source: Eq. 10 of the paper, η* over the members of the next generation, and Eq. 9 for their niches.
    """
    import pandas as pd

    if not isinstance(births, pd.DataFrame):
        raise NichechainError(f"births is {shown(births)}, but must be a DataFrame of births")
    axes = sorted(name for name in births.columns if str(name).startswith("behavior_"))
    check_columns(births, "run", "step", "child_niche")
    if len(axes) != len(niches.bounds):
        raise NichechainError(
            f"births have {len(axes)} axes of behavior, but must have {len(niches.bounds)}, as the niches"
        )
    rows = []
    for (run, step), made in births[births["child_niche"].notna()].groupby(["run", "step"], sort=True):
        behavior = made[axes].to_numpy(np.float64)
        landed = made["child_niche"].to_numpy(np.int64)
        rows.append(
            (
                int(run),
                int(step),
                len(made),
                float(population_evolvability(behavior)),
                float(one_hot_evolvability(landed, len(niches))),
            )
        )
    names = ["run", "step", "births", "population_evolvability", "one_hot_evolvability"]
    return pd.DataFrame(rows, columns=names)
