"""Policies: controllers of genotypes, networks, and the spaces that they act in."""
