"""An open map in the studio: its painting, its layers and its relabelling."""

import threading
from collections.abc import Callable, Mapping, Sequence
from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import MapFile
from pgm_places.io.places.place_ids_file import read_session, write_session
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelling.files import earlier_places
from pgm_places.labelling.model import LoadedModel
from pgm_places.options import check_option, from_mapping
from pgm_places.options.marks import Ge, Le
from pgm_places.studio import strokes
from pgm_places.studio.journal import SourceFile
from pgm_places.studio.layers import GivenLabels, Layers, building_bounds
from pgm_places.studio.paint_migration import opened_painting
from pgm_places.studio.painting import Classes
from pgm_places.studio.relabelling import (
    LabelChanges,
    Learner,
    Relabeller,
    Relabelling,
    RelabelRequest,
    renamed,
    share_that_agrees,
)
from pgm_places.studio.runs import Window, runs_of_mask, runs_over
from pgm_places.teaching.interactive_labeler import InteractiveResult
from pgm_places.teaching.paint import Paint
from pgm_places.topology.checks import SplitCandidate, split_candidates
from pgm_places.topology.cuts import (
    Limits,
    cut_along,
    cut_line,
    doorway_ends,
    place_along,
    runs_between,
)
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.rules import TopologyOptions

Coordinate = Annotated[float, Ge(-(10**9)), Le(10**9)]
Point = tuple[Coordinate, Coordinate]
"""x and y, in cells or in metres."""

NOTHING_PARTED = "This doorway parts nothing: there is a way around it. Draw it from wall to wall."

IDS_FILE = "place_ids.json"

CLASSES = ("corridor", "room", "doorway")
"""Initial classes of a painting without a model and without labels."""


class MapSession:
    """A map that is open in the studio; its methods may be called from any thread.

    The journal and, by default, the exports are in ``folder``. Errors refer to the first of the
    ``given`` labels; their names are offered as classes, after those of the labeler. The first
    ``n_fixed`` classes cannot be deleted. ``agrees`` is the share of the newest labels that agree
    with the labels to compare with. ``tick`` counts changes of the data that the browser shows.
    """

    def __init__(
        self,
        source: MapFile,
        folder: Path,
        loaded: LoadedModel | PlaceLabeler | None,
        *,
        model: str = "default",
        given: Sequence[GivenLabels] = (),
        drive_xy_m: NDArray[np.float64] | None = None,
        n_threads: int | None = None,
    ) -> None:
        self.loaded = None if loaded is None else LoadedModel.of(loaded)
        labeler = self.labeler = None if self.loaded is None else self.loaded.labeler
        own = () if labeler is None else tuple(labeler.label_names_)
        listed = [name for item in given for name in item.names] or list(own or CLASSES)
        names = tuple(dict.fromkeys([*own, *listed]))
        self.n_fixed = len(names) if given else len(own)
        self.source, self.folder, self.model = source, folder, model
        self.rules = TopologyOptions() if self.loaded is None else self.loaded.rules
        self.drive_xy_m, self.grid = drive_xy_m, source.grid
        self.files = [SourceFile(source.yaml_path), SourceFile(source.image_path)]
        self.tick, self.n_relabellings = 0, 0
        self.changes: LabelChanges | None = None
        self.agrees: float | None = None
        self.relabelling: Relabelling | None = None
        self.closing, self.box = False, building_bounds(source.grid)
        self._remark = ""
        self._lock = threading.RLock()
        self.painting, self.migration = opened_painting(
            folder, self.grid, Classes.named(names), self.files[1].sha256
        )
        self.ids, self.ids_notice = self._earlier_ids()
        self._edit_undo, self._edit_redo = self.painting.undo, self.painting.redo
        self._edit_version, self._edit_restore = self.painting.save_version, self.painting.restore
        self._edit_learn = self.painting.set_learning
        self.layers = Layers(
            self.grid, self.painting.labels, {item.title: item.on(names) for item in given}
        )
        relabeller = Relabeller(
            self.grid, self.loaded, ids=self.ids, n_threads=n_threads, glanced=self._glanced
        )
        self.learner: Learner[RelabelRequest, Relabelling] = Learner(
            relabeller.answer, self._learned, self.moved
        )

    def _earlier_ids(self) -> tuple[PlaceIds, str]:
        """The ids of earlier sessions, and a warning if they do not fit the map."""
        path = self.folder / IDS_FILE
        ids = read_session(path) if path.exists() else earlier_places(self.folder) or PlaceIds()
        return ids, ids.fit_to(self.grid)

    def take(self, paint: Paint) -> int:
        """Paint the labels of a file on unpainted cells; the number of cells painted."""
        with self._lock:
            before = self.painting.n_painted
            for k, name in enumerate(paint.classes):
                fresh = (paint.labels == k) & (self.painting.labels < 0)
                if fresh.any():
                    self._paint_class(name, runs_of_mask(fresh))
            return self.painting.n_painted - before

    def _paint_class(self, name: str, runs: NDArray[np.int64]) -> None:
        classes = self.painting.classes
        if name not in classes.names:
            self.painting.set_class(len(classes), name, classes.next_colour)
        part = self.painting.paint_runs(runs, self.painting.classes.names.index(name))
        if part is not None:
            self.layers.painted(part)

    def start(self) -> None:
        """Start the learner with a request for the labels of the present painting."""
        self.learner.start()
        self._ask()

    def close(self) -> None:
        """End the learner and close the journal."""
        self.learner.end()
        self.painting.journal.close()

    def moved(self) -> None:
        """Count a change of the data that the browser shows."""
        self.tick += 1

    @property
    def painted_classes(self) -> list[str]:
        """The names of the classes that are painted somewhere."""
        paint = Paint(self.painting.labels, self.painting.classes.names)
        return [name for name, n in paint.counts.items() if n]

    @property
    def taught(self) -> InteractiveResult | None:
        """The newest result, with the user's names of places; None before the first."""
        with self._lock:
            if self.relabelling is None:
                return None
            return renamed(self.relabelling.taught, self.painting.names)

    # ------------------------------------------------------------------ edits

    def edit(self, request: Mapping[str, object]) -> str:
        """Carry out an edit of the browser; return a message, or an empty text."""
        values = dict(request)
        kind = str(values.pop("kind", None))
        edit = getattr(self, f"_edit_{kind}", None)
        if edit is None:
            raise InputError(f"unknown edit {kind[:40]!r}")
        with self._lock:
            painting, before = self.painting, self.painting.classes.names
            learned, cuts = self.learns, painting.cuts
            self._remark = ""
            part = edit(**_arguments(kind, edit, values))
            if part is not None:
                self.layers.painted(part)
            self._renumber(before, self.painting.classes.names)
            self.moved()
            now = painting.classes.names, self.learns, painting.cuts
            if part is not None or (before, learned, cuts) != now:
                self._ask()
            return self._remark

    def _renumber(self, before: tuple[str, ...], after: tuple[str, ...]) -> None:
        """Renumber the classes of the newest result as in the present painting."""
        if self.relabelling is None or len(before) == len(after) or before == after[: len(before)]:
            return
        table = [after.index(name) if name in after else -1 for name in before]
        self.relabelling = self.relabelling.renumbered(np.array([*table, -1], np.int16))
        self.layers.renumbered(np.array([*table, -1], np.int16), self.relabelling)

    @property
    def _shown_labels(self) -> NDArray[np.int16]:
        """(H, W) displayed labels: the paint, and the newest labels elsewhere."""
        paint, found = self.painting.labels, self.relabelling
        return paint if found is None else np.where(paint >= 0, paint, found.labels)

    def door_line(self, points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """The ends, x and y in cells, of a doorway drawn along two points."""
        with self._lock:
            ends = doorway_ends(points, self.grid, self._limits)
        return [(float(column) + 0.5, float(row) + 0.5) for row, column in ends]

    @property
    def _limits(self) -> Limits:
        names, door = self.painting.classes.names, self.rules.doorway_label
        topology = None if self.relabelling is None else self.relabelling.taught.topology
        doorway = names.index(door) if door in names else None
        return Limits(self.painting.labels, doorway, topology)

    def _edit_stroke(
        self, label: int, stroke: Mapping[str, object], over: int | None = None
    ) -> Window | None:
        drawn = from_mapping(strokes.Stroke, stroke, path="stroke")
        limits = self._limits if drawn.tool == "doorway" else None
        runs = strokes.stroke_cells(drawn, self.grid, limits)
        if over is not None:
            runs = runs_over(runs, self._shown_labels, over)
        if not runs.size:
            raise InputError(
                "nothing of that kind lies there" if over is not None else "no free cell lies there"
            )
        if limits is not None and label >= 0 and not strokes.parts(runs, self.grid, limits):
            self._remark = NOTHING_PARTED
        return self.painting.paint_runs(runs, label)

    def _edit_fill(self, label: int, point: Point) -> Window | None:
        limits = self._limits
        doors, doorway, drawn = limits.doorway, None, None
        if doors is not None and label != doors:
            doorway = self._shown_labels == doors
            drawn = limits.paint == doors if label >= 0 else None  # the eraser removes them
        runs = strokes.fill_cells(self.grid, limits.paint, limits.topology, point, doorway, drawn)
        return self.painting.paint_runs(runs, label)

    def _edit_cut(self, start: Point, end: Point) -> None:
        topology = self.answer.topology
        line = cut_line((start, end), self.grid, self._limits)
        place = place_along(topology, line)
        if place is None or len(cut_along(topology, place, [line])) < 2:
            raise InputError(
                "this cut divides nothing: there is a way around it; draw it from wall to wall"
            )
        self.painting.set_cuts((*self.painting.cuts, line))

    def _edit_merge(self, first: int, second: int) -> Window | None:
        topology, cuts = self.answer.topology, self.painting.cuts
        runs, name = strokes.merge_cells(topology, first, second)
        left = tuple(line for line in cuts if not runs_between(topology, line, first, second))
        self.painting.set_cuts(left)
        if left != cuts and topology.place(first).label == topology.place(second).label:
            return None
        return self.painting.paint_runs(runs, self.painting.classes.names.index(name))

    def _edit_split(self, region: int) -> Window | None:
        rooms = self._rooms_in(region)
        if rooms is None:
            raise InputError("this place looks like one; draw a doorway to split it")
        name = self.rules.doorway_label
        if name not in self.painting.classes.names:
            raise InputError(
                f"no class is called {name!r}; add it, as places are split by doorways"
            )
        runs = strokes.doorways_along(rooms.lines_m, self.grid, self._limits)
        return self.painting.paint_runs(runs, self.painting.classes.names.index(name))

    def n_parts(self, region: int) -> int:
        """The number of rooms that a place looks like."""
        rooms = self._rooms_in(region)
        return 1 if rooms is None else rooms.count

    def _rooms_in(self, region: int) -> SplitCandidate | None:
        """The split candidate of a place, as in the table of checks."""
        relabelling = self.relabelling
        candidates = () if relabelling is None else split_candidates(relabelling.taught.topology)
        return next((rooms for rooms in candidates if rooms.place.id == region), None)

    def _edit_rename(self, point_m: Point, name: str) -> None:
        topology = self.answer.topology
        region = topology.region_at(*point_m)
        if region is None:
            raise InputError("there is no place")
        if name in [other.name for other in topology.regions if other.id != region.id]:
            raise InputError(f"another place is called {name!r}; choose another name")
        same = [list(at) for at in self.painting.names if topology.region_at(*at) == region]
        self.painting.rename(point_m, name, same)

    def _edit_class(self, index: int, name: str, colour: str) -> None:
        own = () if self.labeler is None else self.labeler.label_names_
        names = self.painting.classes.names
        if index < len(own) and names[index] != name:
            raise InputError(f"this class of the model is named {names[index]!r}; add a new class")
        self.painting.set_class(index, name, colour)

    def _edit_drop(self, index: int) -> Window | None:
        if index < self.n_fixed:
            name = self.painting.classes.names[max(0, index)]
            raise InputError(f"{name!r} belongs to the model or to the labels to compare with")
        return self.painting.drop_class(index)

    @property
    def learns(self) -> bool:
        """Whether the labeler learns the paint, and does not only use it as observed labels."""
        return self.labeler is None or self.painting.learns

    @property
    def answer(self) -> InteractiveResult:
        """The newest result."""
        if (taught := self.taught) is None:
            raise InputError("there are no labels yet; wait until the map has been labelled")
        return taught

    # ------------------------------------------------------------------ learning

    @property
    def question(self) -> RelabelRequest:
        """The request for labels of the present painting."""
        with self._lock:
            paint = Paint(self.painting.labels.copy(), self.painting.classes.names)
            own = paint.classes if self.labeler is None else self.labeler.label_names_
            new = any(n for name, n in paint.counts.items() if name not in own)
            learns = self.learns or new  # a new class must be learned before it can be a label
            return RelabelRequest(paint, self.painting.revision, learns, self.painting.cuts)

    def _ask(self) -> None:
        """Request labels of the present painting."""
        question = self.question
        if self.labeler is not None or sum(n > 0 for n in question.paint.counts.values()) >= 2:
            self.learner.ask(question)

    def _glanced(self, labels: NDArray[np.int16]) -> None:
        """Show quick labels until the first result."""
        self.layers.glanced(labels)
        self.moved()

    def _learned(self, relabelling: Relabelling) -> None:
        before, truth = self.relabelling, self.layers.truth
        changes = None
        if before is not None:
            changes = LabelChanges.between(
                before.labels,
                relabelling.labels,
                relabelling.taught.paint.labels,
                self.grid.resolution_m,
            )
        agrees = None if truth is None else share_that_agrees(relabelling.labels, truth)
        # On the disk before they are shown, as edits are.
        if before is None or before.taught.topology.regions != relabelling.taught.topology.regions:
            write_session(self.folder / IDS_FILE, self.ids)
        with self._lock:
            self.relabelling, self.changes, self.agrees = relabelling, changes, agrees
            self.n_relabellings += 1
            self.layers.learned(relabelling, changes)
        self.moved()


def _arguments(
    kind: str, edit: Callable[..., Window | None], values: Mapping[str, Any]
) -> dict[str, Any]:
    """The arguments of an edit, converted to the types of its parameters."""
    parameters = signature(edit).parameters
    wanted = {name for name, item in parameters.items() if item.default is item.empty}
    if not wanted <= values.keys() <= parameters.keys():
        raise InputError(f"{kind!r} takes {', '.join(parameters) or 'nothing'}")
    hints = {name: item.annotation for name, item in parameters.items()}
    return {name: check_option(name, hints[name], value) for name, value in values.items()}
