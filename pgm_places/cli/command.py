"""A command: a function that is run with what a command line says.

Typer imports too slowly and argparse reads -1e-3 as an option; values here share validation and
messages with configuration files.
"""

import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from pgm_places.cli.declarations import Parameter, parameters_of
from pgm_places.errors import InputError, nearest_name

HELP = "--help"
HELP_SWITCHES = (HELP, "-h")
_FLAG = re.compile(r"-[^\d.]")
"""How a flag begins. A minus sign before a digit belongs to a number; - alone is standard input."""


@dataclass(frozen=True)
class Command:
    """A command of ``pgm-places``.

    Parameters
    ----------
    name : str
    function : callable
        What it does; its docstring is the help, its annotations are what it takes.
    """

    name: str
    function: Callable[..., None]

    @property
    def parameters(self) -> list[Parameter]:
        """What it takes."""
        return parameters_of(self.function)

    @property
    def help(self) -> str:
        """What it does, in paragraphs."""
        return inspect.cleandoc(self.function.__doc__ or "").partition("\n\nParameters\n")[0]

    @property
    def summary(self) -> str:
        """The first sentence of its help."""
        return self.help.partition("\n")[0].partition(". ")[0].rstrip(".") + "."

    def run(self, words: Sequence[str]) -> None:
        """Do what the words say.

        Raises
        ------
        InputError
            They are not what the command takes.
        """
        self.function(**self.values(words))

    def values(self, words: Sequence[str]) -> dict[str, Any]:
        """What the words of a command line say for each parameter of the function."""
        parameters = self.parameters
        arguments = [item for item in parameters if not item.flags]
        positions, given = self._sorted(parameters, words)
        for item in arguments:
            texts = positions if item.is_list else positions[:1]
            positions = positions[len(texts) :]
            if texts:
                given[item.name] = [item.read(text) for text in texts]
        if positions:
            raise self._refusal(f"{positions[0]!r} is one argument too many")
        missing = [item.shown for item in parameters if item.is_required and item.name not in given]
        if missing:
            raise self._refusal(f"{' and '.join(missing)} must be given")
        return {item.name: _value(item, given.get(item.name)) for item in parameters}

    def _sorted(
        self, parameters: Sequence[Parameter], words: Sequence[str]
    ) -> tuple[list[str], dict[str, list[Any]]]:
        """The arguments in their order, and the values of each option that is given."""
        flags = {flag: (item, on) for item in parameters for flag, on in item.switches.items()}
        rest, positions, given = list(words), list[str](), dict[str, list[Any]]()
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
            if flag not in flags:
                raise self._refusal(
                    f"there is no option {flag}.", nearest_name(flag, [*flags, HELP])
                )
            item, is_on = flags[flag]
            if item.is_switch:
                if equals:
                    raise self._refusal(f"{flag} takes no value, got {text!r}")
                rest[:0] = [f"-{text}"] if text else []  # -fq: the other switches of a word
                given[item.name] = [is_on]
                continue
            if not (equals or text):
                if not rest:
                    raise self._refusal(f"{flag} needs a value")
                text = rest.pop(0)
            given.setdefault(item.name, []).append(item.read(text))
        return positions, given

    def _refusal(self, problem: str, *more: str) -> InputError:
        return InputError(" ".join([problem, *more]) + f"; see pgm-places {self.name} {HELP}")


def _value(item: Parameter, given: list[Any] | None) -> Any:
    """The values that are given as the function takes them: the last one, or a list of all."""
    if given is None:
        return item.default
    return given if item.is_list else given[-1]
