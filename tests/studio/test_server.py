"""The port that a studio had the last time."""

from pathlib import Path

import pytest

from pgm_places.studio.server import PORT_FILE, _listening_again


def test_the_port_is_that_of_the_last_time(tmp_path: Path) -> None:
    kept = tmp_path / PORT_FILE
    with _listening_again(kept) as first:
        port = first.getsockname()[1]
    assert kept.read_text() == f"{port}\n"
    with _listening_again(kept) as second:
        assert second.getsockname()[1] == port


@pytest.mark.parametrize("text", ["precious", "5" * 9000, ""])
def test_a_link_in_place_of_the_file_is_not_written_through(tmp_path: Path, text: str) -> None:
    (tmp_path / "rc").write_text(text)
    (tmp_path / PORT_FILE).symlink_to("rc")
    with _listening_again(tmp_path / PORT_FILE) as listener:
        assert listener.getsockname()[1] > 0
    assert (tmp_path / "rc").read_text() == text
