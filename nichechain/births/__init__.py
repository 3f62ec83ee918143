"""Births: one row for every evaluated child, the currency of everything after."""

from nichechain.births.joins import across_runs, parent_rows, repeated
from nichechain.births.table import NONE, Offspring, check_columns, make_table, schema

__all__ = [
    "NONE",
    "Offspring",
    "across_runs",
    "check_columns",
    "make_table",
    "parent_rows",
    "repeated",
    "schema",
]
