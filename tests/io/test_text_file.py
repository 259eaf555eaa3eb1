from pathlib import Path

import pytest

from pgm_places.errors import LabelError
from pgm_places.io.input_file import read_text


def test_text_comes_without_its_byte_order_mark(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes("\ufeffröom".encode())
    assert read_text(tmp_path / "file", LabelError, "labels", max_bytes=8) == "röom"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "file: no such file; expected labels"),
        (b"\xff", "file: not UTF-8 text; expected labels"),
        (b"123456789", "file: larger than 8 bytes; expected labels"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "file"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(LabelError) as caught:
        read_text(path, LabelError, "labels", max_bytes=8)
    assert str(caught.value) == f"{tmp_path}/{message}"


def test_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LabelError, match=": is a folder; expected labels"):
        read_text(tmp_path, LabelError, "labels", max_bytes=8)
