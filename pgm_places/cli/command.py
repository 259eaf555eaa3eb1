"""A command of the program: its parser and its help."""

import inspect
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pgm_places.cli.declarations import Option, Parameter, parameters_of
from pgm_places.cli.terminal import complain
from pgm_places.errors import InputError, nearest_name

HELP = "--help"
HELP_SWITCHES = (HELP, "-h")
FORMER = {
    ("label", "--disc-radius"): "--robot-radius",
    ("simulate", "--radius"): "--robot-radius",
}
"""The new name of each renamed option, by command and former name; kept for one release."""

_FLAG = re.compile(r"-[^\d.]")
"""How a flag begins. A minus sign before a digit belongs to a number; - alone is standard input."""


@dataclass(frozen=True)
class Command:
    """A command: the function's docstring is the help, its annotations are the types."""

    name: str
    function: Callable[..., None]

    @property
    def parameters(self) -> list[Parameter]:
        """Its arguments and options, in order."""
        return parameters_of(self.function)

    @property
    def help(self) -> str:
        """The description, without the section on parameters."""
        return inspect.cleandoc(self.function.__doc__ or "").partition("\n\nParameters\n")[0]

    @property
    def summary(self) -> str:
        """The first sentence of its help."""
        return self.help.partition("\n")[0].partition(". ")[0].rstrip(".") + "."

    def run(self, words: Sequence[str]) -> None:
        """Parse the words of a command line and call the function."""
        self.function(**self.values(words))

    def values(self, words: Sequence[str]) -> dict[str, Any]:
        """The value of each parameter, parsed from the words of a command line."""
        parameters = self.parameters
        arguments = [param for param in parameters if not param.flags]
        positions, values = self._sorted(parameters, words)
        for param in arguments:
            texts = positions if param.is_list else positions[:1]
            positions = positions[len(texts) :]
            if texts:
                values[param.name] = [param.read(text) for text in texts]
        if positions:
            raise self._refusal(f"unexpected argument {positions[0]!r}")
        missing = [
            param.shown for param in parameters if param.is_required and param.name not in values
        ]
        if missing:
            raise self._refusal(f"{' and '.join(missing)} must be given")
        return {param.name: _value(param, values.get(param.name)) for param in parameters}

    def _sorted(
        self, parameters: Sequence[Parameter], words: Sequence[str]
    ) -> tuple[list[str], dict[str, list[Any]]]:
        """The arguments in order, and the values of each option on the line."""
        flags = {flag: (param, on) for param in parameters for flag, on in param.switches.items()}
        rest, positions, values = list(words), list[str](), dict[str, list[Any]]()
        while rest:
            word = rest.pop(0)
            if word == "--":
                positions += rest
                break
            if not _FLAG.match(word):
                positions.append(word)
                continue
            flag, equals, text = word.partition("=")
            if flag[1] != "-":  # -q or -j4 or -o=DIR
                flag, text = word[:2], word[2:].removeprefix("=")
            if (renamed := FORMER.get((self.name, flag))) is not None:
                complain(f"{flag} is now {renamed}; the former name works in this version only")
                flag = renamed
            if flag not in flags:
                raise self._refusal(
                    f"there is no option {flag}.", nearest_name(flag, [*flags, HELP])
                )
            param, is_on = flags[flag]
            if param.is_switch:
                if equals:
                    raise self._refusal(f"{flag} takes no value, got {text!r}")
                rest[:0] = [f"-{text}"] if text else []  # -fq: the other switches of a word
                values[param.name] = [is_on]
                continue
            if not (equals or text):
                if not rest:
                    raise self._refusal(f"{flag} needs a value")
                text = rest.pop(0)
            values.setdefault(param.name, []).append(param.read(text))
        return positions, values

    def _refusal(self, problem: str, *more: str) -> InputError:
        return InputError(" ".join([problem, *more]) + f"; see pgm-places {self.name} {HELP}")


def _value(param: Parameter, values: list[Any] | None) -> Any:
    """The last value of an option, all values of a list option, or the default."""
    if values is None:
        return param.default
    return values if param.is_list else values[-1]


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
