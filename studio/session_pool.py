"""Pool of the maps of one studio, of which a few sessions are open at a time."""

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
"""Most maps in memory with their cell tables, apart from maps with a tab."""

LIVE_S = 25.0
"""Seconds after its last poll until a tab counts as closed."""


@dataclass(frozen=True)
class MapEntry:
    """A map that may be opened, and the folder of its painting."""

    title: str
    folder: Path
    open: Callable[[], MapSession]


class Tabs:
    """The tabs of a browser that show one map; all methods may be called from any thread."""

    def __init__(self) -> None:
        self._polled_s: dict[str, float] = {}

    def polled(self, tab: str) -> None:
        """Note that a tab has polled."""
        if tab.isalnum() and len(tab) <= 40:
            self._polled_s[tab] = time.monotonic()

    def left(self, tab: str) -> None:
        """Note that a tab was closed."""
        self._polled_s.pop(tab, None)

    def __len__(self) -> int:
        oldest = time.monotonic() - LIVE_S
        for tab in [tab for tab, when_s in list(self._polled_s.items()) if when_s < oldest]:
            self.left(tab)
        return len(self._polled_s)


class SessionPool:
    """The maps of a studio and their open sessions; methods may be called from any thread.

    A request and its body must arrive within ``request_s``; one for news waits ``news_s``.
    """

    request_s = 10.0
    news_s = LIVE_S - 5

    def __init__(
        self, books: Sequence[MapEntry], folder: Path, export_folders: ExportFolders | None = None
    ) -> None:
        self.books, self.folder, self.closing = tuple(books), folder, False
        self.export_folders = export_folders or ExportFolders.started_here()
        self._open: dict[int, MapSession] = {}  # the most recently used is last
        self._known: dict[int, dict[str, Any]] = {}
        self.tabs = tuple(Tabs() for _ in self.books)
        self._lock = threading.Lock()

    @classmethod
    def of(cls, session: MapSession, export_folders: ExportFolders | None = None) -> Self:
        """The pool of one map."""
        book = MapEntry(session.source.name, session.folder, lambda: session)
        pool = cls([book], session.folder, export_folders)
        pool._open[0] = session
        return pool

    def start(self) -> None:
        """Start to label the maps that are open."""
        for session in self._open.values():
            session.start()

    def __len__(self) -> int:
        return len(self.books)

    def session(self, number: int) -> MapSession:
        """The session of a map, opened if necessary.

        If too many maps are open, the least recently used map without a live tab is closed. Maps
        with a tab stay open, because their tabs would reopen them at once.
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
        """The progress on each map, as plain data."""
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
        """Write one configuration that trains a model on the paint of all maps, and its inputs."""
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
        """Close all sessions."""
        self.end()
        with self._lock:
            for number in list(self._open):
                self._close(number)

    def end(self) -> None:
        """Make all requests for news return."""
        self.closing = True
        for session in list(self._open.values()):
            session.closing = True

    def _close(self, number: int) -> None:
        session = self._open.pop(number)
        self._known[number] = progress_of(session)
        session.closing = True
        session.close()


def progress_of(session: MapSession) -> dict[str, Any]:
    """The progress of a session: painted cells, and uncertain area."""
    taught, cell_m2 = session.taught, session.grid.resolution_m**2
    return {
        "painted_m2": session.painting.n_painted * cell_m2,
        "working": session.learner.state.working,
        "problem": session.learner.state.problem,
        "doubtful_m2": None if taught is None else sum(c.doubtful_m2 for c in taught.open_checks),
        "agrees": session.agrees,
    }
