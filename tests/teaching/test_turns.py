"""The newest request runs to its end; older ones stop at their next stage."""

import threading

import pytest

from pgm_places.progress import Silent
from pgm_places.teaching.teacher import SupersededError, Turns


def test_a_newer_request_ends_a_running_one_and_all_that_wait() -> None:
    turns, order = Turns(), []
    running, asked = threading.Event(), threading.Event()

    def slow(name: str) -> None:
        try:
            with turns.turn(Silent()) as progress:
                running.set()
                asked.wait(10)
                with progress.stage("work"):
                    order.append(f"{name} worked")
        except SupersededError:
            order.append(f"{name} ended")

    first = threading.Thread(target=slow, args=("first",))
    first.start()
    assert running.wait(10)
    second = threading.Thread(target=turns.cancel)
    second.start()
    second.join(10)
    asked.set()
    first.join(10)
    slow("third")
    assert order == ["first ended", "third worked"]


def test_a_request_that_was_superseded_while_it_waited_does_not_begin() -> None:
    turns, order = Turns(), []

    def wait() -> None:
        try:
            with turns.turn(Silent()):
                order.append("began")
        except SupersededError:
            order.append("ended")

    second = threading.Thread(target=wait)
    with turns.turn(Silent()):
        second.start()
        while turns.is_newest(1):  # until the second has asked
            second.join(0.001)
        turns.cancel()
    second.join(10)
    assert order == ["ended"]


def test_updates_end_a_stage_half_way() -> None:
    turns = Turns()
    with (
        pytest.raises(SupersededError, match="a newer request"),
        turns.turn(Silent()) as progress,
        progress.stage("work") as stage,
    ):
        stage.update(0.1)
        turns.cancel()
        stage.update(0.2)
