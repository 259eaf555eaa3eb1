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
    """The completion script for bash and zsh; it falls back to file names."""
    flags_of = {command.name: [*_flags(command), HELP] for command in commands}
    cases = (
        f'        *" {name}") words="{" ".join(flags)}" ;;' for name, flags in flags_of.items()
    )
    return _SCRIPT.format(first=" ".join([*flags_of, *options, HELP]), cases="\n".join(cases))


def _flags(command: Command) -> list[str]:
    return [flag for param in command.parameters for flag in param.switches]


_WIDTH, _WIDEST_NAME = 80, 28

_SHOW_HELP = (", ".join(reversed(HELP_SWITCHES)), "Show this message and exit.")


def help_of(command: Command) -> str:
    """The help of a command."""
    arguments = [param for param in command.parameters if not param.flags]
    options = [param for param in command.parameters if param.flags]
    positions = [
        param.metavar if param.is_required else f"[{param.metavar}]" for param in arguments
    ]
    sections = [
        f"Usage: {' '.join(['pgm-places', command.name, '[OPTIONS]', *positions])}",
        *(_filled(paragraph) for paragraph in command.help.split("\n\n")),
        _table("Arguments", ((param.metavar, _line(param)) for param in arguments)),
        _table(
            "Options",
            [*((_name(param), _line(param)) for param in options), _SHOW_HELP],
        ),
    ]
    return "\n\n".join(section for section in sections if section)


def help_of_all(
    summary: str, options: Mapping[str, str], groups: Mapping[str, Sequence[Command]]
) -> str:
    """The help of the program: its options, and its commands by heading."""
    widest = max(len(command.name) for commands in groups.values() for command in commands)
    sections = [
        "Usage: pgm-places [OPTIONS] COMMAND ...",
        _filled(summary),
        _table("Options", [*options.items(), _SHOW_HELP]),
        *(
            _table(title, ((command.name, command.summary) for command in commands), widest)
            for title, commands in groups.items()
        ),
    ]
    return "\n\n".join(sections)


def _name(param: Parameter) -> str:
    """``-o, --out PATH``, the short flag first."""
    flags = ", ".join(sorted(param.flags, key=len))
    return flags if param.is_switch else f"{flags} {param.metavar}"


def _line(param: Parameter) -> str:
    """A parameter's help and its default."""
    text = param.declared.help
    if param.is_required:
        return f"{text} [required]" if param.flags else text
    default = param.default
    if default is None and isinstance(param.declared, Option):
        default = param.declared.shown_default
    if default is None or default is False or default == "":
        return text
    default = param.flags[0].split("/")[0] if param.is_switch else default
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
