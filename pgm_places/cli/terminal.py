"""What the commands print: text that does nothing to a terminal, whoever named the places."""

import contextlib
import sys
from typing import TYPE_CHECKING

from pgm_places.errors import OutputError, printable

if TYPE_CHECKING:
    from pgm_places.io.output_set import OutputSet

_LONGEST = 2000


def say(text: str) -> None:
    """Print lines of results to standard output, at once.

    Raises
    ------
    OutputError
        They cannot be written, as on a full disk.
    """
    try:
        sys.stdout.write(printable(text, keep="\n") + "\n")
        sys.stdout.flush()  # whoever reads a pipe wants each line now
    except BrokenPipeError:  # nobody reads on, which is no mistake
        raise
    except OSError as error:
        raise OutputError(
            f"cannot write to standard output: {error.strerror or error}; check the free space"
        ) from None


def say_written(files: "OutputSet") -> None:
    """Print a line for every file of a set that has been swapped in."""
    for path in files.written:
        say(f"wrote {path}")


def warn(message: str) -> None:
    """Print a warning to standard error, as one line."""
    complain(f"warning: {message}")


def complain(message: str) -> None:
    """Print a message to standard error, as one line of bounded length."""
    text = printable(message)
    if len(text) > _LONGEST:
        text = f"{text[:_LONGEST]} ..."
    with contextlib.suppress(OSError, ValueError):  # it is full or closed: nobody to tell
        print(text, file=sys.stderr, flush=True)  # noqa: T201  the command line speaks
