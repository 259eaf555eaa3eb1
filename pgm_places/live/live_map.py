"""A map that is labelled again whenever it changes, its places keeping their ids and names."""

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
from pgm_places.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from pgm_places.maps.raster_shift import raster_shift, shifted
from pgm_places.progress import warnings_noted
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["LiveLabels", "LiveMap"]


class SettledMap:
    """Takes map after map, and holds back flickers.

    Where a sensor is noisy, single cells of a map change to and fro, and with them what a robot
    sees from everywhere around. A known cell that changes takes its new value at once if at least
    ``few_cells`` cells beside each other have changed, and otherwise once ``few_maps`` maps on end
    have said the same. Cells that were unknown are taken at once: the map grows. So a map that is
    sent again and again is taken as it is in the end.

    Parameters
    ----------
    few_cells : int
        Changes of fewer cells wait; 1 for none.
    few_maps : int
        For so many maps, the first that says so counted.

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
        """The map as it counts now, on the raster of the one that has come."""
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
        """The cells that count; None where all of them are those of the map that has come."""
        changed = (taken != UNKNOWN) & (taken != grid.cells)
        if not changed.any():
            return None
        found = connected_components(changed)
        few = found.size < self.few_cells
        waits = changed & few[found.piece] & (self._times < self.few_maps)
        return np.where(waits, taken, grid.cells) if waits.any() else None


FEW_CELLS = 6
"""Where 2 % of the cells flicker at random, one in a hundred of them has five flickering ones
beside it."""

FEW_MAPS = 5
"""Specks of noise are gone from some of five maps; that a chair's leg waits for so many costs
nothing."""


@dataclass(frozen=True, eq=False)
class LiveLabels:
    """A labelled map of a sequence, and what has changed since the one before.

    Parameters
    ----------
    map_seq : int
        Number of the map, from 1.
    labels : LabelledPlaces
        As :func:`~pgm_places.labelling.label.label_map` would return them.
    topology : TopologicalMap
        The places.
    appeared, vanished : tuple of int
        Ids of places that are new, and of those that are gone.
    moved : dict of int to float
        How far the anchor of each place that stays has moved, in metres, where it did.
    update : Update or None
        What was cast; None where nothing is kept from map to map (custom features).
    merged : dict of int to int
        For places that are gone: the place that has most of their area now.
    parted : dict of int to int
        For new places: the place of the map before that had most of their area.
    warnings : tuple of str
        Whether the map has another origin than earlier places, or is another map.
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
    """Labels map after map of one building, as a robot that maps it sends them.

    Features are computed again only where a beam can have entered a changed cell
    (:class:`~pgm_places.live.growing_features.GrowingFeatures`), and lists are asked again only
    about cells whose features or spaces have changed
    (:class:`~pgm_places.unary.feature_table.CachedFeatures`); both take most of the time. The
    division into spaces, inference and places are computed for the whole map each time, because
    a door that appears anywhere may turn two places into others. So labels are the same, to the
    last bit, as those of the map labelled by itself.

    A change of a few cells counts once five maps on end have shown it
    (:class:`~pgm_places.live.live_map.SettledMap`), so the map that is labelled may differ from
    the one that has come by flickers: ``labels.grid`` is what was labelled.

    Ids and names persist: a place is recognised by its class and area in the map frame, also after
    maps in which it was missing (:class:`~pgm_places.topology.place_ids.PlaceIds`).

    Parameters
    ----------
    model : LoadedModel or PlaceLabeler
        With its method and rules; a fitted labeler has the default ones.
    own_names : mapping of int to str, optional
        The user's names, by id.
    few_cells : int
        Changes of fewer cells beside each other wait; 1 to take all at once.
    few_maps : int
        Until so many maps on end have shown them.
    memory : PlaceIds, optional
        The places of an earlier session
        (:func:`~pgm_places.io.places.place_ids_file.read_session`): its ids and numbers of maps go
        on.
    n_threads : int, optional

    Raises
    ------
    NotFittedError
        The labeler has not learned.
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
        """The labels and places of a map that has come.

        Raises
        ------
        MapError
            The map has no free cell. The one before stays current.
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
    """Ids that appeared and vanished, and how far others' anchors moved in metres."""
    old = {number: before.places[number].anchor_m for number in before.last}
    new = {item.id: item.anchor_m for item in now.regions}
    moved = {
        place: float(np.hypot(*np.subtract(anchor, old[place])))
        for place, anchor in new.items()
        if place in old and anchor != old[place]
    }
    return tuple(sorted(new.keys() - old)), tuple(sorted(old.keys() - new)), moved
