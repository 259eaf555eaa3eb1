"""Declarations of a command's arguments and options, as annotations of its function's parameters.

``n_threads: Annotated[Whole | None, Option("--threads")] = None`` declares an option of one whole
number. The type sets the permitted values and the message for others. The help is in the docstring
of the function, or in the annotation where several commands share the option.
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
from pgm_places.options.marks import unannotated, union_members


@dataclass
class Argument:
    """Annotation of a positional parameter: its name in usage and messages, and a sentence."""

    metavar: str
    help: str = ""


class Option:
    """Annotation of a parameter set by a flag.

    Flags are ``"--out", "-o"``; :func:`flag_of` the parameter by default. A switch that can also be
    turned off is written ``"--correct/--no-correct"``. The help is by default the sentence of the
    docstring, the metavar the type of value; ``shown_default`` is shown where the default is None.
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
    """An argument or option of a command; a required one has the default ``Parameter.empty``."""

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
        """Whether it accepts several values."""
        return typing.get_origin(self._kind) is list

    @property
    def is_switch(self) -> bool:
        """Whether it is a flag without a value."""
        return self.hint is bool

    @property
    def flags(self) -> tuple[str, ...]:
        """The flags of an option; empty for an argument."""
        if isinstance(self.declared, Argument):
            return ()
        return self.declared.flags or (flag_of(self.name),)

    @property
    def switches(self) -> dict[str, bool]:
        """Each flag, and whether it turns the option on."""
        return {
            flag: position == 0
            for flags in self.flags
            for position, flag in enumerate(flags.split("/"))
        }

    @property
    def shown(self) -> str:
        """Its name in messages."""
        return self.flags[0] if self.flags else str(self.declared.metavar)

    @property
    def metavar(self) -> str:
        """The placeholder of its value in the help."""
        kinds = {Path: "PATH", int: "NUMBER", float: "NUMBER"}
        return self.declared.metavar or kinds.get(
            unannotated(union_members(self._value_type)[0]), "TEXT"
        )

    @property
    def _kind(self) -> Any:
        return unannotated(union_members(self.hint)[0])

    @property
    def _value_type(self) -> Any:
        """The type of each value, with its limits."""
        if self.is_list:
            return typing.get_args(self._kind)[0]
        return Union[tuple(arm for arm in union_members(self.hint) if arm is not NoneType)]  # noqa: UP007

    def read(self, text: str) -> Any:
        """Parse and check a value."""
        kind = unannotated(union_members(self._value_type)[0])
        if kind in (str, Path):
            return kind(text)
        return check_option(self.shown, self._value_type, number_in(text, kind))


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
    """Parse a number, as ``kind`` if possible; other text is returned unchanged.

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
    parameters, descriptions = [], described(command)
    for param in inspect.signature(command).parameters.values():
        hint, marks = (
            unannotated(param.annotation),
            list(getattr(param.annotation, "__metadata__", ())),
        )
        own = marks.pop() if marks and isinstance(marks[-1], Argument | Option) else Option()
        metavar, text = descriptions.get(param.name, ("", ""))
        declared = copy.copy(own)  # other commands may share it
        declared.metavar, declared.help = own.metavar or metavar, own.help or text
        kind = Annotated[hint, *marks] if marks else hint  # with the remaining annotations
        parameters.append(Parameter(param.name, kind, declared, param.default))
    return parameters


T = TypeVar("T")
Command = Callable[..., None]


@dataclass(frozen=True)
class GivenOptions(Generic[T]):
    """Options of a class set by flags; unset options are left out of ``values``."""

    cls: type[T]
    values: Mapping[str, Any]
    flags: Mapping[str, str]

    def applied_to(self, others: T) -> T:
        """A copy of an options object, with the flags' values replaced."""
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

    The command receives the object of the class as ``parameter``. ``flags`` are flags with another
    name than :func:`flag_of`; options in ``without`` have no flag, as they have no meaning for the
    command. With ``only_given``, the command gets :class:`GivenOptions` and chooses the defaults.
    """
    hints = {name: hint for name, hint in option_hints(cls).items() if name not in without}
    names = {name: flag_of(name) for name in hints} | dict(flags or {})

    def decorated(command: Command) -> Command:
        @functools.wraps(command)
        def call(**arguments: Any) -> None:
            texts = {name: arguments.pop(name) for name in names}
            values = {
                name: _value(text, hints[name]) for name, text in texts.items() if text is not None
            }
            with named_as_flags(names):
                options = from_mapping(cls, values)  # invalid values are reported before the work
            value = GivenOptions(cls, values, names) if only_given else options
            command(**{parameter: value}, **arguments)

        return _with_flags(call, command, parameter, _parameters(cls, names, only_given))

    return decorated


def grouped(
    parameter: str,
    cls: type[Any],
    *,
    without: Collection[str] = (),
    of: Mapping[str, Any] | None = None,
) -> Callable[[Command], Command]:
    """A decorator that gives a command the flags declared by a class's fields, as one object.

    Fields ``without`` a flag have their defaults; ``of`` replaces the declarations of some fields.
    """
    fields = {
        field.name: inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=(of or {}).get(field.name, Annotated[field.hint, field.declared]),
        )
        for field in parameters_of(cls)
        if field.name not in without
    }

    def decorated(command: Command) -> Command:
        @functools.wraps(command)
        def call(**arguments: Any) -> None:
            command(
                **{parameter: cls(**{name: arguments.pop(name) for name in fields})}, **arguments
            )

        return _with_flags(call, command, parameter, fields.values())

    return decorated


def _with_flags(
    call: Command, command: Command, parameter: str, others: Iterable[inspect.Parameter]
) -> Command:
    """``call`` with the command's signature, ``parameter`` replaced by ``others``."""
    own = inspect.signature(command)
    flags = [param.replace(kind=inspect.Parameter.KEYWORD_ONLY) for param in others]
    taken = (flags if name == parameter else [param] for name, param in own.parameters.items())
    vars(call)["__signature__"] = own.replace(parameters=list(itertools.chain(*taken)))
    return call


@contextmanager
def named_as_flags(flags: Mapping[str, str]) -> Iterator[None]:
    """Name flags instead of options in option errors."""
    try:
        yield
    except OptionError as error:
        raise OptionError(flags.get(error.option, error.option), error.problem) from None


def _parameters(
    cls: type[Any], flags: Mapping[str, str], only_given: bool
) -> list[inspect.Parameter]:
    """A parameter per option: a switch, or text that the class parses and checks."""
    lines, hints = option_lines(cls), option_hints(cls)
    parameters = []
    for field in option_fields(cls):
        if field.name not in flags:
            continue
        flag, is_switch = flags[field.name], hints[field.name] is bool
        if is_switch:
            flag += f"/--no-{flag.removeprefix('--')}"
        option = Option(
            flag,
            help=lines[field.name],
            metavar=_metavar(field.default),
            shown_default=_default(field.default) if only_given else None,
        )
        parameters.append(
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=None if only_given else _default(field.default),
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
    """A default as on the command line; lists are separated by commas."""
    if isinstance(default, tuple):
        return ",".join(map(str, default))
    return default if isinstance(default, bool) else str(default)


def _value(text: str | bool, hint: Any) -> Any:
    """The value of a flag: a number if possible, unless the option is text."""
    if isinstance(text, bool) or hint is str:
        return text
    if typing.get_origin(hint) is tuple:
        return [_value(part.strip(), typing.get_args(hint)[0]) for part in text.split(",")]
    return number_in(text, int)
