"""The help of the commands as text, 80 columns wide."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence

from pgm_places.cli.command import HELP, HELP_SWITCHES, Command
from pgm_places.cli.declarations import Option, Parameter

_SCRIPT = """\
[ -z "$ZSH_VERSION" ] || {{ autoload -U +X compinit bashcompinit; compinit; bashcompinit; }}
_pgm_places() {{
    local words=
    case "$COMP_CWORD ${{COMP_WORDS[1]}}" in
        "1 "*) words="{first}" ;;
{cases}
    esac
    COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _pgm_places pgm-places"""


def completion(options: Iterable[str], commands: Iterable[Command]) -> str:
    """A script for bash and zsh; where nothing of ours fits, files are offered."""
    flags_of = {item.name: [*_flags(item), HELP] for item in commands}
    cases = (
        f'        *" {name}") words="{" ".join(flags)}" ;;' for name, flags in flags_of.items()
    )
    return _SCRIPT.format(first=" ".join([*flags_of, *options, HELP]), cases="\n".join(cases))


def _flags(command: Command) -> list[str]:
    return [flag for item in command.parameters for flag in item.switches]


_WIDTH, _WIDEST_NAME = 80, 28

_SHOW_HELP = (", ".join(reversed(HELP_SWITCHES)), "Show this message and exit.")


def help_of(command: Command) -> str:
    """What a command does and takes."""
    arguments = [item for item in command.parameters if not item.flags]
    options = [item for item in command.parameters if item.flags]
    given = [item.metavar if item.is_required else f"[{item.metavar}]" for item in arguments]
    parts = [
        f"Usage: {' '.join(['pgm-places', command.name, '[OPTIONS]', *given])}",
        *(_filled(paragraph) for paragraph in command.help.split("\n\n")),
        _table("Arguments", ((item.metavar, _line(item)) for item in arguments)),
        _table("Options", [*((_name(item), _line(item)) for item in options), _SHOW_HELP]),
    ]
    return "\n\n".join(part for part in parts if part)


def help_of_all(
    summary: str, options: Mapping[str, str], groups: Mapping[str, Sequence[Command]]
) -> str:
    """What the program does, its own options, and its commands by heading."""
    widest = max(len(item.name) for commands in groups.values() for item in commands)
    parts = [
        "Usage: pgm-places [OPTIONS] COMMAND ...",
        _filled(summary),
        _table("Options", [*options.items(), _SHOW_HELP]),
        *(
            _table(title, ((item.name, item.summary) for item in commands), widest)
            for title, commands in groups.items()
        ),
    ]
    return "\n\n".join(parts)


def _name(item: Parameter) -> str:
    """``-o, --out PATH``, the short flag first."""
    flags = ", ".join(sorted(item.flags, key=len))
    return flags if item.is_switch else f"{flags} {item.metavar}"


def _line(item: Parameter) -> str:
    """A parameter's help and its default."""
    text = item.declared.help
    if item.is_required:
        return f"{text} [required]" if item.flags else text
    holds = item.default
    if holds is None and isinstance(item.declared, Option):
        holds = item.declared.shown_default
    if holds is None or holds is False or holds == "":
        return text
    default = item.flags[0].split("/")[0] if item.is_switch else holds
    return f"{text} [default: {default}]"


def _filled(text: str, *, indent: str = "  ") -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=indent, subsequent_indent=indent)


def _table(title: str, rows: Iterable[tuple[str, str]], widest: int = 0) -> str:
    """A titled two-column help section; empty if there are no rows."""
    listed = list(rows)
    width = min(max([widest, *(len(name) for name, _ in listed)]), _WIDEST_NAME) + 4
    lines = [f"{title}:"] if listed else []
    for name, text in listed:
        filled = _filled(text, indent=" " * width)
        if len(name) > _WIDEST_NAME:
            lines += [f"  {name}", filled]
        else:
            lines.append(f"  {name}".ljust(width) + filled[width:])
    return "\n".join(lines)
