"""What the parser of options refuses, in one sentence, and what the library does, in words of options."""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.core.suggestions import did_you_mean

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_RULE = re.compile(r"[─━-]{5,}")
_CHOICE = re.compile(
    r"invalid choice '(?P<value>.*)' for argument '(?P<name>.*)'\. Expected one of \((?P<known>.*)\)"
)
_UNION = re.compile(
    r"Error parsing (?P<name>\S+): no type matching (?P<kinds>.*) could be instantiated from "
    r"\['(?P<value>.*?)'\]"
)
_WORD = re.compile(r"Error parsing (?P<name>\S+): (?P<why>.*?)(?P<value>'.*')\.?$")
_MISSING = re.compile(r"Missing value for argument '(?P<name>.*)'")
_PARAMETER = re.compile(r"[a-z]\w*(?= is )")
_KINDS = {"INT": "a whole number", "FLOAT": "a number", "PATH": "a path"}


@contextmanager
def in_one_sentence(name: str) -> Iterator[None]:
    """Have a refusal of the parser raised as :class:`NichechainError`, not framed and printed.

    Parameters
    ----------
    name : str
        The command, whose help is referred to.

    Raises
    ------
    NichechainError
        If the parser refused, and said why in words that are known here.
    """
    said, columns = io.StringIO(), os.environ.get("COLUMNS")
    # On a wide terminal no word is broken.
    os.environ["COLUMNS"] = "2000"
    try:
        with contextlib.redirect_stderr(said):
            yield
    except SystemExit as stopped:
        found = sentence(said.getvalue(), name) if stopped.code else None
        if found is None:
            raise
        said.truncate(0)
        raise NichechainError(found) from None
    finally:
        if columns is None:
            os.environ.pop("COLUMNS")
        else:
            os.environ["COLUMNS"] = columns
        sys.stderr.write(said.getvalue())


def of_options(refusal: str, words: Sequence[str]) -> str:
    """What the library says of a parameter, said of the option that gave it.

    Parameters
    ----------
    refusal : str
        Such as ``elites is 2, but must be at least 3``; of one of several, such as ``level is 'hard'``, the
        option has the plural.
    words : sequence of str
        Of the command line.
    """
    named = _PARAMETER.match(refusal)
    if named is None:
        return refusal
    given = {word.partition("=")[0] for word in words}
    option = f"--{named[0].replace('_', '-')}"
    found = next((each for each in (option, f"{option}s") if each in given), named[0])
    return found + refusal[named.end() :]


def sentence(framed: str, name: str) -> str | None:
    """What a framed refusal says, or None where it is none.

    Parameters
    ----------
    framed : str
    name : str
        The command.
    """
    lines = [line.strip("│| ").strip() for line in _COLOUR.sub("", framed).splitlines()]
    inside = [line for line in lines if line and line[0] not in "╭╰"]
    if len(inside) > 1 and "╭" not in framed and _RULE.match(inside[1]):
        # Where only ASCII can be written, a title and a line stand for the frame.
        inside = inside[2:]
    ends = [place for place, line in enumerate(inside) if _RULE.match(line)]
    if not ends:
        return None
    said, rest = inside[: ends[0]], inside[ends[0] + 1 :]
    found = _reworded(" ".join(said), said, rest)
    return f"{found} (see {name} --help)" if len(found) < 400 else found


def _reworded(text: str, said: list[str], rest: list[str]) -> str:
    if match := _CHOICE.search(text):
        known = [word.strip(" '") for word in match["known"].split(",") if word.strip()]
        if "None" in known:
            # Where nothing is a choice too, the parser holds them in a set, which has no order.
            known = sorted(set(known) - {"None"})
        return _not_one_of(match["name"], match["value"], known)
    if match := _UNION.search(text):
        kinds = [kind for kind in match["kinds"].split("|") if kind != "{None}"]
        # The parser holds them in a set, which has no order.
        words = {word for kind in kinds if kind[0] == "{" for word in kind.strip("{}").split(",")}
        choices = sorted(words - {"None"})
        if choices:
            return _not_one_of(match["name"], match["value"], choices)
        allowed = " or ".join(_KINDS.get(kind, kind) for kind in kinds)
        return f"{match['name']} is {shown(match['value'])}, but must be {allowed}"
    if match := _WORD.search(text):
        allowed = "a whole number" if "int" in match["why"] else "a number"
        value = shown(match["value"].strip("'"))
        return f"{match['name']} is {value}, but must be {allowed}"
    if match := _MISSING.search(text):
        return f"{match['name']} needs a value"
    if text.startswith("Unrecognized options: "):
        odd = text.removeprefix("Unrecognized options: ").split(",")[0].strip()
        near = [line.split()[0].rstrip(",") for line in rest if line.startswith("--")]
        kind = "option" if odd.startswith("-") else "argument"
        return f"there is no {kind} {odd}" + (f"; did you mean {near[0]}?" if near else "")
    if text.startswith("Missing from "):
        missing = [line.split()[0] for line in said[1:] if line.startswith("--") or line.split()[0].isupper()]
        return f"{' and '.join(dict.fromkeys(missing))} must be given"
    return text.rstrip(".")


def _not_one_of(name: str, value: str, known: list[str]) -> str:
    return f"{name} is {shown(value)}, but must be one of {', '.join(known)}{did_you_mean(value, known)}"
