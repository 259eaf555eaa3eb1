"""The unary model of maps: from scans to the boosted list's scores of every cell."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import freeze
from pgm_places.errors import InputError
from pgm_places.features.custom import Feature, n_columns
from pgm_places.floor.view import FloorScores
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.kernels.lazy_memory import trim_heap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.boosted_list import BoostedList
from pgm_places.progress import report_stage
from pgm_places.sensing.sensor import Sensor
from pgm_places.spaces.cell_features import NodeSegments
from pgm_places.spaces.doorways import Doorways
from pgm_places.unary.cell_scorers import (
    CellList,
    ContextScorer,
    LaserScorer,
    SpaceScorer,
    iter_window_means,
    on_labels,
)
from pgm_places.unary.feature_table import CachedFeatures, iter_features
from pgm_places.unary.floor_model import FloorJudge, FloorModel, with_floor
from pgm_places.unary.options import MIXED, UNARIES
from pgm_places.unary.space_model import MapSpaces, SpaceModel


def made_from(unaries: Collection[str]) -> set[str]:
    """The scores that some unaries depend on; ``laser+space`` depends on two."""
    single = {name for name in unaries if name != MIXED}
    return single if len(single) == len(unaries) else single | {"laser", "space"}


def sees_spaces(unaries: Collection[str]) -> bool:
    """Whether any of these unaries depends on segments, gates and places."""
    return not {"space", "floor"}.isdisjoint(made_from(unaries))


EVEN = (0.5, 0.5)
"""Exponents of ``laser`` and ``space`` in their mean, if neither was calibrated."""

LASER_SHARE = 0.55
"""The share of ``laser`` in the mean of calibrated lists, chosen on buildings left out
(docs/notes/tried.md)."""


def log_mean(
    one: NDArray[np.float64], other: NDArray[np.float64], exponents: tuple[float, float] = EVEN
) -> NDArray[np.float64]:
    """(N, K) the logarithm of the weighted geometric mean of two distributions, normalised again.

    Where the two disagree, the more confident one decides: the logarithmic opinion pool of Genest
    and Zidek (Combining probability distributions, Statistical Science 1, 1986).
    """
    mean = exponents[0] * one + exponents[1] * other
    return np.asarray(mean - np.logaddexp.reduce(mean, axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class CellScores:
    """Per-node scores, before graph inference."""

    # (N, K) logarithm of the histogram z of the list on a cell's own features (paper eq. 8).
    laser: NDArray[np.float64] | None = None
    # (N, K) scores of the list with context, if there is one
    context: NDArray[np.float64] | None = None
    # (N, K) scores of the list with segments, gates and places, if there is one
    space: NDArray[np.float64] | None = None
    # (N, D) the features that boosting chose first, for models that learn their own unary
    node_features: NDArray[np.float32] | None = None
    spaces: MapSpaces | None = None  # the segments, gates and places of ``space``, if stored
    # (N,) the probability that each node lies in a hall if it is circulation, if known
    hall: NDArray[np.float32] | None = None
    doorways: Doorways | None = None  # the accepted gates, if ``spaces`` are not stored
    # the segments of the nodes at the finest scale, with ``space``
    segments: NodeSegments | None = None
    # (N, K) ``space`` fused with the floor networks' scores, if there are networks
    floor: NDArray[np.float64] | None = None
    exponents: tuple[float, float] = EVEN  # exponents of ``laser`` and ``space`` in ``laser+space``

    def of(self, unary: str) -> NDArray[np.float64]:
        """(N, K) the scores of that name.

        One of ``laser``, ``context``, ``space`` and ``floor``, or ``laser+space``, which is the
        weighted geometric mean of the two, normalised.

        InputError: they were not requested.
        """
        if unary == MIXED:
            return log_mean(self.of("laser"), self.of("space"), self.exponents)
        values: NDArray[np.float64] | None = getattr(self, unary)
        if values is None:
            raise InputError(
                f"the scores do not include {unary!r}; request the scores of a method that uses it"
            )
        return values

    @property
    def accepted_gates(self) -> Doorways:
        """The accepted gates, stored or derived from the spaces.

        InputError: there are no scores with spaces.
        """
        if self.doorways is not None:
            return self.doorways
        if self.spaces is None:
            raise InputError("these scores were made without spaces, so there are no gates")
        return self.spaces.doorways


@dataclass(frozen=True, eq=False)
class UnaryModel:
    """A fitted sensor-features-list chain that scores the cells of any map."""

    sensor: Sensor  # the simulated sensor; a model is valid only for the sensor of its training
    classifier: BoostedList  # the list on the 321 laser features, and own features after them
    n_labels: int  # K; the classifier's classes are label indices below K
    node_columns: NDArray[np.int64]  # (D,) columns handed on as node features
    # half-widths in metres of the windows of context; () for none
    context_m: tuple[float, ...] = ()
    # the second list, on the same columns followed by context features
    context_classifier: BoostedList | None = field(default=None, repr=False)
    features: tuple[Feature, ...] = ()  # custom features: see :mod:`pgm_places.features.custom`
    # the list with segments, gates and places
    space: SpaceModel | None = field(default=None, repr=False)
    floor: FloorModel | None = field(default=None, repr=False)  # the floor networks
    # exponents of ``laser`` and ``space`` in ``laser+space``: their shares over the temperatures
    # that maximise the likelihood of held-out cells
    exponents: tuple[float, float] = EVEN

    @property
    def knows_halls(self) -> bool:
        """Whether it distinguishes halls from corridors."""
        return self.space is not None and self.space.corridor is not None

    def columns(self, unaries: Collection[str], *, node_features: bool) -> NDArray[np.int64]:
        """The laser and custom features, ascending, that these scores need."""
        lists, unaries = [], made_from(unaries)
        if "laser" in unaries or "context" in unaries:
            lists.append(self.classifier)
        if "context" in unaries and self.context_classifier is not None:
            lists.append(self.context_classifier)
        if self.space is not None and (sees_spaces(unaries) or self.knows_halls):
            lists.append(self.space.classifier)
        used = [item.used_features for item in lists]
        every = np.concatenate([*used, self.node_columns if node_features else used[0]])
        return np.unique(every[every < n_columns(self.features)]).astype(np.int64)

    def scores(
        self,
        grid: OccupancyGrid,
        graph: LabelGraph,
        *,
        unaries: Collection[str] = UNARIES,
        with_node_features: bool = True,
        with_halls: bool = False,
        single: bool = False,
        with_spaces: bool = True,
        known: NDArray[np.int16] | None = None,
        own: CachedFeatures | None = None,
    ) -> CellScores:
        """The scores of a grid graph's nodes: scans, features and lists, streamed in tiles.

        Only the features that the lists and the result need are computed. Memory beyond the result
        is bounded by the ray caster's tiles and by bands of rows, for maps of any size.

        ``graph``: made by ``LabelGraph.from_grid``. ``unaries``: the requested scores; scores that
        the model lacks are skipped. ``with_node_features``: whether to compute features for
        structured models. ``with_halls``: whether to compute halls, if the model has them, even
        without scores with spaces. ``single``: whether single precision will do. Scores in context
        stay in double. ``with_spaces``: whether the result holds segments, gates and places.
        Without them it holds the doorways alone, and the rasters of a huge map are freed before its
        cells are scored. ``known`` (H, W): observed labels, -1 elsewhere, which decide whether
        gates on them are doorways. ``own``: cached laser and custom features of the nodes, and
        scores that depend on them.
        """
        layout, n, unaries = graph.grid_layout, graph.n_nodes, made_from(unaries)
        handed = self.node_columns if with_node_features else np.zeros(0, np.int64)
        features = np.empty((n, len(handed)), np.float32) if with_node_features else None
        second = self.context_classifier if "context" in unaries else None
        n_own = n_columns(self.features)
        dtype = np.float32 if single and second is None else np.float64
        lists: list[CellList] = []
        if "laser" in unaries or second is not None:
            lists.append(LaserScorer(self.classifier, n, self.n_labels, dtype))
        if second is not None:
            lists.append(ContextScorer(second, n_own, n, self.n_labels))
        spaces, doorways, around, floor_scores = None, None, None, None
        if "floor" in unaries and self.floor is not None:
            with report_stage("floor networks"):
                floor_scores = self.floor_scores(grid, own)
        halls = self.knows_halls and (with_halls or sees_spaces(unaries))
        if self.space is not None and (sees_spaces(unaries) or halls):
            with report_stage("segments, gates and places"):
                judge = None if floor_scores is None else self.gate_judge(floor_scores)
                spaces = self.space.spaces(grid, known=known, judge=judge)
            if not with_spaces and self.space.gates is not None:
                doorways = spaces.doorways
            around = SpaceScorer(
                self.space, spaces, layout, n_own, self.n_labels, dtype, with_halls=halls
            )
            lists.append(around)
            if not with_spaces:
                spaces = None
        trim_heap()  # memory of the spaces, which a huge map needs for its scores
        needed = np.unique(np.concatenate([handed, *(item.columns for item in lists)]))
        for item in lists:
            item.set_columns(needed)
        with report_stage("scans, features and scores") as stage:
            if own is not None:
                for item in lists:
                    item.score_cached(own, np.arange(n))
                if features is not None:
                    features[:] = own.take(np.arange(n), handed)
            else:
                mask, done = layout.mask(), 0
                for nodes, values in iter_features(grid, self.sensor, self.features, mask, needed):
                    for item in lists:
                        item.score_block(nodes, values)
                    if features is not None:
                        features[nodes] = values[:, np.searchsorted(needed, handed)]
                    done += len(nodes)
                    stage.update(done / n)
        by_unary = {item.unary: item.scores for item in lists}
        if second is not None:
            with report_stage("spatial context"):
                self._add_context(second, grid, layout, by_unary["laser"], by_unary["context"])
        hall = None if around is None else around.hall
        if floor_scores is not None and self.floor is not None and around is not None:
            by_unary["floor"] = with_floor(around.scores, floor_scores, self.floor, layout, hall)
        return CellScores(
            **{name: freeze(by_unary[name]) for name in by_unary.keys() & unaries},
            node_features=None if features is None else freeze(features),
            spaces=spaces,
            hall=None if hall is None else freeze(hall),
            doorways=doorways,
            segments=None if around is None else around.features.segments,
            exponents=self.exponents,
        )

    def gate_judge(self, floor_scores: FloorScores) -> FloorJudge:
        """The judge of gates that combines the networks and the list of gates."""
        assert self.floor is not None  # it has scores of a map
        return FloorJudge(self.floor, floor_scores)

    def floor_scores(self, grid: OccupancyGrid, own: CachedFeatures | None = None) -> FloorScores:
        """The networks' scores of a map, cached in a table."""
        assert self.floor is not None  # its scores are requested
        return self.floor.scores(grid) if own is None else own.floor_of(grid, self.floor.scores)

    def _add_context(
        self,
        second: BoostedList,
        grid: OccupancyGrid,
        layout: GridLayout,
        laser: NDArray[np.float64],
        context: NDArray[np.float64],
    ) -> None:
        """Turn ``context`` (N, K), the list's votes on laser features so far, into its log z."""
        context_part = second.part(np.arange(n_columns(self.features), second.n_features))
        labels = second.classes[second.sequence]
        bands = iter_window_means(
            layout,
            lambda nodes: np.exp(laser[nodes])[:, labels],
            self.n_labels,
            self.context_m,
            grid.resolution_m,
        )
        for nodes, means in bands:
            scores = context_part.scores(means)
            scores += context[nodes, : len(scores)].T
            context[nodes] = on_labels(second, second.log_histogram_of(scores), self.n_labels)
