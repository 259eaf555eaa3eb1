"""The learner answers the newest question, and lives through whatever goes wrong."""

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from pgm_places.errors import LabelError
from pgm_places.progress import Progress
from pgm_places.studio.relabelling import Learner


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


class Class:
    """A learner whose work waits to be let on."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.answers: list[str] = []
        self.go_on = threading.Event()
        self.learner: Learner[str, str] = Learner(self.work, self.answers.append, lambda: None)
        self.learner.start()

    def work(self, question: str, progress: Progress) -> str:
        self.begun.append(question)
        if question == "wrong":
            raise LabelError("paint two classes")
        if question == "broken":
            raise RuntimeError("a kernel broke")
        with progress.stage("thinking") as stage:
            assert self.go_on.wait(30)
            stage.update(0.5)
        return question.upper()


@pytest.fixture
def pupil() -> Iterator[Class]:
    made = Class()
    yield made
    made.go_on.set()
    made.learner.end()


def test_the_newest_question_replaces_those_before_it(pupil: Class) -> None:
    pupil.learner.ask("a")
    until(lambda: pupil.begun == ["a"])
    assert pupil.learner.state.working and pupil.learner.state.stage == "thinking"
    pupil.learner.ask("b")
    pupil.learner.ask("c")
    pupil.go_on.set()
    until(lambda: pupil.answers == ["C"])
    assert pupil.begun == ["a", "c"]
    until(lambda: not pupil.learner.state.working)


def test_what_went_wrong_is_told_and_the_next_question_answered(pupil: Class) -> None:
    pupil.go_on.set()
    pupil.learner.ask("wrong")
    until(lambda: pupil.learner.state.problem == "paint two classes")
    pupil.learner.ask("broken")
    until(lambda: "a kernel broke; the paint is saved" in pupil.learner.state.problem)
    pupil.learner.ask("right")
    until(lambda: pupil.answers == ["RIGHT"] and pupil.learner.state.problem == "")
