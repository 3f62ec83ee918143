"""How commands read options: a typed dataclass each, values out of text, options that many share."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, TypeVar

import tyro

from nichechain.cli import described, refusals
from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive
    from nichechain.core.checks import DomainOption

Command = TypeVar("Command")

ArchivePath: TypeAlias = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(
        metavar="PATH", help="Archive folder, or the name of an archive that ships with nichechain."
    ),
]
_MOST_SEEDS = 10_000
# Such as 1e4 or 2.5e6; two digits of the power are more than any number here needs.
_POWER = re.compile(r"([+-]?\d+)(?:\.(\d+))?[eE]\+?(\d{1,2})")

EstimatorName: TypeAlias = Literal["empirical-bayes", "dirichlet", "mle"]
Workers: TypeAlias = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="WORKERS",
        help="Who evaluates: a number of threads, processes:N, ray or ray://HOST:PORT. "
        "The result is the same.",
        help_behavior_hint="(default: one thread per processor)",
    ),
]
Steps: TypeAlias = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="FROM:TO",
        help="Only births from step FROM of the search up to, and without, step TO; either may be left out.",
        help_behavior_hint="(default: all)",
    ),
]
CacheMemory: TypeAlias = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="SIZE",
        help="Memory on each machine for physics that was computed before, such as 500MB, or 0 for none. "
        "The result is the same.",
        help_behavior_hint="(default: 2GiB)",
    ),
]


def parse(
    command: type[Command],
    arguments: Sequence[str],
    default: Command | None = None,
    name: str | None = None,
) -> Command:
    """Read a command's options; exits where their help is asked for.

    Parameters
    ----------
    command : dataclass
    arguments : sequence of str
    default : instance, optional
        Values of the options that are not given.
    name : str, optional
        What the command is called, by default as its class without ``Command``.

    Raises
    ------
    NichechainError
        If options are unknown or missing, or a text is not what one of them wants.
    """
    name = name or called(command)
    if "--json" in arguments and any(f.name == "format" for f in fields(command)):  # type: ignore[arg-type]
        # The one spelling that every command with a table knows.
        place = list(arguments).index("--json")
        arguments = [*arguments[:place], "--format", "json", *arguments[place + 1 :]]
    asked = {"-h", "--help"}.intersection(arguments)
    shown = described.Described(command, default)
    try:
        with contextlib.nullcontext() if asked else refusals.in_one_sentence(f"nichechain {name}"):
            read: Any = tyro.cli(
                shown.type,
                prog=f"nichechain {name}",
                description=described.description(command),
                args=list(arguments),
                config=(tyro.conf.FlagCreatePairsOff,),
                registry=_kinds(),
            )
    except _Refused as refused:
        raise refused.error from None
    except SystemExit:
        if asked and (examples := getattr(command, "EXAMPLES", ())):
            print("\n".join(["try:", *(f"  {example}" for example in examples)]))
        raise
    return shown.command(read)


def _kinds() -> tyro.constructors.ConstructorRegistry:
    """How values are read that tyro reads otherwise: 1e4 is a whole number."""
    registry = tyro.constructors.ConstructorRegistry()

    @registry.primitive_rule
    def _whole(info: tyro.constructors.PrimitiveTypeInfo) -> Any:
        if info.type is not int:
            return None
        return tyro.constructors.PrimitiveConstructorSpec(
            1,
            "INT",
            lambda words: whole(words[0]),
            lambda value: isinstance(value, int),
            lambda value: [str(value)],
        )

    return registry


def whole(text: str) -> int:
    """A whole number, of digits or as 1e4.

    Raises
    ------
    ValueError
        If it is none.
    """
    match = _POWER.fullmatch(text.strip())
    if match is None:
        return int(text)
    digits, behind, power = match[1], match[2] or "", int(match[3])
    if len(behind) > power:
        raise ValueError(f"invalid literal for int(): {text!r}")
    return int(f"{digits}{behind}{'0' * (power - len(behind))}")


def seeds(text: str) -> list[int]:
    """``"0..3,7"`` as ``[0, 1, 2, 3, 7]``.

    Raises
    ------
    NichechainError
        If the text names no seeds, one twice, or more than 10,000.
    """
    found: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"(\d{1,18})(?:\.\.(\d{1,18}))?", part.strip())
        if match is None:
            raise NichechainError(f"--seeds is {shown(text)}, but must be seeds such as 0..9 or 0,3,5")
        first, last = int(match[1]), int(match[2] or match[1])
        if last - first >= _MOST_SEEDS:
            raise NichechainError(f"--seeds is {shown(text)}, but must be at most {_MOST_SEEDS} seeds")
        found += range(first, last + 1)
    if not found or len(set(found)) < len(found):
        raise NichechainError(f"--seeds is {shown(text)}, but must be seeds such as 0..9 or 0,3,5, each once")
    return found


def seen(archive: Archive, steps: str | None) -> Archive:
    """The archive, or its window of the steps that ``--steps`` names.

    Raises
    ------
    NichechainError
        If the text names no window, or the archive has no births in it.
    """
    if steps is None:
        return archive
    match = re.fullmatch(r"(\d*):(\d*)", steps.strip())
    # Steps are stored in 32 bits.
    last = 2**31 - 1
    window = (min(int(match[1] or 0), last), min(int(match[2] or last), last)) if match else (0, 0)
    if window[0] >= window[1]:
        raise NichechainError(f"--steps is {shown(steps)}, but must be a window FROM:TO, such as 0:100")
    found = archive.during(window)
    if not found.counts.births.sum():
        raise NichechainError(f"--steps is {shown(steps)}, but must be a window with births of parents in it")
    return found


def called(command: Callable[..., Command]) -> str:
    """What users call a command, from the name of its class."""
    return command.__name__.removesuffix("Command").lower()


def option(metavar: str, default: str | None) -> Any:
    """How the help shows an option whose default is worked out later; None is of one that must be given."""
    hint = "(required)" if default is None else f"(default: {default})"
    return tyro.conf.arg(metavar=metavar, help_behavior_hint=hint)


def parsed(option: str, read: Callable[[str, str], Any]) -> Any:
    """An option whose value is made of a text, by what refuses a bad one under the option's name.

    Parameters
    ----------
    option : str
    read : callable
        Told the text and the option; raises :class:`NichechainError`.
    """

    def convert(words: list[str]) -> Any:
        try:
            return read(words[0], option)
        except NichechainError as error:
            raise _Refused(error) from None

    return tyro.constructors.PrimitiveConstructorSpec(
        1, "TEXT", convert, lambda _: True, lambda value: [str(value)]
    )


class _Refused(Exception):  # noqa: N818  # carries an error past tyro, which would frame a ValueError
    def __init__(self, error: NichechainError) -> None:
        super().__init__(str(error))
        self.error = error


def words(text: str | None) -> tuple[str, ...]:
    """``"a, b"`` as ``("a", "b")``; nothing of no text."""
    return () if text is None else tuple(word.strip() for word in text.split(",") if word.strip())


def domain_options(texts: Sequence[str]) -> dict[str, DomainOption]:
    """``["joints=20"]`` as ``{"joints": 20}``."""
    return dict(_domain_option(text) for text in texts)


def domain_option_texts(options: Mapping[str, DomainOption]) -> tuple[str, ...]:
    """What :func:`domain_options` reads as these options."""
    return tuple(
        f"{name}={str(value).lower() if isinstance(value, bool) else value}"
        for name, value in options.items()
    )


def _domain_option(text: str) -> tuple[str, DomainOption]:
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise NichechainError(f"option {text!r} of the domain must be NAME=VALUE, such as joints=20")
    if value.lower() in ("true", "false"):
        return name, value.lower() == "true"
    for kind in (int, float):
        try:
            return name, kind(value)
        except ValueError:
            continue
    return name, value
