"""``nichechain completion``: what a shell needs to complete commands and options."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Annotated, Literal, get_args, get_type_hints

import tyro

from nichechain.cli import COMMANDS, begun, module_of, parsing

_BASH = """_nichechain() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" options
    case "${{COMP_WORDS[1]}}" in
{cases}
        *) options="{commands}" ;;
    esac
    if [[ $COMP_CWORD == 1 ]]; then options="{commands}"; fi
    COMPREPLY=($(compgen -W "$options" -- "$word"))
    if [[ $COMP_CWORD != 1 && $word != -* ]]; then COMPREPLY+=($(compgen -f -- "$word")); fi
}}
complete -o filenames -F _nichechain nichechain"""


@dataclass(frozen=True)
class CompletionCommand:
    """A script that teaches a shell to complete commands and options."""

    shell: Annotated[Literal["bash", "zsh", "fish"], tyro.conf.Positional]
    """For which: eval "$(nichechain completion bash)" in ~/.bashrc, or the like of it."""


def run(arguments: Sequence[str]) -> int:
    """Write the script."""
    shell = parsing.parse(CompletionCommand, arguments).shell
    words = {command: list(_words(command)) for command in COMMANDS}
    if shell == "fish":
        print(_fish(words))
        return 0
    if shell == "zsh":
        print("autoload -U +X bashcompinit && bashcompinit")
    cases = "\n".join(
        f'        {command}) options="{" ".join(found)}" ;;' for command, found in words.items()
    )
    print(_BASH.format(cases=cases, commands=" ".join(COMMANDS)))
    return 0


def _words(command: str) -> Iterator[str]:
    """Options of a command, and what ``walks`` and ``study`` can be asked for, with the options of all."""
    module = module_of(command)
    homes = (module.__name__, begun.__name__)
    made = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and is_dataclass(value) and value.__module__ in homes
    ]
    if command in ("walks", "study"):
        yield from (parsing.called(each) for each in made if not each.__name__.startswith("_"))
    seen: set[str] = set()
    for each in made:
        hints = get_type_hints(each, include_extras=True)
        for field in fields(each):
            if field.name in seen or tyro.conf.Positional in get_args(hints[field.name]):
                continue
            seen.add(field.name)
            yield f"--{field.name.replace('_', '-')}"


def _fish(words: dict[str, list[str]]) -> str:
    lines = ["complete -c nichechain -f -n __fish_use_subcommand"]
    for command, found in words.items():
        text = COMMANDS[command].replace("'", "")
        lines.append(f"complete -c nichechain -f -n __fish_use_subcommand -a {command} -d '{text}'")
        for word in found:
            given = f"-l {word[2:]}" if word.startswith("--") else f"-a {word}"
            lines.append(f"complete -c nichechain -n '__fish_seen_subcommand_from {command}' {given}")
    return "\n".join(lines)
