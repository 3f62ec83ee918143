"""How a domain shows itself in a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.core.notebook import facts_table

if TYPE_CHECKING:
    from nichechain.domains.base import Domain


class ShownDomain:
    """Adds a table of what a search needs to know: genotypes, behavior with its bounds, objective."""

    def _repr_html_(self: Domain) -> str:
        unit = f" {self.unit}" if self.unit else ""
        axes = (
            f"{name} from {low:g} to {high:g}{unit}"
            for name, (low, high) in zip(self.behavior_names, self.bounds, strict=True)
        )
        facts = {
            "name": self.name,
            "genotype": f"{self.genotype_length} parameters",
            "behavior": ", ".join(axes),
            "objective": self.objective_name or "none",
            "seed": self.seed,
        }
        return facts_table(repr(self), facts)
