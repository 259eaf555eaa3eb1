"""Tasks of the tests of workers: some return, some die, some raise."""

import ctypes
import os
import re
import signal
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from pgm_places.io.staging import claimed


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


def hang(number: int) -> int:
    """For odd numbers, never return from C, where no signal is handled in Python."""
    if number % 2:
        if sys.platform != "linux":
            re.match(r"(?:a|a)+$", "a" * 60 + "b")  # for ages, at the cost of a processor
        mutex = ctypes.create_string_buffer(64)
        for _ in range(2):  # it waits for itself
            ctypes.PyDLL(None).pthread_mutex_lock(mutex)
    return number


def hang_on(function: Callable[[Any], Any], name: str, task: Any) -> Any:
    """What a function makes of a map, unless it is the one of that name: there it hangs."""
    with claimed(task.claim, task.name) if task.name == name else nullcontext():
        hang(task.name == name)
        return function(task)


def rest(seconds: float) -> float:
    time.sleep(seconds)
    return seconds
