"""Errors whose message is meant for the person at the terminal."""

from __future__ import annotations


class NichechainError(ValueError):
    """Bad input or an unusable file, said in one sentence.

    The command line prints the sentence and exits with status 2.
    """


class ArchiveError(NichechainError):
    """A folder that is no archive, or one that is damaged or in use."""
