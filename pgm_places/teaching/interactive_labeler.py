"""InteractiveLabeler: labels a map again after each stroke of paint, and learns the paint."""

import copy
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import plain_names
from pgm_places.errors import LabelError
from pgm_places.kernels.threads import thread_limit
from pgm_places.labelers.known_cells import KnownCells
from pgm_places.labelers.labelled_places import (
    SAME_RESOLUTION,
    LabelledPlaces,
    at_model_resolution,
    window_to_label,
)
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelling.label import score_map
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.places import places_of
from pgm_places.maps.coarsening import coarsen
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.mrf import Independent
from pgm_places.progress import Progress, report_stage, reporting_to
from pgm_places.sensing.sensor import Sensor
from pgm_places.spaces.gates import Gate
from pgm_places.teaching.learning import CellPaint, CellTable, Learning, learned_alone
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.training_selection import TeachingOptions
from pgm_places.topology.checks import PlaceCheck, places_to_check
from pgm_places.topology.cuts import Line
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.topological_map import TopologicalMap
from pgm_places.unary.feature_table import CachedFeatures
from pgm_places.unary.map_model import CellScores

# A place whose painted share is at least this is not to be checked again.
ANSWERED = 0.75


@dataclass(frozen=True, eq=False)
class InteractiveResult:
    """A map labelled by a labeler and by paint.

    Parameters
    ----------
    labelled : LabelledPlaces
        The labels and probabilities after the graph.
    unary : LabelledPlaces
        Those of each cell alone, before the graph; painted cells have the label of their paint.
    topology : TopologicalMap
        Regions with names and probabilities, and how they are connected.
    paint : Paint
        The paint.
    labeler : PlaceLabeler
        The labeler that labelled the map: the given one, or the one trained on the paint.
    scores : CellScores
        The scores of each labelled cell by the labeler's lists and networks.
    seconds : float
        From the call to the result.
    by_method : mapping of str to callable, optional
        The labels by the labeler's other methods from the same scores and paint, computed at the
        first request.
    """

    labelled: LabelledPlaces
    unary: LabelledPlaces
    topology: TopologicalMap
    paint: Paint
    labeler: PlaceLabeler
    scores: CellScores
    seconds: float
    by_method: Mapping[str, Callable[[], LabelledPlaces]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"InteractiveResult({self.paint}; {self.topology}; {self.seconds:.1f} s)"

    @property
    def grid(self) -> OccupancyGrid:
        """The map."""
        return self.labelled.grid

    @property
    def label_names(self) -> tuple[str, ...]:
        """The K classes of labels and probabilities."""
        return self.labelled.label_names

    @property
    def labels(self) -> NDArray[np.int16]:
        """(H, W) label of each free cell, -1 elsewhere; painted cells as painted."""
        return self.labelled.labels

    @property
    def unary_labels(self) -> NDArray[np.int16]:
        """(H, W) the label of each cell before graph inference."""
        return self.unary.labels

    @cached_property
    def probabilities(self) -> NDArray[np.float32] | None:
        """(H, W, K) probability of each label after the graph, 0 outside free cells.

        None if the method gives none. For single cells of a huge map use
        ``labelled.labeling.beliefs`` with ``labelled.layout``.
        """
        return _raster(self.labelled)

    @cached_property
    def unary_probabilities(self) -> NDArray[np.float32] | None:
        """(H, W, K) probability of each label before the graph, 0 outside free cells."""
        return _raster(self.unary)

    @property
    def gates(self) -> tuple[tuple[Gate, float], ...]:
        """The accepted gates, each with its probability; painted ones are certain."""
        doorways = self.labelled.doorways
        if doorways is None:
            return ()
        return tuple(zip(doorways.gates, doorways.probability.tolist(), strict=True))

    @cached_property
    def checks(self) -> list[PlaceCheck]:
        """The places to check, by descending doubt times area."""
        return places_to_check(self.topology)

    @cached_property
    def open_checks(self) -> list[PlaceCheck]:
        """The places to check, without places that are mostly painted.

        The unpainted rest of a painted place are the doorways at its edge, which need no check.
        """
        region = self.topology.region
        n_cells = np.bincount(region.ravel())
        n_painted = np.bincount(region[self.paint.painted], minlength=len(n_cells))
        is_answered = n_painted >= ANSWERED * n_cells
        return [check for check in self.checks if not is_answered[check.place.id]]


def _raster(places: LabelledPlaces) -> NDArray[Any] | None:
    beliefs = places.labeling.beliefs
    return None if beliefs is None else places.on_map(beliefs.astype(np.float32), np.float32(0))


# Without a labeler, finer maps are labelled at this resolution.
FINEST_M = 0.05


class InteractiveLabeler:
    """Labels one map repeatedly while a person paints on it.

    One thread at a time may call it. A ``progress`` that raises ends a call at its next stage, so
    that a program can call again after every stroke.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    model : LoadedModel or PlaceLabeler, optional
        A fitted labeler to build on, with the rules of its model or the default rules; None to
        learn from the paint only.
    classes : sequence of str, optional
        The classes to paint: the labeler's labels by default.
    options : TeachingOptions, optional
        How the labeler is trained further on paint.
    known_places : PlaceIds, optional
        Earlier places, which keep their ids and names. The places of each result are added to it.
    n_threads : int, optional
        All cores by default.

    Attributes
    ----------
    cuts : sequence of ((float, float), (float, float))
        Lines in the map frame that divide places of the next results: see
        :func:`~pgm_places.topology.from_labels.topological_map`.

    Raises
    ------
    LabelError
        No classes, or classes that lack a label of the labeler.

    Examples
    --------
    >>> from pgm_places import trained_labeler
    >>> from pgm_places.simulation import generate_building
    >>> building = generate_building(size="small", resolution_m=0.1)
    >>> teacher = InteractiveLabeler(building.grid, trained_labeler())
    >>> first = teacher.label(teacher.blank())
    >>> place = first.checks[0].place
    >>> paint = first.paint.with_cells(first.topology.cells(place.id), "room")
    >>> bool((teacher.label(paint).labels[paint.painted] == 1).all())
    True
    """

    def __init__(
        self,
        grid: OccupancyGrid,
        model: LoadedModel | PlaceLabeler | None = None,
        *,
        classes: Sequence[str] | None = None,
        options: TeachingOptions | None = None,
        known_places: PlaceIds | None = None,
        n_threads: int | None = None,
    ) -> None:
        if model is None and classes is None:
            raise LabelError("without a labeler, 'classes' must list the classes to paint")
        self.grid, self.model = grid, None if model is None else LoadedModel.of(model)
        resolution_m = FINEST_M if self.labeler is None else self.labeler.resolution_m_
        self._window = window_to_label(grid, resolution_m)
        self._part = grid if self._window is None else self._window.crop(grid)
        self._take(classes or (() if self.labeler is None else self.labeler.label_names_))
        self.options = options or TeachingOptions()
        self.known_places = PlaceIds() if known_places is None else known_places
        self.n_threads = n_threads
        self.cuts: Sequence[Line] = ()
        self._kept: CachedFeatures | None = None

    @property
    def labeler(self) -> PlaceLabeler | None:
        """The labeler to build on."""
        return None if self.model is None else self.model.labeler

    def with_classes(self, classes: Sequence[str]) -> "InteractiveLabeler":
        """An interactive labeler of other classes on the same cached data; raises as a new one."""
        other = copy.copy(self)
        other._table = self._table
        other._take(classes)
        return other

    def _take(self, classes: Sequence[str]) -> None:
        """Set the classes to paint."""
        self.classes = plain_names("classes", list(classes))
        own = () if self.labeler is None else self.labeler.label_names_
        missing = [name for name in own if name not in self.classes]
        if missing:
            raise LabelError(
                f"{missing[0]!r} is a label of the labeler and must be among the classes, got "
                f"{', '.join(self.classes)}"
            )

    def blank(self) -> Paint:
        """A blank painting of this map."""
        return Paint.blank(self.grid.shape, self.classes)

    def label(self, paint: Paint, *, progress: Progress | None = None) -> InteractiveResult:
        """The map labelled by the labeler; painted cells keep their labels in every method.

        Raises
        ------
        LabelError
            Paint that does not fit the map or the classes; without a labeler, paint of fewer than
            two classes.
        """
        with reporting_to(progress), thread_limit(self.n_threads):
            start = time.perf_counter()
            self._check_known(paint)
            return self._labelled(self.labeler or self.learned(paint), paint, start)

    def teach(self, paint: Paint, *, progress: Progress | None = None) -> InteractiveResult:
        """As :meth:`label`, by a labeler that has learned the paint."""
        with reporting_to(progress), thread_limit(self.n_threads):
            start = time.perf_counter()
            return self._labelled(self.learned(paint), paint, start)

    def learned(self, paint: Paint, progress: Progress | None = None) -> PlaceLabeler:
        """The labeler trained further on the paint, or on paint alone; raises as :meth:`label`."""
        table = self._table
        painted, classes = self._cut(paint), paint.classes
        known = KnownCells.of(painted, self._part, table.grid, classes, classes)
        cells = CellPaint(known.on_cells, paint.classes)
        with thread_limit(self.n_threads), reporting_to(progress):
            if self.model is None:
                return learned_alone(cells, table, self.options)
            learning = Learning(table, self.options)
            return learning.taught(self.model.labeler, cells, self.model.method)

    def _check_known(self, paint: Paint) -> None:
        known = self.classes if self.labeler is None else self.labeler.label_names_
        new = [name for name, n in paint.counts.items() if n and name not in known]
        if new:
            raise LabelError(
                f"{new[0]!r} is painted, but is no label of the labeler ({', '.join(known)}); "
                "teach it"
            )

    @cached_property
    def _table(self) -> CellTable:
        """The cells to label, at the labeler's resolution, with features computed on demand."""
        if self.labeler is not None:
            model = self.labeler.unary_model_
            used, _ = at_model_resolution(self.labeler, self._part)
            return CellTable(used, model.sensor, model.features)
        fine = self.grid.resolution_m < FINEST_M * (1 - SAME_RESOLUTION)
        used = coarsen(self._part, FINEST_M) if fine else self._part
        return CellTable(used, Sensor())

    def _rows(self, labeler: PlaceLabeler) -> CachedFeatures | None:
        """The cells' features with the cached scores of a labeler; None for a huge map."""
        # The given labeler rescores only cells whose segments, places or gates have changed. A
        # further trained labeler rescores all cells, but the floor networks, which paint does not
        # train, are evaluated once.
        own = self._table.all()
        if own is None:
            return None
        if self._kept is None:
            self._kept = CachedFeatures.of_cells(own)
        return self._kept if labeler is self.labeler else self._kept.for_model()

    def _labelled(self, labeler: PlaceLabeler, paint: Paint, start: float) -> InteractiveResult:
        model = self._model_of(labeler)
        scored = score_map(
            model,
            self._part,
            self._cut(paint.with_classes(labeler.label_names_)),
            lambda _: self._rows(labeler),
            keep_scores=True,
        )
        assert scored.scores is not None  # requested above
        unary = self._whole(scored.labelled(Independent()))
        labelled = self._whole(scored.labelled())
        with report_stage("places"):
            topology = places_of(labelled.cells, model.rules, ids=self.known_places, cuts=self.cuts)
        self.known_places.learn(topology)

        def labelled_by(name: str) -> LabelledPlaces:
            return self._whole(scored.by(name).labelled())

        others = {
            name: cache(partial(labelled_by, name))
            for name, item in labeler.methods_.items()
            if name != model.method
            and item.unary == model.chosen.unary  # others would need scores of their own
            and not isinstance(item.backend, Independent)
        }
        seconds = time.perf_counter() - start
        return InteractiveResult(
            labelled, unary, topology, paint, labeler, scored.scores[1], seconds, others
        )

    def _cut(self, paint: Paint) -> NDArray[np.int16]:
        """The painted labels in the labelled window of the map."""
        return paint.labels if self._window is None else self._window.cut(paint.labels)

    def _whole(self, found: LabelledPlaces) -> LabelledPlaces:
        """The labels of the window on the full map."""
        return found if self._window is None else found.on_whole(self.grid, self._window)

    def _model_of(self, labeler: PlaceLabeler) -> LoadedModel:
        """The given model, or one with its rules and the further trained labeler."""
        if self.model is None:
            return LoadedModel(labeler)
        if labeler is self.model.labeler:
            return self.model
        knows = self.model.method in labeler.methods_  # else it has other classes
        method = self.model.method if knows else labeler.default_method
        return replace(self.model, labeler=labeler, method=method, sha256="")
