"""What a command takes: arguments and options, declared beside the parameters of its function.

``n_threads: Annotated[Whole | None, Option("--threads")] = None`` is an option of one whole number.
The type says what it takes, in the words of every other option. The help is in the docstring of the
function, among its parameters, or in the mark where several commands share it.
"""

import copy
import inspect
import typing
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Union

from pgm_places._option_marks import arms, bare
from pgm_places.options import check_option, described


@dataclass
class Argument:
    """The mark of a parameter that is given by its place on the command line.

    Parameters
    ----------
    metavar : str
        What stands for it in usage and messages.
    help : str
        One sentence.
    """

    metavar: str
    help: str = ""


class Option:
    """The mark of a parameter that is given by a flag.

    Parameters
    ----------
    *flags : str
        ``"--out", "-o"``; :func:`flag_of` the parameter if there are none. A switch that can also
        be turned off is written ``"--correct/--no-correct"``.
    help : str
        One sentence; that of the docstring by default.
    metavar : str, optional
        What stands for its value; the kind of value by default.
    usual : bool or str, optional
        What holds if it is not given and the command finds nothing else, where its default is None.
    """

    def __init__(
        self, *flags: str, help: str = "", metavar: str = "", usual: bool | str | None = None
    ) -> None:
        self.flags, self.help, self.metavar, self.usual = flags, help, metavar, usual


@dataclass(frozen=True)
class Parameter:
    """One thing that a command takes.

    Parameters
    ----------
    name : str
        Of the function's parameter.
    hint : Any
        What it takes.
    declared : Argument or Option
    default : Any
        ``inspect.Parameter.empty`` where it must be given.
    """

    name: str
    hint: Any
    declared: Argument | Option
    default: Any

    @property
    def is_required(self) -> bool:
        """Whether there is no default."""
        return self.default is inspect.Parameter.empty

    @property
    def is_list(self) -> bool:
        """Whether it takes several values."""
        return typing.get_origin(self._kind) is list

    @property
    def is_switch(self) -> bool:
        """Whether it takes no value."""
        return self.hint is bool

    @property
    def flags(self) -> tuple[str, ...]:
        """How an option is given; none of an argument."""
        if isinstance(self.declared, Argument):
            return ()
        return self.declared.flags or (flag_of(self.name),)

    @property
    def switches(self) -> dict[str, bool]:
        """Each flag by itself, and whether it turns on what it names."""
        return {
            flag: position == 0
            for flags in self.flags
            for position, flag in enumerate(flags.split("/"))
        }

    @property
    def shown(self) -> str:
        """What messages call it."""
        return self.flags[0] if self.flags else str(self.declared.metavar)

    @property
    def metavar(self) -> str:
        """What stands for its value."""
        kinds = {Path: "PATH", int: "NUMBER", float: "NUMBER"}
        return self.declared.metavar or kinds.get(bare(arms(self._item)[0]), "TEXT")

    @property
    def _kind(self) -> Any:
        return bare(arms(self.hint)[0])

    @property
    def _item(self) -> Any:
        """What each value has to be, with its limits."""
        if self.is_list:
            return typing.get_args(self._kind)[0]
        return Union[tuple(arm for arm in arms(self.hint) if arm is not NoneType)]  # noqa: UP007

    def read(self, text: str) -> Any:
        """The value that a text says.

        Raises
        ------
        ConfigError
            It is none that the parameter takes.
        """
        kind = bare(arms(self._item)[0])
        if kind in (str, Path):
            return kind(text)
        return check_option(self.shown, self._item, number_in(text, kind))


UNITS = ("_m2", "_m_s", "_m", "_s")
"""Endings of options' names that flags leave out: their help says the unit."""


def flag_of(option: str) -> str:
    """The flag of an option, without the unit.

    Examples
    --------
    >>> flag_of("min_doorway_area_m2")
    '--min-doorway-area'
    """
    unit = next((unit for unit in UNITS if option.endswith(unit)), "")
    return "--" + option.removesuffix(unit).replace("_", "-")


def number_in(text: str, kind: type) -> Any:
    """A number where the text is one, of a kind if it can be; otherwise the text.

    Examples
    --------
    >>> number_in("3", int), number_in("3", float), number_in("3.5", int), number_in("no", int)
    (3, 3.0, 3.5, 'no')
    """
    for wanted in dict.fromkeys((kind, float)):
        try:
            return wanted(text)
        except ValueError:
            continue
    return text


def parameters_of(command: Callable[..., None]) -> list[Parameter]:
    """What a command, or a class of what several commands take, takes, in order."""
    parameters, said = [], described(command)
    for item in inspect.signature(command).parameters.values():
        hint, marks = bare(item.annotation), list(getattr(item.annotation, "__metadata__", ()))
        own = marks.pop() if marks and isinstance(marks[-1], Argument | Option) else Option()
        metavar, text = said.get(item.name, ("", ""))
        declared = copy.copy(own)  # which other commands may share
        declared.metavar, declared.help = own.metavar or metavar, own.help or text
        kind = Annotated[hint, *marks] if marks else hint  # with its own marks
        parameters.append(Parameter(item.name, kind, declared, item.default))
    return parameters
