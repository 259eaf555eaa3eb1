"""A map that is labelled again whenever it changes, its places keeping their ids and names."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pgm_places.inference.backends import uses_node_features
from pgm_places.labelers.label_map import LabelledPlaces, label_map
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.live.growing_features import GrowingFeatures, Update
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.from_labels import topological_map
from pgm_places.topology.naming import KnownPlaces
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap

__all__ = ["LiveLabels", "LiveMap"]


@dataclass(frozen=True, eq=False)
class LiveLabels:
    """A labelled map of a sequence, and what has changed since the one before.

    Parameters
    ----------
    map_seq : int
        Number of the map, from 1.
    labels : LabelledPlaces
        As :func:`~pgm_places.labelers.label_map.label_map` would return them.
    topology : TopologicalMap
        The places.
    appeared, vanished : tuple of int
        Ids of places that are new, and of those that are gone.
    moved : dict of int to float
        How far the anchor of each place that stays has moved, in metres, where it did.
    update : Update or None
        What was cast; None where nothing is kept from map to map (custom features).
    """

    map_seq: int
    labels: LabelledPlaces
    topology: TopologicalMap
    appeared: tuple[int, ...]
    vanished: tuple[int, ...]
    moved: Mapping[int, float]
    update: Update | None


class LiveMap:
    """Labels map after map of one building, as a robot that maps it sends them.

    Features are computed again only where a beam can have entered a changed cell
    (:class:`~pgm_places.live.growing_features.GrowingFeatures`); they take most of the time. The
    division into spaces, the lists' scores, inference and places are those of the whole map each
    time, because a door that appears anywhere may turn two places into others. So labels are the
    same, to the last bit, as those of the map labelled by itself.

    Ids and names persist: a place is recognised by its class and area in the map frame. A place
    that has vanished gets its id back where it comes again.

    Parameters
    ----------
    labeler : PlaceLabeler
        Fitted.
    method : str, optional
        The labeler's default method if not given.
    rules : TopologyOptions, optional
        Of the places.
    own_names : mapping of int to str, optional
        The user's names, by id.
    n_threads : int, optional

    Raises
    ------
    ConfigError
        The labeler has no such method.
    """

    def __init__(
        self,
        labeler: PlaceLabeler,
        *,
        method: str | None = None,
        rules: TopologyOptions | None = None,
        own_names: Mapping[int, str] | None = None,
        n_threads: int | None = None,
    ) -> None:
        labeler.check_fitted()
        chosen, model = labeler.method(method), labeler.unary_model_
        self.labeler, self.method, self.n_threads = labeler, method, n_threads
        self.rules, self.own_names = rules or TopologyOptions(), own_names
        self._features = None
        if not model.features:
            columns = model.columns(
                [chosen.unary], node_features=uses_node_features(chosen.backend)
            )
            self._features = GrowingFeatures(model.sensor, columns, n_threads=n_threads)
        self._known: KnownPlaces | None = None
        self._current: LiveLabels | None = None

    @property
    def current(self) -> LiveLabels | None:
        """The latest labelled map; None before the first."""
        return self._current

    def on_map(self, grid: OccupancyGrid) -> LiveLabels:
        """The labels and places of a map that has come.

        Raises
        ------
        MapError
            The map has no free cell. The one before stays current.
        """
        labels = label_map(
            self.labeler,
            grid,
            method=self.method,
            features_of=self._features,
            n_threads=self.n_threads,
        )
        topology = topological_map(
            grid,
            labels.labels,
            labels.label_names,
            rules=self.rules,
            correct=self.rules.correct,
            min_width_m=self.rules.min_width_m,
            beliefs=labels.labeling.beliefs,
            layout=labels.layout,
            doorways=labels.doorways if self.rules.doorways == "gates" else None,
            known=self._known,
            own_names=self.own_names,
        )
        before = None if self._current is None else self._current.topology
        appeared, vanished, moved = _differences(before, topology)
        self._known = _remembered(self._known, topology)
        self._current = LiveLabels(
            1 if self._current is None else self._current.map_seq + 1,
            labels,
            topology,
            appeared,
            vanished,
            moved,
            None if self._features is None else self._features.last,
        )
        return self._current


def _differences(
    before: TopologicalMap | None, now: TopologicalMap
) -> tuple[tuple[int, ...], tuple[int, ...], dict[int, float]]:
    """Ids that appeared and vanished, and how far others' anchors moved in metres."""
    old = {} if before is None else {item.id: item.anchor_m for item in before.regions}
    new = {item.id: item.anchor_m for item in now.regions}
    moved = {
        place: float(np.hypot(*np.subtract(anchor, old[place])))
        for place, anchor in new.items()
        if place in old and anchor != old[place]
    }
    return tuple(sorted(new.keys() - old)), tuple(sorted(old.keys() - new)), moved


def _remembered(known: KnownPlaces | None, now: TopologicalMap) -> KnownPlaces:
    """The places of now, and where none of them is, those known before that are gone."""
    found = now.known_places
    if known is None:
        return found
    gone = sorted(known.labels.keys() - found.labels)
    cells = np.argwhere(np.isin(known.region, gone))
    there = now.grid.cells_at_m(known.grid.cell_centres_m(cells))
    inside = ((there >= 0) & (there < now.grid.shape)).all(axis=1)
    there, ids = there[inside], known.region[tuple(cells[inside].T)]
    region = found.region.copy()
    free = region[tuple(there.T)] == 0
    region[tuple(there[free].T)] = ids[free]
    left = set(np.unique(ids[free]).tolist())
    return replace(
        found,
        region=region,
        labels={**{place: known.labels[place] for place in left}, **found.labels},
        names={**known.names, **found.names},
    )
