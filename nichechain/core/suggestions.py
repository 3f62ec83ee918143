"""What somebody may have meant by a word that is none of those known."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

# Nobody types a longer name.
_LONGEST = 100


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``"; did you mean fetch?"``, to end a sentence with, or nothing where no known word is near.

    Parameters
    ----------
    word : str
    known : iterable of str
    """
    if len(word) > _LONGEST:
        return ""
    words = {each.lower(): each for each in known}
    near = difflib.get_close_matches(word.lower(), words, 1)
    # Who knows how a long name begins does not type the rest.
    near = near or [each for each in words if len(word) > 1 and each.startswith(word.lower())]
    return f"; did you mean {words[near[0]]}?" if near else ""
