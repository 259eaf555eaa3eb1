"""Commands: parsing of their arguments and options, and the call of their function.

Typer imports too slowly and argparse reads -1e-3 as an option; values here share validation and
messages with configuration files.
"""

import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from pgm_places.cli.declarations import Parameter, parameters_of
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
