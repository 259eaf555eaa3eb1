"""Progress reporting: a small protocol that commands implement with bars or lines."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from typing import Protocol


class Stage(Protocol):
    """A running stage."""

    def update(self, fraction: float, note: str = "") -> None:
        """Report that ``fraction`` (0 to 1) of the stage is done."""
        ...


class Progress(Protocol):
    """The protocol of progress reporters."""

    @contextmanager
    def stage(self, name: str) -> Iterator[Stage]:
        """Report a stage, which lasts for the ``with`` block."""
        ...

    def warn(self, message: str) -> None:
        """Show a warning to the user."""
        ...


class Silent:
    """A progress reporter that does nothing; the library's default."""

    def update(self, fraction: float, note: str = "") -> None:
        """Do nothing."""

    @contextmanager
    def stage(self, name: str) -> Iterator[Stage]:  # noqa: ARG002  the protocol's name
        """Do nothing at the stage's start and end."""
        yield self

    def warn(self, message: str) -> None:
        """Do nothing."""


_listening: ContextVar[Progress] = ContextVar("listening", default=Silent())  # noqa: B039  no state


@contextmanager
def reporting_to(progress: Progress | None) -> Iterator[None]:
    """Report stages and warnings of the block to ``progress``; None keeps the current reporter."""
    before = _listening.set(progress or _listening.get())
    try:
        yield
    finally:
        _listening.reset(before)


def report_stage(name: str) -> AbstractContextManager[Stage]:
    """Report a stage to the current reporter for the duration of the block."""
    return _listening.get().stage(name)


def warn(message: str) -> None:
    """Show a warning to the user through the current reporter."""
    _listening.get().warn(message)


class _Noting:
    """A reporter that forwards to another one and collects the warnings."""

    def __init__(self, outer: Progress) -> None:
        self._outer, self.warnings = outer, list[str]()
        self.stage = outer.stage

    def warn(self, message: str) -> None:
        self.warnings.append(message)
        self._outer.warn(message)


@contextmanager
def warnings_noted() -> Iterator[list[str]]:
    """Collect the warnings of the block, which the current reporter shows as well."""
    noting = _Noting(_listening.get())
    with reporting_to(noting):
        yield noting.warnings


def duration(seconds: float) -> str:
    """A duration as text with a suitable unit.

    Examples
    --------
    >>> duration(42), duration(600), duration(9000)
    ('42 s', '10 min', '2.5 h')
    """
    if seconds < 90:
        return f"{seconds:.0f} s" if seconds >= 1 else f"{seconds:.1g} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
