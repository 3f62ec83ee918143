"""Births: one row for every evaluated child, the currency of everything after."""

from nichechain.births.table import NONE, Offspring, check_columns, make_table, niches_of, schema

__all__ = ["NONE", "Offspring", "check_columns", "make_table", "niches_of", "schema"]
