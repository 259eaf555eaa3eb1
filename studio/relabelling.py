"""Relabelling a map after each stroke, in the background."""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import PgmPlacesError
from pgm_places.graph.bands import bands_of_rows
from pgm_places.inference.labeling import normalized_entropy
from pgm_places.kernels.threads import thread_limit
from pgm_places.labelers.labelled_places import LabelledPlaces, window_to_label
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelling.model import LoadedModel
from pgm_places.maps.coarsening import Coarsening
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.progress import Progress
from pgm_places.teaching.interactive_labeler import InteractiveLabeler, InteractiveResult
from pgm_places.teaching.paint import Paint
from pgm_places.topology.cuts import Line
from pgm_places.topology.place_ids import PlaceIds, name_places

Question = TypeVar("Question")
Answer = TypeVar("Answer")


class _Superseded(Exception):  # noqa: N818  nothing went wrong
    """A newer request has replaced the current one."""


@dataclass(frozen=True)
class LearnerState:
    """The current stage, its done share from 0 to 1, the number of stages, and the last problem."""

    working: bool = False
    stage: str = ""
    fraction: float = 0.0
    stages: int = 0
    problem: str = ""


class _Reported:
    """Progress that is shown in the browser, and that ends the work once a newer request comes."""

    def __init__(
        self, superseded: Callable[[], bool], show: Callable[[LearnerState], None]
    ) -> None:
        self._superseded, self._show = superseded, show
        self._name, self._n_stages = "", 0

    @contextmanager
    def stage(self, name: str) -> "Iterator[_Reported]":
        self._name = name
        self._n_stages += 1
        self.update(0.0)
        yield self

    def update(self, fraction: float, note: str = "") -> None:  # noqa: ARG002  the protocol's
        if self._superseded():
            raise _Superseded
        self._show(LearnerState(True, self._name, fraction, self._n_stages))

    def warn(self, message: str) -> None:
        """Ignored: warnings are part of the answer."""


class Learner(Generic[Question, Answer]):
    """Answers requests one at a time in the background; a newer request replaces older ones.

    ``done`` receives answers in the learner's thread; ``changed`` is called when the state changes.
    """

    def __init__(
        self,
        work: Callable[[Question, _Reported], Answer],
        done: Callable[[Answer], None],
        changed: Callable[[], None],
    ) -> None:
        self._work, self._done, self._changed = work, done, changed
        self._wake = threading.Condition()
        self._waiting: list[Question] = []
        self._ended = False
        self.state = LearnerState()
        self._thread = threading.Thread(target=self._run, name="learner", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def ask(self, question: Question) -> None:
        """Submit a request, which replaces all earlier ones."""
        with self._wake:
            self._waiting = [question]
            self._wake.notify_all()

    def end(self) -> None:
        """End the thread."""
        with self._wake:
            self._ended = True
            self._waiting = []
            self._wake.notify_all()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)  # a daemon: a long stage does not keep the process

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._ended)
                if self._ended:
                    return
                question = self._waiting.pop()
            self._show(LearnerState(working=True))
            self._show(LearnerState(problem=self._answer(question)))

    def _answer(self, question: Question) -> str:
        """Answer a request; return the problem, or an empty text."""
        reported = _Reported(lambda: bool(self._waiting) or self._ended, self._show)
        try:
            self._done(self._work(question, reported))
        except _Superseded:
            pass
        except (PgmPlacesError, MemoryError) as error:
            return str(error) or "out of memory"
        except Exception as error:  # noqa: BLE001  the thread must live on, and say what happened
            return f"internal error: {error}; the paint is saved"
        return ""

    def _show(self, state: LearnerState) -> None:
        if state != self.state:
            self.state = state
            self._changed()


@dataclass(frozen=True, eq=False)
class RelabelRequest:
    """A request to label a map, and to learn its paint or only use it as observed labels."""

    paint: Paint
    revision: int
    learns: bool
    cuts: tuple[Line, ...] = ()


@dataclass(frozen=True, eq=False)
class Relabelling:
    """The result of a request: labels (H, W) after and before the graph, as the painting's classes.

    ``class_of`` (K,) is the painting's class of each label of the labeler.
    """

    taught: InteractiveResult
    revision: int
    learns: bool
    labels: NDArray[np.int16]
    unary_labels: NDArray[np.int16]
    class_of: NDArray[np.int16]

    @property
    def methods(self) -> tuple[str, ...]:
        """The labeler's other methods."""
        return tuple(self.taught.by_method)

    def renumbered(self, table: NDArray[np.int16]) -> Self:
        """The result with renumbered classes: ``table`` has the new numbers, and -1 at its end."""
        return replace(
            self,
            labels=table[self.labels],
            unary_labels=table[self.unary_labels],
            class_of=table[self.class_of],
        )

    def labels_by(self, method: str) -> NDArray[np.int16]:
        """(H, W) labels of another method of the labeler, by the painting's classes."""
        return _in_classes(self.taught.by_method[method]().labels, self.class_of)


def _in_classes(labels: NDArray[np.int16], class_of: NDArray[np.int16]) -> NDArray[np.int16]:
    if (class_of == np.arange(len(class_of))).all():
        return labels
    return np.append(class_of, np.int16(-1))[labels]  # the last entry serves -1


def quick_labels(
    labeler: PlaceLabeler | None, grid: OccupancyGrid, n_threads: int | None = None
) -> NDArray[np.int16] | None:
    """(H, W) labels, -1 for none, from one view by one network; None without networks."""
    floor = None if labeler is None else labeler.unary_model_.floor
    if floor is None or labeler is None:
        return None
    window = window_to_label(grid, labeler.resolution_m_)
    if window is not None:
        found = quick_labels(labeler, window.crop(grid), n_threads)
        return None if found is None else window.paste(found, -1)
    one = replace(floor, networks=floor.networks[:1], views_per_network=1)
    with thread_limit(n_threads):
        scores = one.scores(grid)
    labels = np.full(grid.shape, -1, np.int16)
    for rows in bands_of_rows(grid.shape):
        cells = np.argwhere(grid.free[rows]) + np.array([rows.start, 0])
        if len(cells):
            labels[tuple(cells.T)] = one.evidence(scores, cells).argmax(axis=1)
    return labels


class Relabeller:
    """Relabels a map on request; the labeler is extended when a new class is painted.

    Where the labeler has networks, ``glanced`` receives quick labels (H, W) from one view first.
    """

    def __init__(
        self,
        grid: OccupancyGrid,
        model: LoadedModel | PlaceLabeler | None,
        *,
        ids: PlaceIds | None = None,
        n_threads: int | None = None,
        glanced: Callable[[NDArray[np.int16]], None] | None = None,
    ) -> None:
        self.grid, self.model = grid, None if model is None else LoadedModel.of(model)
        self._ids, self._n_threads, self._glanced = ids, n_threads, glanced
        self._teacher: InteractiveLabeler | None = None

    def answer(self, question: RelabelRequest, progress: Progress) -> Relabelling:
        """Label the map, after learning the paint if the request says so."""
        paint = question.paint
        if self._glanced is not None:
            tell, self._glanced = self._glanced, None
            with progress.stage("quick labels"):
                labeler = None if self.model is None else self.model.labeler
                labels = quick_labels(labeler, self.grid, self._n_threads)
            if labels is not None:
                tell(labels)
        teacher = self._teacher_for(paint.classes)
        teacher.cuts = question.cuts
        learns = question.learns and bool(paint.painted.any())
        call = teacher.teach if learns else teacher.label
        taught = call(paint, progress=progress)
        class_of = np.array([paint.classes.index(name) for name in taught.label_names], np.int16)
        labels, unary = (
            _in_classes(item, class_of) for item in (taught.labels, taught.unary_labels)
        )
        return Relabelling(taught, question.revision, question.learns, labels, unary, class_of)

    def _teacher_for(self, classes: Sequence[str]) -> InteractiveLabeler:
        if self._teacher is None:
            self._teacher = InteractiveLabeler(
                self.grid,
                self.model,
                classes=classes,
                known_places=self._ids,
                n_threads=self._n_threads,
            )
        elif tuple(self._teacher.classes) != tuple(classes):
            self._teacher = self._teacher.with_classes(classes)
        return self._teacher


def probability_raster(found: LabelledPlaces, label: int | None) -> NDArray[np.uint8]:
    """(H, W) probability of a label, or for None the entropy, from 1 to 255; 0 for none."""
    beliefs = found.labeling.beliefs
    if beliefs is None:
        return np.zeros(found.grid.shape, np.uint8)
    values = normalized_entropy(beliefs) if label is None else beliefs[:, label]
    raster = found.layout.to_raster(np.round(1 + 254 * values).astype(np.uint8), fill=0)
    painted: NDArray[np.uint8] = Coarsening.behind(found.layout, found.grid).paint(raster, 0)
    return painted


def renamed(taught: InteractiveResult, names: dict[tuple[float, float], str]) -> InteractiveResult:
    """The result with the user's names of places, each identified by a point."""
    topology = taught.topology
    own = {}
    for (x, y), name in names.items():
        region = topology.region_at(x, y)
        if region is not None:
            own[region.id] = name
    if not own:
        return taught
    ids = [region.id for region in topology.regions]
    labels = [region.label for region in topology.regions]
    known = {r.id: r.name for r in topology.regions if r.name not in own.values()}
    called = name_places(ids, labels, known=known, own=own)
    regions = tuple(
        replace(region, name=name) for region, name in zip(topology.regions, called, strict=True)
    )
    return replace(taught, topology=replace(topology, regions=regions))


LEAST_M2 = 0.5
"""Smaller changed areas (m²) are not reported."""


@dataclass(frozen=True, eq=False)
class LabelChanges:
    """The unpainted cells (H, W) whose label has changed, and the area that got each label (m²)."""

    cells: NDArray[np.bool_]
    became_m2: dict[int, float]

    @classmethod
    def between(
        cls,
        before: NDArray[np.int16],
        after: NDArray[np.int16],
        paint: NDArray[np.int16],
        resolution_m: float,
    ) -> Self:
        """The changes between two labellings (H, W) with the same classes, -1 for none."""
        cells = np.zeros(after.shape, np.bool_)
        counts = np.zeros(int(after.max(initial=-1)) + 2, np.int64)
        for rows in bands_of_rows(after.shape):
            new = after[rows]
            cells[rows] = (
                (before[rows] != new) & (before[rows] >= 0) & (new >= 0) & (paint[rows] < 0)
            )
            counts += np.bincount(new[cells[rows]], minlength=len(counts))
        area_m2 = counts * resolution_m**2
        return cls(cells, {int(k): float(area_m2[k]) for k in np.flatnonzero(counts)})

    def words(self, names: Sequence[str]) -> str:
        """A message of the changed areas, the largest first; empty if they are small.

        Examples
        --------
        >>> one = np.zeros((2, 5), np.int16)
        >>> other = np.array([[0, 1, 1, 0, 0], [0, 1, 2, 0, 0]], np.int16)
        >>> LabelChanges.between(one, other, np.full_like(one, -1), 1.0).words(["a", "room", "lab"])
        '3.0 m² became room, 1.0 m² lab'
        """
        listed = sorted(self.became_m2.items(), key=lambda item: -item[1])
        large = [(k, area) for k, area in listed if area >= LEAST_M2]
        return ", ".join(
            f"{area:.1f} m²{'' if number else ' became'} {names[k]}"
            for number, (k, area) in enumerate(large)
        )


def share_that_agrees(labels: NDArray[np.int16], truth: NDArray[np.int16]) -> float | None:
    """The share of correct labels among cells with a truth and a label; None without any."""
    known = right = 0
    for rows in bands_of_rows(labels.shape):
        both = (truth[rows] >= 0) & (labels[rows] >= 0)
        known += int(both.sum())
        right += int((both & (truth[rows] == labels[rows])).sum())
    return right / known if known else None
