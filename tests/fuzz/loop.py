"""The loop: spoil a file, read it, and see that it is refused in one line, soon and cheaply."""

import random
import resource
import signal
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from pgm_places.errors import PgmPlacesError
from tests.fuzz.readers import Reader

MOST_SECONDS = 1.0
MOST_SECONDS_OF_USE = 20.0
MOST_BYTES = 256 << 20
MOST_BYTES_OF_USE = 1 << 30
MOST_CHARACTERS = 700
MOST_WAITING_S = 600
"""On the clock, for what waits and takes no processor time: a machine may stand still a while."""


class _Hang(BaseException):
    """It went on far beyond the limit."""


@dataclass
class Findings:
    """What happened to the inputs of a reader."""

    n_read: int = 0
    n_refused: int = 0
    bad: list[tuple[str, bytes]] = field(default_factory=list)
    """What was wrong, and the input."""


def run(reader: Reader, folder: Path, seed: int, count: int) -> Findings:
    """Spoil the reader's file ``count`` times; what it takes or refuses in one line is right."""
    found = Findings()
    target = folder / reader.file
    original = target.read_bytes()
    others = {path: path.read_bytes() for path in target.parent.iterdir() if path.is_file()}
    with _limited(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        item = reader.read(folder)  # imports are not counted
        if reader.use is not None:
            reader.use(item, folder)
        for number in range(count):
            data = reader.spoil(original, random.Random(f"{seed} {number}"))
            if problem := problem_of(reader, folder, data, found):
                found.bad.append((f"input {number} of seed {seed}: {problem}", data))
    for path, content in others.items():
        path.write_bytes(content)
    return found


def problem_of(reader: Reader, folder: Path, data: bytes, found: Findings) -> str:
    """What is wrong about how the reader takes these bytes; an empty text where all is well."""
    (folder / reader.file).write_bytes(data)
    reader.after(folder)
    peak, start = peak_bytes(), time.process_time()
    problem = _outcome(reader, folder, found)
    seconds, grown = time.process_time() - start, peak_bytes() - peak
    plain = reader.use is None
    if seconds > (MOST_SECONDS if plain else MOST_SECONDS_OF_USE):
        problem = problem or f"took {seconds:.1f} s"
    if grown > (MOST_BYTES if plain else MOST_BYTES_OF_USE) + len(data):
        problem = problem or f"took {grown >> 20} MB"
    return problem


def _outcome(reader: Reader, folder: Path, found: Findings) -> str:
    try:
        signal.alarm(MOST_WAITING_S)
        item = reader.read(folder)
        if reader.use is not None:
            reader.use(item, folder)
        found.n_read += 1
    except PgmPlacesError as error:
        found.n_refused += 1
        if len(str(error)) > MOST_CHARACTERS:
            return f"a message of {len(str(error))} characters"
    except _Hang:
        return "does not end"
    except BaseException:  # noqa: BLE001  whatever it is, it is a finding
        return traceback.format_exc()
    finally:
        signal.alarm(0)
    return ""


@contextmanager
def _limited() -> Iterator[None]:
    """Alarms end a reader."""

    def stop(*_: object) -> None:
        raise _Hang

    before = signal.signal(signal.SIGALRM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGALRM, before)


def peak_bytes() -> int:
    """The most memory that the process has had; in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
