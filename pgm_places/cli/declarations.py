"""What a command takes: arguments and options, declared beside the parameters of its function.

``n_threads: Annotated[Whole | None, Option("--threads")] = None`` is an option of one whole number.
The type says what it takes, in the words of every other option. The help is in the docstring of the
function, among its parameters, or in the mark where several commands share it.
"""

import copy
import functools
import inspect
import itertools
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Generic, TypeVar, Union

from pgm_places._option_marks import unannotated, union_members
from pgm_places.options import (
    OptionError,
    check_option,
    described,
    from_mapping,
    option_fields,
    option_hints,
    option_lines,
    option_values,
)


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
    shown_default : bool or str, optional
        What holds if it is not given and the command finds nothing else, where its default is None.
    """

    def __init__(
        self,
        *flags: str,
        help: str = "",
        metavar: str = "",
        shown_default: bool | str | None = None,
    ) -> None:
        self.flags, self.help, self.metavar = flags, help, metavar
        self.shown_default = shown_default


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
        return self.declared.metavar or kinds.get(unannotated(union_members(self._item)[0]), "TEXT")

    @property
    def _kind(self) -> Any:
        return unannotated(union_members(self.hint)[0])

    @property
    def _item(self) -> Any:
        """What each value has to be, with its limits."""
        if self.is_list:
            return typing.get_args(self._kind)[0]
        return Union[tuple(arm for arm in union_members(self.hint) if arm is not NoneType)]  # noqa: UP007

    def read(self, text: str) -> Any:
        """The value that a text says.

        Raises
        ------
        ConfigError
            It is none that the parameter takes.
        """
        kind = unannotated(union_members(self._item)[0])
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
    """The parameters of a command or of a shared options class, in order."""
    parameters, said = [], described(command)
    for item in inspect.signature(command).parameters.values():
        hint, marks = (
            unannotated(item.annotation),
            list(getattr(item.annotation, "__metadata__", ())),
        )
        own = marks.pop() if marks and isinstance(marks[-1], Argument | Option) else Option()
        metavar, text = said.get(item.name, ("", ""))
        declared = copy.copy(own)  # which other commands may share
        declared.metavar, declared.help = own.metavar or metavar, own.help or text
        kind = Annotated[hint, *marks] if marks else hint  # with its own marks
        parameters.append(Parameter(item.name, kind, declared, item.default))
    return parameters


T = TypeVar("T")
Command = Callable[..., None]


@dataclass(frozen=True)
class GivenOptions(Generic[T]):
    """Options set by flags; unset options are left out.

    Parameters
    ----------
    cls : dataclass
        Whose options they are.
    values : mapping of str to value
    flags : mapping of str to str
        The flag of each option of the class.
    """

    cls: type[T]
    values: Mapping[str, Any]
    flags: Mapping[str, str]

    def over(self, others: T) -> T:
        """The options of an object, those that were given in their place."""
        with named_as_flags(self.flags):
            return from_mapping(self.cls, {**option_values(others), **self.values})


def option_flags(
    parameter: str,
    cls: type[Any],
    flags: Mapping[str, str] | None = None,
    *,
    without: Collection[str] = (),
    only_given: bool = False,
) -> Callable[[Command], Command]:
    """A decorator that gives a command a flag for each option of a class.

    Parameters
    ----------
    parameter : str
        The parameter of the command that takes the object of the class.
    cls : dataclass
        Names, defaults, ranges and help are those that it declares.
    flags : mapping of str to str, optional
        Flags that are not called as :func:`flag_of` would call them.
    without : collection of str
        Options that mean nothing to the command: they keep their defaults.
    only_given : bool
        The parameter takes :class:`GivenOptions` rather than an object of the class: the defaults
        are for the command to choose.
    """
    hints = {name: hint for name, hint in option_hints(cls).items() if name not in without}
    names = {name: flag_of(name) for name in hints} | dict(flags or {})

    def decorated(command: Command) -> Command:
        @functools.wraps(command)
        def call(**given: Any) -> None:
            texts = {name: given.pop(name) for name in names}
            values = {
                name: _value(text, hints[name]) for name, text in texts.items() if text is not None
            }
            with named_as_flags(names):
                options = from_mapping(cls, values)  # what is wrong shows before the work
            asked = GivenOptions(cls, values, names) if only_given else options
            command(**{parameter: asked}, **given)

        return _taking(call, command, parameter, _parameters(cls, names, only_given))

    return decorated


def grouped(
    parameter: str,
    cls: type[Any],
    *,
    without: Collection[str] = (),
    of: Mapping[str, Any] | None = None,
) -> Callable[[Command], Command]:
    """A decorator: a command takes what the fields of a class declare, as one object of it.

    Fields ``without`` a flag keep their defaults; ``of`` declares some as other commands do.
    """
    fields = {
        item.name: inspect.Parameter(
            item.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=item.default,
            annotation=(of or {}).get(item.name, Annotated[item.hint, item.declared]),
        )
        for item in parameters_of(cls)
        if item.name not in without
    }

    def decorated(command: Command) -> Command:
        @functools.wraps(command)
        def call(**given: Any) -> None:
            command(**{parameter: cls(**{name: given.pop(name) for name in fields})}, **given)

        return _taking(call, command, parameter, fields.values())

    return decorated


def _taking(
    call: Command, command: Command, parameter: str, others: Iterable[inspect.Parameter]
) -> Command:
    """``call`` with the command's signature, ``parameter`` replaced by ``others``."""
    own = inspect.signature(command)
    flags = [item.replace(kind=inspect.Parameter.KEYWORD_ONLY) for item in others]
    taken = (flags if name == parameter else [item] for name, item in own.parameters.items())
    vars(call)["__signature__"] = own.replace(parameters=list(itertools.chain(*taken)))
    return call


@contextmanager
def named_as_flags(flags: Mapping[str, str]) -> Iterator[None]:
    """Have errors of options name the flags that gave them."""
    try:
        yield
    except OptionError as error:
        raise OptionError(flags.get(error.option, error.option), error.problem) from None


def _parameters(
    cls: type[Any], flags: Mapping[str, str], only_given: bool
) -> list[inspect.Parameter]:
    """A parameter per option: a switch, or text that the class itself reads and checks."""
    lines, hints = option_lines(cls), option_hints(cls)
    parameters = []
    for item in option_fields(cls):
        if item.name not in flags:
            continue
        flag, is_switch = flags[item.name], hints[item.name] is bool
        if is_switch:
            flag += f"/--no-{flag.removeprefix('--')}"
        option = Option(
            flag,
            help=lines[item.name],
            metavar=_metavar(item.default),
            shown_default=_default(item.default) if only_given else None,
        )
        parameters.append(
            inspect.Parameter(
                item.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=None if only_given else _default(item.default),
                annotation=Annotated[bool, option] if is_switch else Annotated[str, option],
            )
        )
    return parameters


def _metavar(default: Any) -> str:
    if isinstance(default, bool):
        return ""
    if isinstance(default, tuple):
        return "TEXT,..." if isinstance(default[0], str) else "LOW,HIGH"
    return "NUMBER" if isinstance(default, int | float) else "TEXT"


def _default(default: Any) -> bool | str:
    """A default as one would write it: items of a list with commas between."""
    if isinstance(default, tuple):
        return ",".join(map(str, default))
    return default if isinstance(default, bool) else str(default)


def _value(text: str | bool, hint: Any) -> Any:
    """What a flag's text says: a number where it is one and the option is not text."""
    if isinstance(text, bool) or hint is str:
        return text
    if typing.get_origin(hint) is tuple:
        return [_value(part.strip(), typing.get_args(hint)[0]) for part in text.split(",")]
    return number_in(text, int)
