"""Is an archive what its configuration leads to? Checked by making parts of it again, to the bit.

A child's genotype is a function of its parent's, the run's seed and its uid, and every choice of a
search is a function of its seed and of the births before it. So an archive can be made again from
its configuration: the search without a single evaluation, any birth from its root with one.
"""

from __future__ import annotations

from nichechain.verification.result import Check, Difference, Verification
from nichechain.verification.verifying import VerificationProgress, verify

__all__ = ["Check", "Difference", "Verification", "VerificationProgress", "verify"]
