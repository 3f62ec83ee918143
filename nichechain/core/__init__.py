"""What every room uses: errors, checks, keyed randomness, files, and draws from rows of a matrix.

Users need its errors, and what makes a run's draws: the rest is for the other rooms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.lazy import lazily

if TYPE_CHECKING:
    from nichechain.core.randomness import Purpose, keyed

__all__ = ["ArchiveError", "NichechainError", "Purpose", "keyed"]

__getattr__, __dir__ = lazily(__name__, randomness="Purpose keyed")
