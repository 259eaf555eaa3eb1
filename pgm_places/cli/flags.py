"""Command-line flags from the options of a class, with one declaration and one wording."""

import functools
import inspect
import itertools
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Generic, TypeVar

from pgm_places.cli.declarations import Option, flag_of, number_in, parameters_of
from pgm_places.options import (
    OptionError,
    from_mapping,
    option_fields,
    option_hints,
    option_lines,
    option_values,
)

T = TypeVar("T")
Command = Callable[..., None]


@dataclass(frozen=True)
class GivenOptions(Generic[T]):
    """Options that were given by flags, and nothing of those that were not.

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


def grouped(parameter: str, cls: type[Any]) -> Callable[[Command], Command]:
    """A decorator: a command takes what the fields of a class declare, as one object of it."""
    fields = {
        item.name: inspect.Parameter(
            item.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=item.default,
            annotation=Annotated[item.hint, item.declared],
        )
        for item in parameters_of(cls)
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
    """The call, said to take what the command takes, but other things for a parameter."""
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
        usual = _default(item.default) if only_given else None
        option = Option(flag, help=lines[item.name], metavar=_metavar(item.default), usual=usual)
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
