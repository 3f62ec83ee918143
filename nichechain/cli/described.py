"""A command's dataclass as the parser of options is shown it: help in whole lines, options in groups.

A command says in ``GROUPS`` which options its help shows together, and in ``EXAMPLES`` what to try.
"""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, field, fields, make_dataclass
from typing import Annotated, Any, Generic, TypeVar, get_type_hints

import docstring_parser
import tyro

Command = TypeVar("Command")

_WIDEST = 110
# A group may be called like an option.
_PREFIX = "group_"


class Described(Generic[Command]):
    """A dataclass of the same options, in groups.

    Parameters
    ----------
    command : dataclass
    default : instance, optional
        Values of the options that are not given.
    """

    def __init__(self, command: type[Command], default: Command | None = None) -> None:
        self._command, self._default = command, default
        self._hints = get_type_hints(command, include_extras=True)
        self._helps = helps(command)
        groups: Mapping[str, tuple[str, ...]] = getattr(command, "GROUPS", {})
        options = {option.name: option for option in fields(command)}  # type: ignore[arg-type]
        self._groups = {
            title: [options.pop(name) for name in names if name in options] for title, names in groups.items()
        }
        shown = [self._option(option) for option in options.values()]
        for title, members in self._groups.items():
            group = make_dataclass(title, [self._option(member) for member in members], kw_only=True)
            group.__doc__ = None
            # Options are called as they would be without groups.
            hint = Annotated[tyro.conf.OmitArgPrefixes[group], tyro.conf.arg(name=title)]  # type: ignore[valid-type]
            shown.append((_PREFIX + title, hint, field(default_factory=group)))
        self.type: type = make_dataclass(command.__name__, shown, kw_only=True)

    def command(self, read: Any) -> Command:
        """The command, from what was read in groups."""
        values = dict(vars(read))
        for title in self._groups:
            values |= vars(values.pop(_PREFIX + title))
        return self._command(**values)

    def _option(self, option: Field[Any]) -> tuple[str, Any, Any]:
        hint = self._hints[option.name]
        if option.name in self._helps:
            hint = Annotated[hint, tyro.conf.arg(help=self._helps[option.name])]
        if self._default is not None:
            return option.name, hint, field(default=getattr(self._default, option.name))
        if option.default_factory is not MISSING:
            return option.name, hint, field(default_factory=option.default_factory)
        return option.name, hint, field(default=option.default)


def helps(command: type) -> dict[str, str]:
    """What its class, or one that it derives from, says of each option, in one line."""
    found: dict[str, str] = {}
    for each in command.__mro__[:-1]:
        for parameter in docstring_parser.parse_from_object(each).params:
            if parameter.description:
                found.setdefault(parameter.arg_name, _plain(parameter.description))
    return found


def description(command: Callable[..., Any]) -> str:
    """What a command is, in lines that fit the terminal."""
    paragraphs = docstring_parser.parse(command.__doc__ or "").description or ""
    width = min(_WIDEST, shutil.get_terminal_size().columns)
    # The parser joins lines again that begin with a letter.
    return "\n\n".join(
        textwrap.fill(_plain(each), width, subsequent_indent="  ") for each in paragraphs.split("\n\n")
    )


def _plain(text: str) -> str:
    return " ".join(text.replace("``", "").split())
