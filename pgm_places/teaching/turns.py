"""Turns: of several requests only the newest runs to its end."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from pgm_places.errors import PgmPlacesError
from pgm_places.progress import Progress, Stage

__all__ = ["SupersededError", "Turns"]


class SupersededError(PgmPlacesError):
    """A newer request has taken the place of this one, whose result nobody needs any more."""


class Turns:
    """Requests that supersede each other: threads ask for a turn, and the newest gets it.

    Examples
    --------
    >>> from pgm_places.progress import Silent
    >>> turns = Turns()
    >>> with turns.turn(Silent()) as progress, progress.stage("work"):
    ...     pass
    """

    def __init__(self) -> None:
        self._running, self._counting = threading.Lock(), threading.Lock()
        self._newest = 0

    @contextmanager
    def turn(self, progress: Progress) -> "Iterator[Progress]":
        """Wait until no other runs; the progress raises SupersededError once there is a newer turn.

        Raises
        ------
        SupersededError
            From this method, or from the stages and updates of what it yields.
        """
        number = self._next()
        with self._running:
            watched = _Watched(progress, self, number)
            watched.check()
            yield watched

    def cancel(self) -> None:
        """End whatever runs or waits, at its next stage or update."""
        self._next()

    def is_newest(self, number: int) -> bool:
        """Whether nobody has asked since."""
        return number == self._newest

    def _next(self) -> int:
        with self._counting:
            self._newest += 1
            return self._newest


class _Watched:
    """Progress that ends work that nobody waits for any more."""

    def __init__(self, progress: Progress, turns: Turns, number: int) -> None:
        self._progress, self._turns, self._number = progress, turns, number

    def check(self) -> None:
        if not self._turns.is_newest(self._number):
            raise SupersededError("a newer request has superseded this one")

    @contextmanager
    def stage(self, name: str) -> "Iterator[Stage]":
        self.check()
        with self._progress.stage(name) as stage:
            yield _WatchedStage(stage, self)

    def warn(self, message: str) -> None:
        self._progress.warn(message)


class _WatchedStage:
    def __init__(self, stage: Stage, watched: _Watched) -> None:
        self._stage, self._watched = stage, watched

    def update(self, fraction: float, note: str = "") -> None:
        self._watched.check()
        self._stage.update(fraction, note)
