"""Tasks of the tests of workers: some return, some die, some raise."""

import os
import signal
import time
from pathlib import Path


def double(number: int) -> int:
    return 2 * number


def die_once(marker: Path) -> str:
    """Kill this process, unless it has been done."""
    if marker.suffix == ".die" and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return marker.name


def die_often(marker: Path) -> str:
    """Kill as many processes as the marker's name says, and leave a byte for each attempt."""
    with marker.open("ab") as file:
        file.write(b".")
    if marker.stat().st_size <= int(marker.name):
        os.kill(os.getpid(), signal.SIGKILL)
    return marker.name


def die_always(number: int) -> int:
    if number == 1:
        os._exit(1)
    return number


def refuse(number: int) -> int:
    if number == 3:
        raise ValueError("no")
    return number


def rest(seconds: float) -> float:
    time.sleep(seconds)
    return seconds
