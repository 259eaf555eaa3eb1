"""The painting: all that a person has said about a map, with a way back to every earlier state."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import plain_names
from pgm_places.errors import InputError, printable
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.studio.classes import Classes, PlaceClass
from pgm_places.studio.journal import Journal
from pgm_places.studio.runs import cells_of_runs, runs_of_cells

__all__ = ["PaintedPart", "Painting", "Version"]

Entry = dict[str, Any]


@dataclass(frozen=True)
class PaintedPart:
    """The rows and columns that an edit painted."""

    rows: slice
    columns: slice


@dataclass(frozen=True)
class Version:
    """A state that was given a name.

    Parameters
    ----------
    revision : int
        The number of entries of the journal up to it.
    name : str
    saved_at : float
        Seconds since 1970.
    """

    revision: int
    name: str
    saved_at: float


@dataclass(frozen=True, eq=False)
class _Change:
    """What an edit replaced, so that it can be taken back."""

    cells: NDArray[np.int64] | None = None
    before: NDArray[np.int16] | None = None
    after: int | NDArray[np.int16] = -1
    classes: tuple[Classes, Classes] | None = None
    names: tuple[dict[tuple[float, float], str], dict[tuple[float, float], str]] | None = None


class Painting:
    """Painted cells, classes and names of places, kept by a journal.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    classes : Classes
        Those to begin with.
    journal : Journal
        Its entries are rewritten; every edit is appended to it before it takes effect.

    Attributes
    ----------
    labels : (H, W) int16
        Index of the painted class of each cell, -1 for none. Written to in place.
    names : dict of (float, float) to str
        Names of places by a point in metres: whichever place holds the point has the name,
        however the places around it change.
    revision : int
        The number of entries of the journal.
    versions : list of Version
    """

    def __init__(self, grid: OccupancyGrid, classes: Classes, journal: Journal) -> None:
        self.grid, self.classes, self.journal = grid, classes, journal
        self._first = classes
        self.labels = np.full(grid.shape, -1, np.int16)
        self.names: dict[tuple[float, float], str] = {}
        self.versions: list[Version] = []
        self.revision = 0
        self._done: list[_Change] = []
        self._undone: list[_Change] = []
        self._entries: list[Entry] = []
        for entry in journal.entries:
            try:
                self._follow(entry)
            except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
                at = self.revision + 2  # the header is the first line
                reason = printable(str(error))[:300]
                raise InputError(f"{journal.path}: line {at} is damaged ({reason})") from None

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to take back."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether an edit was taken back that can be made again."""
        return bool(self._undone)

    @property
    def n_painted(self) -> int:
        """Number of painted cells."""
        return int(np.count_nonzero(self.labels >= 0))

    def paint(self, cells: NDArray[np.int64], label: int) -> PaintedPart | None:
        """Paint cells, given by flat indices; -1 erases. None where nothing changes."""
        if not -1 <= label < len(self.classes):
            raise InputError(f"there is no class {label}; there are {len(self.classes)}")
        cells = np.unique(cells)
        cells = cells[self.labels.reshape(-1)[cells] != label]
        if not cells.size:
            return None
        runs = runs_of_cells(cells, self.grid.shape[1])
        return self._add({"op": "paint", "label": label, "runs": runs.ravel().tolist()})

    def set_class(self, index: int, name: str, colour: str) -> None:
        """Change a class, or add one where the index is the number of classes."""
        self.classes.with_class(index, PlaceClass(name, colour))  # refuses what is wrong
        self._add({"op": "class", "index": index, "name": name, "colour": colour})

    def rename(self, point_m: tuple[float, float], name: str, replaces: list[Any]) -> None:
        """Name the place at a point; empty for none. ``replaces``: points of its earlier names."""
        if name:
            plain_names("the name of a place", [name], InputError)
        taken = [other for at, other in self.names.items() if list(at) not in replaces]
        if name in taken:
            raise InputError(f"another place is called {name!r}; choose another name")
        self._add({"op": "name", "at": list(point_m), "name": name, "replaces": replaces})

    def undo(self) -> PaintedPart | None:
        """Take the last edit back."""
        if not self.can_undo:
            raise InputError("there is nothing to undo")
        return self._add({"op": "undo"})

    def redo(self) -> PaintedPart | None:
        """Make the edit again that was last taken back."""
        if not self.can_redo:
            raise InputError("there is nothing to redo")
        return self._add({"op": "redo"})

    def save_version(self, name: str) -> None:
        """Give the present state a name."""
        plain_names("the name of a version", [name], InputError)
        self._add({"op": "version", "name": name, "at": round(time.time(), 3)})

    def restore(self, revision: int) -> PaintedPart | None:
        """Go back to a version; that is an edit, too, and can be undone."""
        if revision not in [version.revision for version in self.versions]:
            raise InputError(f"there is no version {revision}")
        return self._add({"op": "restore", "revision": revision})

    # ------------------------------------------------------------------ entries

    def _add(self, entry: Entry) -> PaintedPart | None:
        self.journal.append(entry)
        return self._follow(entry)

    def _follow(self, entry: Entry) -> PaintedPart | None:
        """Carry out an entry of the journal."""
        part = None
        if entry["op"] == "undo":
            part = self._apply(self._done, self._undone, forward=False)
        elif entry["op"] == "redo":
            part = self._apply(self._undone, self._done, forward=True)
        elif entry["op"] == "version":
            version = Version(self.revision + 1, str(entry["name"]), float(entry["at"]))
            self.versions.append(version)
        else:
            self._undone.clear()
            self._undone.append(self._change(entry))
            part = self._apply(self._undone, self._done, forward=True)
        self._entries.append(entry)
        self.revision += 1
        return part

    def _change(self, entry: Entry) -> _Change:
        """What an entry changes in the present state."""
        kind = entry["op"]
        if kind == "paint":
            cells = cells_of_runs(np.array(entry["runs"], np.int64), self.grid.shape)
            if not -1 <= entry["label"] < len(self.classes):
                raise InputError(f"no class {entry['label']}")
            return _Change(cells, self.labels.reshape(-1)[cells], int(entry["label"]))
        if kind == "class":
            made = PlaceClass(entry["name"], entry["colour"])
            changed = self.classes.with_class(entry["index"], made)
            return _Change(classes=(self.classes, changed))
        if kind == "name":
            replaced = {tuple(at) for at in entry["replaces"]}
            names = {at: name for at, name in self.names.items() if at not in replaced}
            x, y = entry["at"]
            if entry["name"]:
                names[float(x), float(y)] = str(entry["name"])
            return _Change(names=(self.names, names))
        if kind == "restore":
            return self._way_back(int(entry["revision"]))
        raise InputError(f"unknown edit {kind!r}")

    def _way_back(self, revision: int) -> _Change:
        """What leads from the present state to the one after the first entries of the journal."""
        then = Painting.__new__(Painting)
        then.grid, then.classes = self.grid, self._first
        then._first = self._first
        then.labels = np.full(self.grid.shape, -1, np.int16)
        then.names, then.versions, then.revision = {}, [], 0
        then._done, then._undone, then._entries = [], [], []
        for entry in self._entries[:revision]:
            then._follow(entry)
        cells = np.flatnonzero(then.labels != self.labels)
        return _Change(
            cells,
            self.labels.reshape(-1)[cells],
            then.labels.reshape(-1)[cells],
            (self.classes, then.classes),
            (self.names, then.names),
        )

    def _apply(
        self, source: list[_Change], target: list[_Change], *, forward: bool
    ) -> PaintedPart | None:
        change = source.pop()
        target.append(change)
        if change.classes is not None:
            self.classes = change.classes[forward]
        if change.names is not None:
            self.names = change.names[forward]
        if change.cells is None or not change.cells.size:
            return None
        after: Any = change.after if forward else change.before
        self.labels.reshape(-1)[change.cells] = after
        rows, columns = np.divmod(change.cells, self.grid.shape[1])
        return PaintedPart(
            slice(int(rows.min()), int(rows.max()) + 1),
            slice(int(columns.min()), int(columns.max()) + 1),
        )


def journal_for(folder: Path, map_sha256: str) -> Journal:
    """The journal of a map's painting in a folder."""
    return Journal(folder / "journal.jsonl", {"map": map_sha256})
