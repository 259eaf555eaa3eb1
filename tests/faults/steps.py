"""Ends or fails a process at one of the steps in which it changes files."""

import errno
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

CHANGES = {"os.rename", "os.mkdir", "os.rmdir", "os.remove", "os.link", "os.symlink", "os.chmod"}
"""The audit events of Python that change files, besides opening one to write."""


class _Steps:
    """Counts the changes; does something at a chosen one."""

    def __init__(self) -> None:
        self.count = 0
        self.at: int | None = None
        self.act: Callable[[], None] | None = None
        self.installed = False

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        if self.act is None or not (event in CHANGES or _writes(event, arguments)):
            return
        self.count += 1
        if self.count == self.at:
            self.act()


def _writes(event: str, arguments: tuple[object, ...]) -> bool:
    flags = arguments[2] if event == "open" else 0
    return isinstance(flags, int) and bool(flags & (os.O_WRONLY | os.O_RDWR))


STEPS = _Steps()


@contextmanager
def step(number: int | None, act: Callable[[], None]) -> Iterator[_Steps]:
    """Do something at the change with this number, from 1; count all of them."""
    if not STEPS.installed:
        sys.addaudithook(STEPS)
        STEPS.installed = True
    STEPS.count, STEPS.at, STEPS.act = 0, number, act
    try:
        yield STEPS
    finally:
        STEPS.act = None


def kill_self() -> None:
    """What the kernel does when memory is short, and what nobody can catch."""
    os.kill(os.getpid(), signal.SIGKILL)


def fill_disk() -> None:
    """The error of a full disk."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def count_steps(work: Callable[[], object]) -> int:
    """In how many steps the work changes files, counted in a process of its own."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        with step(None, kill_self) as steps:
            work()
        os.write(write, str(steps.count).encode())
        os._exit(0)
    os.waitpid(child, 0)
    return int(os.read(read, 20))


def killed_at(number: int, work: Callable[[], object]) -> bool:
    """Whether work in a process of its own was killed at a step, or had ended before it."""
    child = os.fork()
    if not child:
        try:
            with step(number, kill_self):
                work()
        finally:
            os._exit(0)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


def leftovers(folder: Path) -> list[str]:
    """Names in and beside a folder that a finished run does not leave."""
    found = [*folder.parent.iterdir(), *(folder.iterdir() if folder.is_dir() else ())]
    return sorted(path.name for path in found if path.name.endswith((".tmp", ".old", ".swap")))
