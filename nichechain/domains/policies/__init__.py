"""Policies: controllers of genotypes, networks, and the spaces that they act in."""

from nichechain.domains.policies.controllers import MLP, Controller, Policy

__all__ = ["MLP", "Controller", "Policy"]
