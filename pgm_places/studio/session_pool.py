"""Pool of the maps of one studio; a few sessions are open at a time."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from pgm_places.errors import InputError, PgmPlacesError
from pgm_places.studio.export_folders import ExportFolders
from pgm_places.studio.session import MapSession
from pgm_places.studio.training_config import write_training

MOST_OPEN = 4
"""So many maps stay in memory with all that is known of their cells, and all that have a tab."""

LIVE_S = 25.0
"""A tab polls more often than this; one that does not was closed."""


@dataclass(frozen=True)
class MapEntry:
    """A map that may be opened.

    Parameters
    ----------
    title : str
    folder : Path
        Where its paint is kept.
    open : callable
        Makes its session.
    """

    title: str
    folder: Path
    open: Callable[[], MapSession]


class Tabs:
    """The tabs of a browser that show one map; all methods may be called from any thread."""

    def __init__(self) -> None:
        self._seen: dict[str, float] = {}

    def seen(self, tab: str) -> None:
        """A tab has polled."""
        if tab.isalnum() and len(tab) <= 40:
            self._seen[tab] = time.monotonic()

    def left(self, tab: str) -> None:
        """A tab was closed."""
        self._seen.pop(tab, None)

    def __len__(self) -> int:
        oldest = time.monotonic() - LIVE_S
        for tab in [tab for tab, seen in list(self._seen.items()) if seen < oldest]:
            self.left(tab)
        return len(self._seen)


class SessionPool:
    """Maps that are taught one after the other; all methods may be called from any thread.

    Parameters
    ----------
    books : sequence of Book
        At least one.
    folder : Path
        Where that is kept which belongs to all of them.
    export_folders : ExportFolders, optional
        Where exports may go; by default into the maps' folders and below the current one.

    Attributes
    ----------
    closing : bool
        Whether the studio ends.
    tabs : tuple of Tabs
        The live tabs of each map.
    """

    def __init__(
        self, books: Sequence[MapEntry], folder: Path, export_folders: ExportFolders | None = None
    ) -> None:
        self.books, self.folder, self.closing = tuple(books), folder, False
        self.export_folders = export_folders or ExportFolders.started_here()
        self._open: dict[int, MapSession] = {}  # the one that was used last is last
        self._known: dict[int, dict[str, Any]] = {}
        self.tabs = tuple(Tabs() for _ in self.books)
        self._lock = threading.Lock()

    @classmethod
    def of(cls, session: MapSession, export_folders: ExportFolders | None = None) -> Self:
        """That of one map."""
        book = MapEntry(session.source.yaml_path.stem, session.folder, lambda: session)
        found = cls([book], session.folder, export_folders)
        found._open[0] = session
        return found

    def start(self) -> None:
        """Begin to label the maps that are open already."""
        for session in self._open.values():
            session.start()

    def __len__(self) -> int:
        return len(self.books)

    def session(self, number: int) -> MapSession:
        """The session of a map, opened where it is not.

        The map without a live tab that was used least recently is closed where too many are open.
        Maps with a tab stay open: their tabs would open them again at once.

        Raises
        ------
        InputError
            There is no such map, or it cannot be read.
        """
        if not 0 <= number < len(self):
            raise InputError(f"there is no map {number}; there are {len(self)}")
        with self._lock:
            session = self._open.pop(number, None)
            if session is None:
                unwatched = [other for other in self._open if not len(self.tabs[other])]
                for other in unwatched[: max(len(self._open) - MOST_OPEN + 1, 0)]:
                    self._close(other)
                try:
                    session = self.books[number].open()
                except PgmPlacesError as error:
                    self._known[number] = {"problem": str(error)}
                    raise
                session.start()
            self._open[number] = session
            return session

    def records(self) -> list[dict[str, Any]]:
        """How far each map is, as plain data."""
        with self._lock:
            for number, session in self._open.items():
                self._known[number] = progress_of(session)
        return [
            {
                "title": book.title,
                "address": f"maps/{number}/",
                "painted_before": (book.folder / "journal.jsonl").exists(),
                **self._known.get(number, {}),
            }
            for number, book in enumerate(self.books)
        ]

    def write_training(self) -> list[Path]:
        """One configuration that teaches a model the paint of all maps, and what it reads.

        Raises
        ------
        InputError
            Nothing is painted on any map, or too little.
        """
        sessions, names = [], []
        for number, book in enumerate(self.books):
            with self._lock:
                session = self._open.get(number)
                if session is None and not (book.folder / "journal.jsonl").exists():
                    continue
                shown = session or book.open()
                try:
                    if shown.painting.n_painted:
                        names += shown.painted_classes
                        sessions.append(shown)
                finally:
                    if session is None:
                        shown.close()
        if not sessions:
            raise InputError("nothing is painted on any of the maps yet")
        title = f"{len(sessions)} maps, painted in the studio"
        return write_training(sessions, self.folder, title, names)

    def close(self) -> None:
        """Let go of all maps."""
        self.end()
        with self._lock:
            for number in list(self._open):
                self._close(number)

    def end(self) -> None:
        """Nobody should wait for news any more."""
        self.closing = True
        for session in list(self._open.values()):
            session.closing = True

    def _close(self, number: int) -> None:
        session = self._open.pop(number)
        self._known[number] = progress_of(session)
        session.closing = True
        session.close()


def progress_of(session: MapSession) -> dict[str, Any]:
    """What has been done on a session, and what is in doubt."""
    taught, cell_m2 = session.taught, session.grid.resolution_m**2
    return {
        "painted_m2": session.painting.n_painted * cell_m2,
        "working": session.learner.state.working,
        "problem": session.learner.state.problem,
        "doubtful_m2": None if taught is None else sum(c.doubtful_m2 for c in taught.open_checks),
        "agrees": session.agrees,
    }
