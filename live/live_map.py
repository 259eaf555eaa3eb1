"""LiveMap: a map that is relabelled as it changes, with persistent ids and names of places."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import MapError
from pgm_places.inference.backends import traits_of
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.labelling.label import label
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.places import places_of
from pgm_places.live.growing_features import GrowingFeatures, Update
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid, raster_shift, shifted
from pgm_places.progress import warnings_noted
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["LiveLabels", "LiveMap"]


class SettledMap:
    """Filters flickering cells out of a sequence of maps.

    With a noisy sensor, single cells of a map change back and forth, and so do the scans around
    them. A changed known cell gets its new value at once if at least ``few_cells`` adjacent cells
    have changed, else once ``few_maps`` consecutive maps agree on the change. Cells that were
    unknown change at once. A map that is sent repeatedly is therefore adopted completely.

    Parameters
    ----------
    few_cells : int
        Changes of fewer cells wait; 1 for none.
    few_maps : int
        Number of maps after which they change, the first one included.

    Examples
    --------
    >>> settled = SettledMap(few_cells=2, few_maps=2)
    >>> empty = OccupancyGrid([[0, 0, 0, 0, 0]], 0.1)
    >>> flicker = OccupancyGrid([[0, 0, 100, 0, 0]], 0.1)
    >>> [settled(grid).cells[0, 2].item() for grid in (empty, flicker, empty, flicker, flicker)]
    [0, 0, 0, 0, 100]
    """

    def __init__(self, few_cells: int, few_maps: int) -> None:
        self.few_cells, self.few_maps = few_cells, few_maps
        self._taken: OccupancyGrid | None = None
        self._sent: OccupancyGrid | None = None
        self._times = np.zeros((0, 0), np.int32)

    def __call__(self, grid: OccupancyGrid) -> OccupancyGrid:
        """The filtered map, on the raster of the received map."""
        taken, sent, times = self._taken, self._sent, self._times
        self._sent, self._times = grid, np.ones(grid.shape, np.int32)
        if taken is not None and sent is not None and self.few_cells > 1:
            shift = raster_shift(taken, grid)
            if shift is not None:
                again = shifted(sent.cells, shift, grid.shape, UNKNOWN) == grid.cells
                self._times += np.where(again, shifted(times, shift, grid.shape, 0), 0)
                cells = self._settled(shifted(taken.cells, shift, grid.shape, UNKNOWN), grid)
                grid = grid if cells is None else grid.with_cells(cells)
        self._taken = grid
        return grid

    def _settled(self, taken: NDArray[np.int8], grid: OccupancyGrid) -> NDArray[np.int8] | None:
        """The filtered cells; None if they equal those of the received map."""
        changed = (taken != UNKNOWN) & (taken != grid.cells)
        if not changed.any():
            return None
        pieces = connected_components(changed)
        few = pieces.size < self.few_cells
        waits = changed & few[pieces.piece] & (self._times < self.few_maps)
        return np.where(waits, taken, grid.cells) if waits.any() else None


FEW_CELLS = 6
"""If 2 % of the cells flicker at random, one in a hundred of them has five flickering
neighbours."""

FEW_MAPS = 5
"""Noise is absent from some of five maps; a delay of five maps does not matter for a chair's
leg."""


@dataclass(frozen=True, eq=False)
class LiveLabels:
    """A labelled map of a sequence, and its differences from the previous map.

    Parameters
    ----------
    map_seq : int
        Number of the map, from 1.
    labels : LabelledPlaces
        As returned by :func:`~pgm_places.labelling.label.label_map`.
    topology : TopologicalMap
        The places.
    appeared, vanished : tuple of int
        Ids of new places, and of places that have vanished.
    moved : dict of int to float
        Distance in metres by which the anchor of each persisting place has moved, if it has.
    update : Update or None
        Counts of cast scans; None with custom features, which are not cached.
    merged : dict of int to int
        For vanished places: the place that has most of their area now.
    parted : dict of int to int
        For new places: the place of the previous map that had most of their area.
    warnings : tuple of str
        Warnings that the origin differs from that of earlier places, or that the map does.
    """

    map_seq: int
    labels: LabelledPlaces
    topology: TopologicalMap
    appeared: tuple[int, ...]
    vanished: tuple[int, ...]
    moved: Mapping[int, float]
    update: Update | None
    merged: Mapping[int, int] = field(default_factory=dict)
    parted: Mapping[int, int] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


class LiveMap:
    """Labels the successive maps of one building that a mapping robot sends.

    Features are recomputed only where a beam can have entered a changed cell
    (:class:`~pgm_places.live.growing_features.GrowingFeatures`), and scores only for cells whose
    features or spaces have changed (:class:`~pgm_places.unary.feature_table.CachedFeatures`);
    these steps take most of the time. The segmentation, inference and places are computed for the
    full map each time, because a new door may change two places. Labels are therefore bitwise
    equal to those of a single labelling of the map.

    A change of a few cells is used once five consecutive maps show it
    (:class:`~pgm_places.live.live_map.SettledMap`), so the labelled map, ``labels.grid``, may
    differ from the received one by flickering cells.

    Ids and names persist: a place is recognised by its class and area in the map frame, even after
    maps without it (:class:`~pgm_places.topology.place_ids.PlaceIds`).

    Parameters
    ----------
    model : LoadedModel or PlaceLabeler
        The model with its method and rules; for a fitted labeler, the default ones.
    own_names : mapping of int to str, optional
        The user's names, by id.
    few_cells : int
        Changes of fewer adjacent cells are delayed; 1 to delay none.
    few_maps : int
        Number of consecutive maps for which they are delayed.
    memory : PlaceIds, optional
        The places of an earlier session
        (:func:`~pgm_places.io.places.place_ids_file.read_session`), whose ids and map numbers are
        continued.
    n_threads : int, optional

    Raises
    ------
    NotFittedError
        The labeler is not fitted.
    """

    def __init__(
        self,
        model: LoadedModel | PlaceLabeler,
        *,
        own_names: Mapping[int, str] | None = None,
        few_cells: int = FEW_CELLS,
        few_maps: int = FEW_MAPS,
        memory: PlaceIds | None = None,
        n_threads: int | None = None,
    ) -> None:
        self.model, self.own_names, self.n_threads = LoadedModel.of(model), own_names, n_threads
        chosen, unary = self.model.chosen, self.model.labeler.unary_model_
        self._features = None
        if not unary.features:
            columns = unary.columns(
                [chosen.unary], node_features=traits_of(chosen.backend).uses_node_features
            )
            self._features = GrowingFeatures(unary.sensor, columns, n_threads=n_threads)
        self._settled, self.memory = SettledMap(few_cells, few_maps), memory or PlaceIds()
        self.current: LiveLabels | None = None

    def on_map(self, grid: OccupancyGrid) -> LiveLabels:
        """Label a received map.

        Raises
        ------
        MapError
            The map has no free cell. The previous one stays current.
        """
        if not grid.free.any():
            raise MapError(
                "the map has no free cell to label; look at its thresholds ('pgm-places doctor "
                "MAP')"
            )
        grid = self._settled(grid)
        before, map_seq = self.current, self.memory.n_maps + 1
        if before is None or not _is_same(before.topology.grid, grid):
            self.current = self._labelled(grid, map_seq)
        else:
            update = before.update and Update(before.update.n_cells, 0, 0)
            self.current = LiveLabels(map_seq, before.labels, before.topology, (), (), {}, update)
        self.memory.n_maps = map_seq
        return self.current

    def _labelled(self, grid: OccupancyGrid, map_seq: int) -> LiveLabels:
        labels = label(self.model, grid, cache=self._features, n_threads=self.n_threads)
        with warnings_noted() as of_ids:
            topology = places_of(
                labels.cells, self.model.rules, ids=self.memory, own_names=self.own_names
            )
        differences = _differences(self.memory, topology)
        self.memory.learn(topology)
        update = None if self._features is None else self._features.last
        changes = dict(self.memory.merged), dict(self.memory.parted), tuple(of_ids)
        return LiveLabels(map_seq, labels, topology, *differences, update, *changes)


def _is_same(before: OccupancyGrid, now: OccupancyGrid) -> bool:
    frames = [(grid.resolution_m, grid.origin_xy_m, grid.yaw_rad) for grid in (before, now)]
    return frames[0] == frames[1] and np.array_equal(before.cells, now.cells)


def _differences(
    before: PlaceIds, now: TopologicalMap
) -> tuple[tuple[int, ...], tuple[int, ...], dict[int, float]]:
    """Ids that appeared and vanished, and the shifts of the other anchors in metres."""
    old = {number: before.places[number].anchor_m for number in before.last}
    new = {item.id: item.anchor_m for item in now.regions}
    moved = {
        place: float(np.hypot(*np.subtract(anchor, old[place])))
        for place, anchor in new.items()
        if place in old and anchor != old[place]
    }
    return tuple(sorted(new.keys() - old)), tuple(sorted(old.keys() - new)), moved
