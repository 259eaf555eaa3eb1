"""Exceptions, as one hierarchy that callers can catch at the level they need.

::

    PgmPlacesError
    ├── InputError (ValueError)        an argument, a file or an option does not fit
    │   ├── ConfigError                a configuration file or a method's options
    │   ├── InfeasibleError            potentials that forbid every labelling
    │   ├── MapError                   an occupancy grid, its image or its metadata
    │   ├── LabelError                 ground-truth labels or label names
    │   ├── LogError                   a robot's log, bag or table of poses
    │   └── ModelFileError             a stored model that is damaged or of another kind
    ├── NotFittedError (ValueError)    inference was called before fit
    ├── OutputError (RuntimeError)     a result could not be written; nothing is left half-written
    └── SolverError (RuntimeError)     a numerical solver ended without a usable result

    LearningWarning (UserWarning)      training succeeded, but the model may label badly

Every message states the expected and the actual value, where, and what to do.
"""

import functools
import re
import reprlib
import sys
from collections.abc import Container, Sequence


class PgmPlacesError(Exception):
    """The root of every error that this package raises on purpose."""


class InputError(PgmPlacesError, ValueError):
    """An argument has the wrong shape, type, range or content."""


class ConfigError(InputError):
    """A configuration file, or an option of a method, is not understood."""


class OptionError(ConfigError):
    """A value that an option does not accept; callers add where it came from."""

    def __init__(self, option: str, problem: str) -> None:
        super().__init__(f"{option} {problem}")
        self.option, self.problem = option, problem


class InfeasibleError(InputError):
    """The potentials provably forbid every labelling."""

    def __init__(self, text: str = "") -> None:
        message = "pairwise forbids every labelling: each has an entry of -inf; allow at least one"
        super().__init__(text or message)


class MapError(InputError):
    """An occupancy grid, its image or its metadata is missing, damaged or inconsistent."""


class LabelError(InputError):
    """Ground-truth labels or label names do not fit the map or the configuration."""


class LogError(InputError):
    """A robot's log, bag or table of poses is missing, damaged, or holds nothing to label."""


class ModelFileError(InputError):
    """A stored model is missing, damaged, or from another program."""


class NotFittedError(PgmPlacesError, ValueError):
    """A method was used for inference before ``fit``.

    If scikit-learn is imported, instances are also of its class of that name.
    """

    def __new__(cls, *args: object) -> "NotFittedError":
        """An error of both classes if scikit-learn is imported."""
        theirs = getattr(sys.modules.get("sklearn.exceptions"), "NotFittedError", None)
        if cls is NotFittedError and theirs is not None:
            cls = _both(theirs)
        return super().__new__(cls, *args)

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return NotFittedError, self.args


@functools.cache
def _both(theirs: type) -> type[NotFittedError]:
    """A class derived from this error and scikit-learn's."""
    return type("NotFittedError", (NotFittedError, theirs), {"__module__": __name__})


class LearningWarning(UserWarning):
    """A trained model may label badly; the message says why, and what to do."""


class OutputError(PgmPlacesError, RuntimeError):
    """A result could not be written."""


class SolverError(PgmPlacesError, RuntimeError):
    """A numerical solver ended without a usable result; the message carries its status."""


_HIDDEN = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # control characters, the escapes of terminals among them
    "\u200e\u200f\u2028-\u202e\u2066-\u2069"  # line separators, and marks that turn text around
    "\ud800-\udfff\ufffe\uffff]"  # surrogates and noncharacters
)
_BREAK = re.compile(r"\s*\n\s*")
_MOST_NAMES, _LONGEST_NAME = 50, 100
_shown = reprlib.Repr()
_shown.maxstring = _shown.maxother = _shown.maxlong = 120


def escape_control(text: str, *, keep: str = "") -> str:
    r"""``text`` with terminal control characters escaped, except those in ``keep``.

    Examples
    --------
    >>> print(escape_control("room\x1b[2J"))
    room\x1b[2J
    """

    def spelled(match: re.Match[str]) -> str:
        char = match.group()
        return char if char in keep else char.encode("unicode_escape").decode("ascii")

    return _HIDDEN.sub(spelled, text)


def is_printable(text: str) -> bool:
    """Whether text is allowed in a name: no control characters, no surrogates."""
    return _HIDDEN.search(text) is None


def quoted(value: object) -> str:
    """A value for a message, shortened: it may have megabytes, or be nested a thousand deep."""
    return _BREAK.sub(" ", _shown.repr(value))


def nearest_name(name: str, known: Sequence[str], *, never: Container[str] = ()) -> str:
    """A hint for messages: the most similar known name, and a list of known names.

    Names in ``never`` are listed but not suggested.
    """
    import difflib

    listed = [candidate for candidate in known if len(candidate) <= _LONGEST_NAME][:_MOST_NAMES]
    offered = [candidate for candidate in listed if candidate not in never]
    close = difflib.get_close_matches(name[:_LONGEST_NAME], offered, n=1, cutoff=0.5)
    hint = f"Did you mean {close[0]!r}? " if close else ""
    more = f" and {len(known) - len(listed)} more" if len(listed) < len(known) else ""
    return f"{hint}Known: {', '.join(sorted(listed, key=_counting))}{more}"


def _counting(name: str) -> list[tuple[int, str]]:
    """A key that sorts ``room 2`` before ``room 10``."""
    parts = re.findall(r"[0-9]+|[^0-9]+", name)
    return [(int(part), "") if part.isdecimal() else (0, part) for part in parts]
