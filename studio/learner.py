"""Learner: a background thread that answers the newest request and drops replaced ones."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, TypeVar

from pgm_places.errors import PgmPlacesError

Question = TypeVar("Question")
Answer = TypeVar("Answer")


class _Superseded(Exception):  # noqa: N818  nothing went wrong
    """A newer request has replaced the current one."""


@dataclass(frozen=True)
class LearnerState:
    """The current stage, its done share from 0 to 1, the number of stages, and the last problem."""

    working: bool = False
    stage: str = ""
    fraction: float = 0.0
    stages: int = 0
    problem: str = ""


class _Reported:
    """Progress that is shown in the browser, and that ends the work once a newer request comes."""

    def __init__(
        self, superseded: Callable[[], bool], show: Callable[[LearnerState], None]
    ) -> None:
        self._superseded, self._show = superseded, show
        self._name, self._n_stages = "", 0

    @contextmanager
    def stage(self, name: str) -> "Iterator[_Reported]":
        self._name = name
        self._n_stages += 1
        self.update(0.0)
        yield self

    def update(self, fraction: float, note: str = "") -> None:  # noqa: ARG002  the protocol's
        if self._superseded():
            raise _Superseded
        self._show(LearnerState(True, self._name, fraction, self._n_stages))

    def warn(self, message: str) -> None:
        """Ignored: warnings are part of the answer."""


class Learner(Generic[Question, Answer]):
    """Answers requests one at a time in the background; a newer request replaces older ones.

    ``done`` receives answers in the learner's thread; ``changed`` is called when the state changes.
    """

    def __init__(
        self,
        work: Callable[[Question, _Reported], Answer],
        done: Callable[[Answer], None],
        changed: Callable[[], None],
    ) -> None:
        self._work, self._done, self._changed = work, done, changed
        self._wake = threading.Condition()
        self._waiting: list[Question] = []
        self._ended = False
        self.state = LearnerState()
        self._thread = threading.Thread(target=self._run, name="learner", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def ask(self, question: Question) -> None:
        """Submit a request, which replaces all earlier ones."""
        with self._wake:
            self._waiting = [question]
            self._wake.notify_all()

    def end(self) -> None:
        """End the thread."""
        with self._wake:
            self._ended = True
            self._waiting = []
            self._wake.notify_all()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)  # a daemon: a long stage does not keep the process

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._ended)
                if self._ended:
                    return
                question = self._waiting.pop()
            self._show(LearnerState(working=True))
            self._show(LearnerState(problem=self._answer(question)))

    def _answer(self, question: Question) -> str:
        """Answer a request; return the problem, or an empty text."""
        reported = _Reported(lambda: bool(self._waiting) or self._ended, self._show)
        try:
            self._done(self._work(question, reported))
        except _Superseded:
            pass
        except (PgmPlacesError, MemoryError) as error:
            return str(error) or "out of memory"
        except Exception as error:  # noqa: BLE001  the thread must live on, and say what happened
            return f"internal error: {error}; the paint is saved"
        return ""

    def _show(self, state: LearnerState) -> None:
        if state != self.state:
            self.state = state
            self._changed()
