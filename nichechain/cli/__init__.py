"""The command line: one module per command, imported only when it is asked for."""

from __future__ import annotations

import builtins
import contextlib
import importlib
import keyword
import os
import re
import sys
from collections.abc import Sequence
from typing import Any

__all__ = ["COMMANDS", "main"]

COMMANDS = {
    "domains": "what can be searched, with bounds and genotype lengths",
    "build": "fill an archive: MAP-Elites that records who was born where",
    "calibrate": "births of unselected lineages, added to an archive that is there",
    "list": "the archives that are at hand",
    "info": "what is in an archive, and what made it",
    "evolvability": "l-evolvability of niches, or of an elite",
    "table": "one row per niche: births, curiosity, l-evolvability, wormholes, dissimila",
    "landscape": "sensitivity, evolvability and dissimila of the elites of an archive",
    "walks": "walks under pressure and with other metrics, tested and reported",
    "study": "searches by several selections of parents, compared and reported",
    "estimate": "the estimate of T, how well it foretells births, and whether they are enough",
    "compare": "l-evolvability, reach and coverage of archives against others",
    "verify": "whether an archive is what its configuration leads to, to the last bit",
    "merge": "archives of one domain, niches and mutation as one",
    "import": "births of another program's search, from CSV or Parquet",
    "plot": "heat maps of an archive and graphs of which niches lead to which",
    "watch": "what the elite of a niche does, as a film or a picture",
    "explore": "a page on which one clicks a niche and sees where its descendants go",
    "sweep": "how many niches the births of an archive fill: too few, too many, and a suggestion",
    "validate": "whether the chain is one, and whether its predictions come true",
    "completion": "a script with which a shell completes commands and options",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default those of the process.

    Returns
    -------
    int
        Exit status: 0, 2 for bad input, 130 if interrupted.
    """
    from nichechain.cli import streams

    # Products of some hundred states are small for threads, and those of OpenBLAS wait for each other in a
    # loop: on a busy machine that takes seven times as long. Only what NumPy finds at its import counts.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with streams.prepared():
        return _run(list(sys.argv[1:] if arguments is None else arguments))


def _run(given: Sequence[str]) -> int:
    debug = "--debug" in given
    quiet = "--quiet" in given
    words = [word for word in given if word not in ("--debug", "--quiet")]
    if not words or words[0] in ("-h", "--help", "help"):
        print(_help())
        return 0
    if words[0] == "--version":
        from nichechain import __version__

        print(f"nichechain {__version__}")
        return 0
    if words[0] not in COMMANDS:
        from nichechain.core.suggestions import did_you_mean

        known = ", ".join(COMMANDS)
        near = did_you_mean(words[0], COMMANDS)
        return _fail(f"there is no command {words[0]!r}: it must be one of {known}{near}")
    from nichechain.cli import progress
    from nichechain.core.errors import NichechainError
    from nichechain.core.optional import missing

    try:
        with progress.quietly() if quiet else contextlib.nullcontext():
            status: int = module_of(words[0]).run(words[1:])
        sys.stdout.flush()
    except NichechainError as error:
        if debug:
            raise
        from nichechain.cli import refusals

        return _fail(refusals.of_options(str(error), words))
    except ModuleNotFoundError as error:
        if debug or (error.name or "").startswith("nichechain"):
            raise
        return _fail(str(missing(error, f"nichechain {words[0]}, asked like this,")))
    except KeyboardInterrupt:
        if debug:
            raise
        return 130
    except BrokenPipeError:
        # Whoever read our output has had enough; Python must not try to flush the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MemoryError as error:
        if debug:
            raise
        return _fail(f"not enough memory: {error or 'ask for less'}")
    except (ValueError, OverflowError) as error:
        # What NumPy says of a shape that no memory holds.
        if debug or not _TOO_LARGE.search(str(error)):
            raise
        return _fail(f"not enough memory, as a number that was asked for is too large: {error}")
    except OSError as error:
        if debug:
            raise
        return _fail(f"{error.strerror or error}: {error.filename}" if error.filename else str(error))
    return status


_TOO_LARGE = re.compile("Maximum allowed dimension|array is too big|too large to convert")


def module_of(command: str) -> Any:
    """The module of a command."""
    # Its name cannot be that of a keyword, and within this package it would hide that of a builtin.
    taken = keyword.iskeyword(command) or hasattr(builtins, command)
    return importlib.import_module(f"nichechain.cli.{command}{'_' * taken}")


def _fail(message: str) -> int:
    print(f"nichechain: error: {message}", file=sys.stderr)
    return 2


def _help() -> str:
    width = max(map(len, COMMANDS))
    lines = [
        "usage: nichechain COMMAND ... [--quiet] [--debug]",
        "",
        "Evolvability in quality-diversity search: which niches will the descendants reach?",
        "",
        "commands:",
        *(f"  {name:<{width}}  {text}" for name, text in COMMANDS.items()),
        "",
        "nichechain COMMAND --help tells a command's options; --json writes tables as JSON;",
        "--quiet shows no progress; --debug shows where an error comes from; --version tells the version.",
        "",
        "try:",
        "  nichechain build fetch",
        "  nichechain evolvability fetch-pick-and-place --top 10",
        "  nichechain plot fetch-pick-and-place reachability --out reachability.png",
    ]
    return "\n".join(lines)
