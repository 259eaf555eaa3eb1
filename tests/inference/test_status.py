"""The words for how a labelling ended."""

import pytest

from pgm_places.inference.labeling import Status


@pytest.mark.parametrize("status", Status)
def test_every_word_is_explained_by_others(status: Status) -> None:
    assert len(status.meaning.split()) >= 5
    assert str(status) not in status.meaning.split()


def test_only_unusual_endings_are_noted() -> None:
    usual = {status for status in Status if not status.note}
    assert usual == {Status.EXACT, Status.CONVERGED}
    assert Status.STOPPED.note == f" (stopped: {Status.STOPPED.meaning})"
