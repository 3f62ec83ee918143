"""Errors whose message is meant for the person at the terminal."""

from __future__ import annotations

from nichechain.core.text import printable


class NichechainError(ValueError):
    """Bad input or an unusable file, said in one sentence.

    The command line prints the sentence and exits with status 2. What an archive or a log says of
    itself may stand in it, so what a terminal would obey is escaped.
    """

    def __str__(self) -> str:
        return printable(super().__str__())


class ArchiveError(NichechainError):
    """A folder that is no archive, or one that is damaged or in use."""
