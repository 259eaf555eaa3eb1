"""Pictures packed while the work goes on: all written in the end, or none after an exception."""

import threading
from pathlib import Path

import pytest

from pgm_places.errors import OutputError
from pgm_places.pictures.drawing import Drawing, Packing


class Slow(Drawing):
    """A drawing that says where it was packed, once it may be."""

    def __init__(self, *, may_begin: threading.Event | None = None) -> None:
        super().__init__(4, 3)
        self.may_begin, self.thread = may_begin, 0

    def png(self) -> bytes:
        if self.may_begin is not None:
            assert self.may_begin.wait(10)
        self.thread = threading.get_ident()
        return super().png()


class Broken(Drawing):
    def png(self) -> bytes:
        raise MemoryError("no room")


def test_pictures_are_packed_in_a_second_thread_and_written_at_the_end(tmp_path: Path) -> None:
    event, plain = threading.Event(), Drawing(4, 3).png()
    pictures = [Slow(may_begin=event), Slow()]
    paths = [tmp_path / "a.png", tmp_path / "b.png"]
    with Packing(2) as packing:
        assert [packing.write(*item) for item in zip(paths, pictures, strict=True)] == paths
        assert not any(path.exists() for path in paths)
        event.set()
    assert [path.read_bytes() for path in paths] == [plain, plain]
    assert threading.get_ident() not in {picture.thread for picture in pictures}


@pytest.mark.parametrize("in_block", [True, False])
def test_with_one_thread_or_without_a_block_a_picture_is_written_at_once(
    in_block: bool, tmp_path: Path
) -> None:
    packing, picture = Packing(1 if in_block else 2), Slow()
    if in_block:
        packing.__enter__()
    packing.write(tmp_path / "a.png", picture)
    assert (tmp_path / "a.png").exists()
    assert picture.thread == threading.get_ident()


@pytest.mark.parametrize("raised", [KeyboardInterrupt, OutputError])
def test_after_an_exception_nothing_more_is_written(
    raised: type[BaseException], tmp_path: Path
) -> None:
    event, before = threading.Event(), set(threading.enumerate())
    with pytest.raises(raised, match="stop"), Packing(2) as packing:
        packing.write(tmp_path / "a.png", Slow(may_begin=event))
        packing.write(tmp_path / "b.png", Slow())
        event.set()
        raise raised("stop")
    assert not list(tmp_path.iterdir())
    assert set(threading.enumerate()) <= before


def test_a_failure_of_the_second_thread_is_the_callers(tmp_path: Path) -> None:
    with pytest.raises(MemoryError, match="no room"), Packing(2) as packing:
        packing.write(tmp_path / "a.png", Broken(4, 3))
        packing.write(tmp_path / "b.png", Drawing(4, 3))
    assert not list(tmp_path.iterdir())
