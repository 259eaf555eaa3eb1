"""The painting: paint, classes, names and teaching of one map, with undo and saved versions."""

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import plain_names
from pgm_places.errors import InputError, LabelError, escape_control, quoted
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.options import check_option
from pgm_places.palette import label_colours
from pgm_places.studio.journal import Journal
from pgm_places.studio.runs import Repaint, Window, checked_runs
from pgm_places.topology.cuts import Line

MOST_CLASSES = 100
_COLOUR = re.compile("#[0-9a-f]{6}")


@dataclass(frozen=True)
class PlaceClass:
    """A class of places: a name that file names allow, and a colour ``#rrggbb`` in lower case."""

    name: str
    colour: str

    def __post_init__(self) -> None:
        plain_names("the name of a class", [self.name], LabelError)
        if "/" in self.name or "\\" in self.name or self.name.startswith("."):
            raise LabelError(f"label {self.name!r} cannot be part of a file name; choose another")
        if not isinstance(self.colour, str) or not _COLOUR.fullmatch(self.colour):
            raise InputError(f"a colour is written #rrggbb, got {quoted(self.colour)}")


@dataclass(frozen=True)
class Classes:
    """The classes in order; index ``k`` is label ``k``.

    Examples
    --------
    >>> classes = Classes.named(["corridor", "room"])
    >>> classes.with_class(2, PlaceClass("lab", "#6d6108")).names
    ('corridor', 'room', 'lab')
    """

    items: tuple[PlaceClass, ...]

    @classmethod
    def named(cls, names: Sequence[str]) -> Self:
        """Classes in the colours of the package's pictures."""
        return cls(tuple(map(PlaceClass, names, label_colours(names))))

    def __len__(self) -> int:
        return len(self.items)

    @property
    def names(self) -> tuple[str, ...]:
        """Their names, in order."""
        return tuple(item.name for item in self.items)

    @property
    def next_colour(self) -> str:
        """A colour for one more class, different from the others until the palette runs out."""
        used = {item.colour for item in self.items}
        offered = label_colours([*self.names, *(f"\0{k}" for k in range(MOST_CLASSES))])
        return next((colour for colour in offered if colour not in used), offered[-1])

    def without(self, index: int) -> Self:
        """The classes without one; later classes move up."""
        if not 0 <= index < len(self):
            raise InputError(f"there is no class {index}; there are {len(self)}")
        if len(self) < 3:
            raise InputError("two classes must be left, or there is nothing to tell apart")
        return type(self)((*self.items[:index], *self.items[index + 1 :]))

    def with_class(self, index: int, item: PlaceClass) -> Self:
        """The classes with one replaced, or with another one appended."""
        if not 0 <= index <= len(self):
            raise InputError(f"there is no class {index}; there are {len(self)}")
        if index >= MOST_CLASSES:
            raise InputError(f"there are at most {MOST_CLASSES} classes")
        items = (*self.items[:index], item, *self.items[index + 1 :])
        plain_names("names of classes", [each.name for each in items], LabelError)
        return type(self)(items)


Entry = dict[str, Any]
Names = dict[tuple[float, float], str]
Cuts = tuple[Line, ...]
MOST_CUTS = 10_000


@dataclass(frozen=True)
class Version:
    """A named state after ``revision`` entries of the journal, saved at a time (s since 1970)."""

    revision: int
    name: str
    saved_at: float


class _State(NamedTuple):
    """What a painting has besides its cells."""

    classes: Classes
    names: Names
    cuts: Cuts
    learns: bool


class _Change(NamedTuple):
    """The effect of an edit: changed cells, and the state before and after it."""

    repaint: Repaint
    before: _State
    after: _State


class _Step(NamedTuple):
    """A change that was made, or undone."""

    change: _Change
    forward: bool


class Painting:
    """Painted cells, classes, names of places, and whether the model learns, saved in a journal.

    The journal's entries are rewritten; every edit is appended before it takes effect. ``labels``
    (H, W) are indices of classes, -1 for none, and written to in place. ``names`` are by a point in
    metres: the place that contains the point has the name, even after places have changed. ``cuts``
    are lines in metres that divide places without a doorway.
    """

    def __init__(self, grid: OccupancyGrid, classes: Classes, journal: Journal) -> None:
        self.grid, self.classes, self.journal = grid, classes, journal
        self.labels = np.full(grid.shape, -1, np.int16)
        self.names: Names = {}
        self.cuts: Cuts = ()
        self.learns = False
        self.versions: list[Version] = []
        self._done: list[_Change] = []
        self._undone: list[_Change] = []
        self._steps: list[_Step | None] = []  # the effect of each entry; None for a version
        for entry in journal.entries:
            try:
                self._follow(entry)
            except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
                at = self.revision + 2  # the header is the first line
                reason = escape_control(str(error))[:300]
                raise InputError(f"{journal.path}: line {at} is damaged ({reason})") from None

    @property
    def revision(self) -> int:
        """The number of entries of the journal."""
        return len(self._steps)

    @property
    def can_undo(self) -> bool:
        """Whether an edit can be undone."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether an edit can be redone."""
        return bool(self._undone)

    @property
    def n_painted(self) -> int:
        """Number of painted cells."""
        return int(np.count_nonzero(self.labels >= 0))

    def paint_runs(self, runs: NDArray[np.int64], label: int) -> Window | None:
        """Paint runs (n, 3): row, first column, length; -1 erases. None where nothing changes."""
        if not -1 <= label < len(self.classes):
            raise InputError(f"there is no class {label}; there are {len(self.classes)}")
        if not Repaint.of_runs(self.labels, runs, label):
            return None
        return self._add({"op": "paint", "label": label, "runs": runs.ravel().tolist()})

    def set_class(self, index: int, name: str, colour: str) -> None:
        """Change a class, or add one where the index is the number of classes."""
        self.classes.with_class(index, PlaceClass(name, colour))  # raises if invalid
        self._add({"op": "class", "index": index, "name": name, "colour": colour})

    def drop_class(self, index: int) -> Window | None:
        """Delete a class and its paint; later classes move up."""
        self.classes.without(index)  # raises if invalid
        return self._add({"op": "drop", "index": index})

    def rename(self, point_m: tuple[float, float], name: str, replaces: list[Any]) -> None:
        """Name the place at a point; empty for none. ``replaces``: points of its earlier names."""
        if name:
            plain_names("the name of a place", [name], InputError)
        taken = [other for at, other in self.names.items() if list(at) not in replaces]
        if name in taken:
            raise InputError(f"another place is called {name!r}; choose another name")
        self._add({"op": "name", "at": list(point_m), "name": name, "replaces": replaces})

    def set_cuts(self, cuts: Cuts) -> None:
        """Divide places along these lines only, in place of earlier lines."""
        if len(cuts) > MOST_CUTS:
            raise InputError(f"there are at most {MOST_CUTS} cuts")
        if cuts != self.cuts:
            self._add({"op": "cuts", "lines_m": [[list(end) for end in line] for line in cuts]})

    def set_learning(self, on: bool) -> None:
        """Switch learning from the paint on or off."""
        if on != self.learns:
            self._add({"op": "learn", "on": on})

    def undo(self) -> Window | None:
        """Undo the last edit."""
        if not self.can_undo:
            raise InputError("there is nothing to undo")
        return self._add({"op": "undo"})

    def redo(self) -> Window | None:
        """Redo the edit that was undone last."""
        if not self.can_redo:
            raise InputError("there is nothing to redo")
        return self._add({"op": "redo"})

    def save_version(self, name: str) -> None:
        """Save the present state under a name."""
        plain_names("the name of a version", [name], InputError)
        self._add({"op": "version", "name": name, "at": round(time.time(), 3)})

    def restore(self, revision: int) -> Window | None:
        """Restore a version, as an edit that can be undone."""
        if revision not in [version.revision for version in self.versions]:
            raise InputError(f"there is no version {revision}")
        return self._add({"op": "restore", "revision": revision})

    # ------------------------------------------------------------------ entries

    def _add(self, entry: Entry) -> Window | None:
        self.journal.append(entry)
        return self._follow(entry)

    def _follow(self, entry: Entry) -> Window | None:
        """Carry out an entry of the journal."""
        if entry["op"] == "version":
            version = Version(self.revision + 1, str(entry["name"]), float(entry["at"]))
            self.versions.append(version)
            self._steps.append(None)
            return None
        step = self._step(entry)
        self._steps.append(step)
        return self._take(step)

    def _step(self, entry: Entry) -> _Step:
        """The effect of an entry on the present state."""
        if entry["op"] == "undo":
            self._undone.append(self._done.pop())
            return _Step(self._undone[-1], forward=False)
        if entry["op"] == "redo":
            self._done.append(self._undone.pop())
        else:
            self._done.append(self._change(entry))
            self._undone.clear()
        return _Step(self._done[-1], forward=True)

    def _change(self, entry: Entry) -> _Change:
        """The change of the present state by an entry."""
        kind, repaint, state = entry["op"], Repaint.nothing(), self._state
        if kind == "paint":
            repaint = self._painted(entry["runs"], entry["label"])
        elif kind == "class":
            made = PlaceClass(entry["name"], entry["colour"])
            state = state._replace(classes=self.classes.with_class(entry["index"], made))
        elif kind == "drop":
            index = int(entry["index"])
            left = np.arange(len(self.classes) + 1, dtype=np.int16)
            left[index:] -= 1
            left[[index, -1]] = -1  # the last entry serves -1
            state = state._replace(classes=self.classes.without(index))
            repaint = Repaint.between(self.labels, left[self.labels])
        elif kind == "name":
            replaced = {tuple(at) for at in entry["replaces"]}
            names = {at: name for at, name in self.names.items() if at not in replaced}
            x, y = entry["at"]
            if entry["name"]:
                names[float(x), float(y)] = str(entry["name"])
            state = state._replace(names=names)
        elif kind == "cuts":
            state = state._replace(cuts=check_option("lines_m", Cuts, entry["lines_m"]))
        elif kind == "restore":
            repaint, state = self._way_back(int(entry["revision"]))
        elif kind == "learn":
            state = state._replace(learns=check_option("on", bool, entry["on"]))
        else:
            raise InputError(f"unknown edit {kind!r}")
        return _Change(repaint, self._state, state)

    @property
    def _state(self) -> _State:
        return _State(self.classes, self.names, self.cuts, self.learns)

    def _painted(self, listed: list[int], label: int) -> Repaint:
        runs = checked_runs(np.array(listed, np.int64), self.grid.shape)
        if not -1 <= label < len(self.classes):
            raise InputError(f"no class {label}")
        return Repaint.of_runs(self.labels, runs, int(label))

    def _way_back(self, revision: int) -> tuple[Repaint, _State]:
        """The change back from the present state to that after the first entries."""
        if not 0 <= revision <= self.revision:
            raise InputError(f"no revision {revision}")
        labels, state = self.labels.copy(), self._state
        for step in reversed(self._steps[revision:]):
            if step is not None:
                change, forward = step
                change.repaint.put(labels, forward=not forward)
                state = change.before if forward else change.after
        return Repaint.between(self.labels, labels), state

    def _take(self, step: _Step) -> Window | None:
        change, forward = step
        self.classes, self.names, self.cuts, self.learns = (
            change.after if forward else change.before
        )
        change.repaint.put(self.labels, forward=forward)
        return change.repaint.part
