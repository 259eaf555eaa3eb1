"""Exceptions, as one hierarchy that callers can catch at the level they need.

::

    PgmPlacesError
    ├── InputError (ValueError)        what the caller gave does not fit
    │   ├── ConfigError                a configuration file or a method's options
    │   ├── MapError                   an occupancy grid, its image or its metadata
    │   ├── LabelError                 ground-truth labels or label names
    │   ├── LogError                   a robot's log, bag or table of poses
    │   └── ModelFileError             a stored model that is damaged or of another kind
    ├── NotFittedError (ValueError)    a method was asked to infer before it learned
    ├── OutputError (RuntimeError)     a result could not be written; nothing is left half-written
    └── SolverError (RuntimeError)     a numerical solver ended without a usable result

Every message says what was wanted, what came, where, and what to do.
"""

__all__ = [
    "ConfigError",
    "InputError",
    "LabelError",
    "LogError",
    "MapError",
    "ModelFileError",
    "NotFittedError",
    "OutputError",
    "PgmPlacesError",
    "SolverError",
    "nearest_name",
]


class PgmPlacesError(Exception):
    """The root of every error that this package raises on purpose."""


class InputError(PgmPlacesError, ValueError):
    """An argument has the wrong shape, type, range or content."""


class ConfigError(InputError):
    """A configuration file, or an option of a method, is not understood."""


class MapError(InputError):
    """An occupancy grid, its image or its metadata is missing, damaged or inconsistent."""


class LabelError(InputError):
    """Ground-truth labels or label names do not fit the map or the configuration."""


class LogError(InputError):
    """A robot's log, bag or table of poses is missing, damaged, or holds nothing to label."""


class ModelFileError(InputError):
    """A stored model is missing, damaged, or written by something else."""


class NotFittedError(PgmPlacesError, ValueError):
    """A method that learns was asked to infer before it was fitted."""


class OutputError(PgmPlacesError, RuntimeError):
    """A result could not be written."""


class SolverError(PgmPlacesError, RuntimeError):
    """A numerical solver ended without a usable result; the message carries its status."""


def nearest_name(name: str, known: list[str]) -> str:
    """A sentence that offers the nearest known name and lists them all."""
    import difflib

    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}Known: {', '.join(sorted(known))}"
