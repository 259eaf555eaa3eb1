"""The process around the commands: signals, exit codes, and errors as one line each.

It imports very little, so that an interrupt during the imports of a command is handled, too.
"""

import atexit
import contextlib
import gc
import importlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any, NoReturn

EXIT_BAD_INPUT = 2
EXIT_NOT_FOUND = 1
EXIT_MAPS_FAILED = 3
EXIT_OUT_OF_MEMORY = 4
EXIT_UNREAD = 141
"""Exit code after SIGPIPE (128 + 13), as pipelines expect."""


class _Stops:
    """Termination signals, raised as an interrupt so that cleanup code runs.

    Without this, SIGTERM would leave temporary files and worker processes behind.
    """

    def __init__(self) -> None:
        self.number: int | None = None

    def _interrupt(self, number: int, _: FrameType | None) -> None:
        self.number = number
        raise KeyboardInterrupt

    @contextlib.contextmanager
    def handled(self) -> Iterator[None]:
        """Handle signals inside the block; only in the main thread."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
        before: dict[int, Any] = {}
        for name in names:
            number = getattr(signal, name)
            if signal.getsignal(number) != signal.SIG_IGN:  # nohup ignores SIGHUP
                before[number] = signal.signal(number, self._interrupt)
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


def main() -> None:
    """Run the command line; bad input is one line on standard error and exit code 2."""
    stops = _Stops()
    try:
        _open_streams()
        with stops.handled():
            _prepare_streams()
            _run()
    except KeyboardInterrupt:
        number = stops.number or signal.SIGINT
        _end("interrupted; no file is left half-written", 128 + number)
    except BrokenPipeError:  # the reader closed the pipe: no message
        _leave(EXIT_UNREAD)
    except ImportError as error:
        if "pgm_places._core" not in str(error):
            raise
        _end(
            "the compiled kernels are missing, or older than the sources that need them; compile "
            'them with "make core" or "pip install --editable ." in the checkout',
            EXIT_BAD_INPUT,
        )
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        _end(f"{where}{error.strerror or error}", EXIT_BAD_INPUT)


def _run() -> None:
    from pgm_places.errors import PgmPlacesError

    # Imported objects stay alive; frequent garbage collections would only cost time.
    gc.set_threshold(100_000, 50, 50)
    # Skip the final garbage collection; the OS reclaims the memory.
    atexit.register(gc.freeze)
    try:
        importlib.import_module("pgm_places.cli.app").run(sys.argv[1:])
        sys.exit()
    except PgmPlacesError as error:
        _end(str(error), EXIT_BAD_INPUT)
    except MemoryError:
        _end("out of memory; use a coarser resolution_m or a smaller window", EXIT_OUT_OF_MEMORY)


def _open_streams() -> None:
    """Reopen closed standard streams (``>&-``) on ``/dev/null``.

    Otherwise the first opened files would get their descriptors, and output printed there.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            descriptor = os.open(os.devnull, os.O_RDWR)  # the lowest free one: the stream's own
            os.set_inheritable(descriptor, True)
            stream = open(descriptor, mode, encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)


def _prepare_streams() -> None:
    """Escape unencodable characters, and print warnings of libraries as one line each."""
    import warnings

    from pgm_places.cli.terminal import warn

    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        warn(str(message))

    warnings.showwarning = show


def _end(message: str, code: int) -> NoReturn:
    from pgm_places.cli.terminal import complain

    complain(f"pgm-places: {message}")
    _leave(code)


def _leave(code: int) -> NoReturn:
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.exit(code)
    # Buffered output cannot be written; without this, Python would try again on exit.
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123
    sys.exit(code)
