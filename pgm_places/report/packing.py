"""Pictures that are packed while the work goes on.

Packing the pixels of a picture takes longer than drawing most of it, and leaves the interpreter to
others.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Self

from pgm_places.io.atomic import write_bytes
from pgm_places.kernels.threads import resolve_threads
from pgm_places.report.drawing import Drawing

__all__ = ["Packing"]


class Packing:
    """A second thread that makes PNG files of drawings; they are written at the end of the block.

    After an exception nothing more is written. With a single thread, or outside a ``with`` block,
    each picture is written at once.

    Parameters
    ----------
    n_threads : int, optional
        As many as may be used; all cores by default.
    """

    def __init__(self, n_threads: int | None = None) -> None:
        self._n_threads = resolve_threads(n_threads)
        self._pool: ThreadPoolExecutor | None = None
        self._waiting: list[tuple[Path, Future[bytes]]] = []

    def __enter__(self) -> Self:
        if self._n_threads > 1:
            self._pool = ThreadPoolExecutor(1)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        pool, self._pool = self._pool, None
        if pool is None:
            return
        try:
            for path, packed in self._waiting if kind is None else ():
                write_bytes(path, packed.result())
        finally:
            pool.shutdown(cancel_futures=True)

    def write(self, path: Path, picture: Drawing) -> Path:
        """The path to which the picture is written, at the end of the block at the latest."""
        if self._pool is None:
            return write_bytes(path, picture.png())
        self._waiting.append((path, self._pool.submit(picture.png)))
        return path
