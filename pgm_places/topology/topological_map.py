"""The topological map: places as nodes, passages as edges, queries, and GeoJSON."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places import plotting
from pgm_places._arguments import travels
from pgm_places._checks import freeze, require_shape, set_frozen
from pgm_places.errors import InputError, nearest_name
from pgm_places.graph.bands import bands_of_rows
from pgm_places.maps.occupancy_grid import OccupancyGrid, at_cells
from pgm_places.plotting import Plotted, axes_or_new, data_frame
from pgm_places.spaces.gates import Gate
from pgm_places.topology.corrections import Correction
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.regions import Connection, Region

if TYPE_CHECKING:
    import networkx as nx
    from matplotlib.axes import Axes


LOCAL_METRES = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}
"""A plane in metres, as a member of older GeoJSON that QGIS and Nav2 read; now only degrees are
standard."""

DIGITS = 6

SIZES = ("heading_rad", "width_m", "depth_m")
"""Property names of a gate."""


def gate_record(gate: Gate) -> dict[str, object]:
    """Centre, heading, width, depth and the four corners (counter-clockwise), in the map frame.

    Examples
    --------
    >>> gate_record(Gate((2.0, 1.0), 0.0, width_m=1.0, depth_m=0.2))["corners_m"]
    [[1.9, 0.5], [2.1, 0.5], [2.1, 1.5], [1.9, 1.5]]
    """
    return {
        "centre_m": [round(value, DIGITS) for value in gate.centre_m],
        **{name: round(getattr(gate, name), DIGITS) for name in SIZES},
        "corners_m": gate.corners_m.round(DIGITS).tolist(),
    }


def region_feature(region: Region, neighbours: Sequence[int]) -> dict[str, object]:
    """A Feature with the outline of a region as a Polygon or MultiPolygon.

    Properties: ``id``, ``class``, ``name``, ``area_m2``, ``perimeter_m``, ``confidence`` (where it
    is known), ``hall`` (its probability, where halls are shown as corridors and it is known),
    ``anchor_m``, ``clearance_m``, ``neighbours`` (ids), and for a doorway that is a gate ``gate``:
    its rectangle.
    """
    listed = [
        [[[round(x, DIGITS), round(y, DIGITS)] for x, y in ring.tolist()] for ring in rings]
        for rings in region.polygons
    ]
    kind, coordinates = ("Polygon", listed[0]) if len(listed) == 1 else ("MultiPolygon", listed)
    properties: dict[str, Any] = {
        "id": region.id,
        "class": region.label,
        "name": region.name,
        "area_m2": round(region.area_m2, DIGITS),
        "perimeter_m": round(region.perimeter_m, DIGITS),
    }
    if region.confidence is not None:
        properties["confidence"] = round(region.confidence, DIGITS)
    if region.hall is not None:
        properties["hall"] = round(region.hall, DIGITS)
    properties |= {
        "anchor_m": [round(value, DIGITS) for value in region.anchor_m],
        "clearance_m": round(region.clearance_m, DIGITS),
        "neighbours": list(neighbours),
    }
    if region.gate is not None:
        properties["gate"] = gate_record(region.gate)
    return {
        "type": "Feature",
        "id": region.id,
        "geometry": {"type": kind, "coordinates": coordinates},
        "properties": properties,
    }


_ROWS_AT_ONCE = 256


@travels
@dataclass(frozen=True, eq=False)
class TopologicalMap(Plotted):
    """Places of a map and their connections (paper section 6.2, Fig. 9).

    Parameters
    ----------
    grid : OccupancyGrid
        The map of the places.
    region : (H, W) int32
        Id of the region at each cell, 0 for none.
    regions : tuple of Region
        By increasing id.
    connections : tuple of Connection
        Sorted by ids.
    label_names : tuple of str
    doorway_label : str
        The class of regions that connect two places.
    corrections : tuple of Correction
        Regions that were relabelled.
    next_id : int
        The first id that has never been assigned.
    removed_openings : tuple of ((float, float), (float, float))
        Lines across openings that corrections or merges removed, in the map frame.
    """

    grid: OccupancyGrid
    region: NDArray[np.int32]
    regions: tuple[Region, ...]
    connections: tuple[Connection, ...]
    label_names: tuple[str, ...]
    doorway_label: str = "doorway"
    corrections: tuple[Correction, ...] = ()
    next_id: int = 1
    removed_openings: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = ()

    def __post_init__(self) -> None:
        set_frozen(self, region=self.region)
        require_shape("region", self.region.shape, self.grid.shape, of="the map's")

    def __repr__(self) -> str:
        return (
            f"TopologicalMap({len(self.regions)} regions, {len(self.connections)} connections on "
            f"{self.grid.shape[0]} x {self.grid.shape[1]} cells)"
        )

    @cached_property
    def labels(self) -> NDArray[np.int16]:
        """(H, W) label of each cell's region, -1 for none."""
        highest = max((region.id for region in self.regions), default=0)
        table = np.full(highest + 1, -1, np.int16)
        for region in self.regions:
            table[region.id] = self.label_names.index(region.label)
        labels = np.empty(self.region.shape, np.int16)
        for rows in bands_of_rows(self.grid.shape):  # NumPy makes 64-bit copies of indices
            labels[rows] = table[self.region[rows]]
        return freeze(labels)

    @cached_property
    def area_m2(self) -> dict[str, float]:
        """The area of the places of each label."""
        areas = dict.fromkeys(self.label_names, 0.0)
        for region in self.regions:
            areas[region.label] += region.area_m2
        return areas

    @cached_property
    def _by_id(self) -> dict[int, Region]:
        return {region.id: region for region in self.regions}

    @cached_property
    def _by_name(self) -> dict[str, Region]:
        return {region.name: region for region in self.regions}

    @cached_property
    def _neighbour_ids(self) -> dict[int, list[int]]:
        neighbours: dict[int, list[int]] = {region.id: [] for region in self.regions}
        for item in self.connections:
            neighbours[item.first].append(item.second)
            neighbours[item.second].append(item.first)
        return {number: sorted(others) for number, others in neighbours.items()}

    def place(self, key: int | str) -> Region:
        """The region with an id or a name.

        Raises
        ------
        InputError
            There is no such region; the message suggests the nearest name.
        """
        region = self._by_id.get(key) if isinstance(key, int) else self._by_name.get(key)
        if region is None:
            hint = nearest_name(str(key), list(self._by_name))
            raise InputError(f"there is no place {key!r}. {hint}")
        return region

    def ids_of(self, names: Iterable[str]) -> tuple[int, ...]:
        """Ids of the places with these names, and of all places of these classes, ascending.

        Raises
        ------
        InputError
            A name is neither a place nor a class.
        """
        wanted, known = set(names), [*self.label_names, *self._by_name]
        for name in sorted(wanted.difference(known)):
            raise InputError(f"there is no class or place {name!r}. {nearest_name(name, known)}")
        return tuple(r.id for r in self.regions if {r.name, r.label} & wanted)

    def region_at(self, x_m: float, y_m: float) -> Region | None:
        """The region at a position in the map frame, or None."""
        [number] = at_cells(self.region, self.grid.cells_at_m([[x_m, y_m]]), 0).tolist()
        return self._by_id.get(number)

    def neighbours(self, key: int | str) -> list[Region]:
        """The neighbours of a region, by id."""
        return [self._by_id[other] for other in self._neighbour_ids[self.place(key).id]]

    @cached_property
    def _windows(self) -> NDArray[np.int64]:
        """(R + 1, 2, 2) first and last row, and column, of each id; without SciPy's import time."""
        n = int(self.region.max(initial=0)) + 1
        first, last = np.full((n, 2), max(self.grid.shape)), np.full((n, 2), -1)
        for top in range(0, len(self.region), _ROWS_AT_ONCE):  # saves a list of all cells
            band = self.region[top : top + _ROWS_AT_ONCE]
            cells = np.argwhere(band > 0)
            number = band[tuple(cells.T)]
            cells[:, 0] += top
            np.minimum.at(first, number, cells)
            np.maximum.at(last, number, cells)
        return np.stack([first, last], axis=2)

    def window(self, key: int | str) -> tuple[slice, slice]:
        """The rows and columns spanned by a region."""
        rows, columns = self._windows[self.place(key).id].tolist()
        return slice(rows[0], rows[1] + 1), slice(columns[0], columns[1] + 1)

    def cells(self, key: int | str) -> NDArray[np.int64]:
        """(n, 2) row and column of the cells of a region; of a doorway, of its passage."""
        region = self.place(key)
        rows, columns = self.window(region.id)
        inside = self.region[rows, columns] == region.id
        return np.argwhere(inside) + np.array([rows.start, columns.start])

    def path(self, start: int | str, end: int | str) -> list[Region]:
        """The regions along the shortest path from one to another, both included.

        Raises
        ------
        InputError
            One of them is unknown, or there is no path between them.
        """
        import networkx as nx

        first, last = self.place(start), self.place(end)
        try:
            ids = nx.shortest_path(self.graph, first.id, last.id, weight="length_m")
        except nx.NetworkXNoPath:
            raise InputError(f"no path leads from {first.name!r} to {last.name!r}") from None
        return [self._by_id[number] for number in ids]

    @cached_property
    def graph(self) -> "nx.Graph[int]":
        """Regions as nodes and connections as edges, with plain numbers and strings as attributes.

        Nodes have ``name``, ``label``, ``area_m2``, ``x_m``, ``y_m`` (the anchor), ``clearance_m``
        and ``confidence`` where it is known; edges ``x_m``, ``y_m``, ``width_m``, ``border_m`` and
        ``length_m``, the distance from anchor to anchor through the passage.
        """
        import networkx as nx

        graph: nx.Graph[int] = nx.Graph()
        for region in self.regions:
            known = {} if region.confidence is None else {"confidence": region.confidence}
            graph.add_node(
                region.id,
                name=region.name,
                label=region.label,
                area_m2=region.area_m2,
                x_m=region.anchor_m[0],
                y_m=region.anchor_m[1],
                clearance_m=region.clearance_m,
                **known,
            )
        for item in self.connections:
            ends = [self._by_id[number].anchor_m for number in (item.first, item.second)]
            graph.add_edge(
                item.first,
                item.second,
                x_m=item.point_m[0],
                y_m=item.point_m[1],
                width_m=item.width_m,
                border_m=item.border_m,
                length_m=sum(float(np.hypot(*np.subtract(end, item.point_m))) for end in ends),
            )
        return graph

    @cached_property
    def place_graph(self) -> "nx.MultiGraph[int]":
        """Rooms, corridors and other places as nodes; doorways and open passages as edges.

        A doorway is an edge between every pair of places that it touches, with its id as
        ``doorway``, its anchor as ``x_m`` and ``y_m``, and the narrower of its two passages as
        ``width_m``. ``doorway`` is 0 if two places touch without a doorway. Adjacent doorways count
        as one, with the smallest id.
        """
        import networkx as nx

        graph: nx.MultiGraph[int] = nx.MultiGraph()
        doors = [r.id for r in self.regions if r.label == self.doorway_label]
        graph.add_nodes_from(
            (number, values) for number, values in self.graph.nodes.items() if number not in doors
        )
        for a, b, values in self.graph.edges(data=True):
            if a in graph and b in graph:
                graph.add_edge(a, b, doorway=0, **values)
        for group in nx.connected_components(self.graph.subgraph(doors)):
            door = min(group)
            x, y = self._by_id[door].anchor_m
            width: dict[int, float] = {}
            for member in group:
                for place in set(self.graph[member]) - group:
                    here = self.graph[member][place]["width_m"]
                    width[place] = max(here, width.get(place, 0.0))
            for a, b in combinations(sorted(width), 2):
                graph.add_edge(a, b, doorway=door, x_m=x, y_m=y, width_m=min(width[a], width[b]))
        return graph

    def plot(self, ax: "Axes | None" = None, *, names: bool = True) -> "Axes":
        """Draw the labels, with the graph of the places over them.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            New axes if not given.
        names : bool
            Write the names of places next to their nodes; doorways have none.

        Returns
        -------
        matplotlib.axes.Axes
        """
        ax = self.grid.plot(axes_or_new(ax))
        plotting.draw_labels(ax, self.labels, self.label_names, self.grid.frame)
        anchors = {region.id: region.anchor_m for region in self.regions}
        lines = [
            np.array([anchors[item.first], item.point_m, anchors[item.second]])
            for item in self.connections
        ]
        places = [region for region in self.regions if region.label != self.doorway_label]
        nodes = np.array([region.anchor_m for region in places]).reshape(-1, 2)
        plotting.draw_graph(ax, nodes, lines, [place.name if names else "" for place in places])
        return ax

    def to_networkx(self) -> "nx.Graph[int]":
        """A mutable copy of :attr:`graph`."""
        return self.graph.copy()

    def to_geojson(self) -> dict[str, Any]:
        """The regions as a FeatureCollection of GeoJSON, in metres of the map frame.

        Returns
        -------
        dict
            A Polygon or MultiPolygon for each region, with the properties of
            :func:`~pgm_places.topology.topological_map.region_feature`.

        Examples
        --------
        >>> from pgm_places import topological_map
        >>> grid = OccupancyGrid(np.zeros((4, 4)), 0.5)
        >>> places = topological_map(grid, np.zeros((4, 4), int), ["room", "doorway"])
        >>> places.to_geojson()["features"][0]["properties"]["name"]
        'room 1'
        """
        features = [region_feature(item, self._neighbour_ids[item.id]) for item in self.regions]
        return {"type": "FeatureCollection", "crs": LOCAL_METRES, "features": features}

    def to_dataframe(self) -> Any:
        """The regions as a table of pandas.

        Returns
        -------
        pandas.DataFrame
            Index ``id``; columns ``name``, ``label``, ``area_m2``, ``perimeter_m``, ``x_m``,
            ``y_m`` (the anchor), ``clearance_m``, ``confidence`` (NaN where unknown) and
            ``neighbours``, a tuple of ids.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        same = ("id", "name", "label", "area_m2", "perimeter_m", "clearance_m")
        columns: dict[str, Any] = {name: [getattr(r, name) for r in self.regions] for name in same}
        columns["x_m"] = [region.anchor_m[0] for region in self.regions]
        columns["y_m"] = [region.anchor_m[1] for region in self.regions]
        columns["confidence"] = np.array([r.confidence for r in self.regions], np.float64)
        columns["neighbours"] = [tuple(self._neighbour_ids[region.id]) for region in self.regions]
        return data_frame(columns, "id")

    @property
    def known_places(self) -> PlaceIds:
        """The ids and areas by which the next run recognises these places."""
        return PlaceIds.of(self)
