"""Paint: labels that a person gives to some cells of a map."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import label_raster, plain_names, set_frozen
from pgm_places.errors import LabelError
from pgm_places.io.atomic import write_text
from pgm_places.io.maps.label_image import load_labels, save_labels
from pgm_places.io.maps.label_values import listed_names
from pgm_places.io.maps.regions import load_regions, read_regions
from pgm_places.maps.components import connected_components
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.topology.outlines import outlines
from pgm_places.topology.topological_map import LOCAL_METRES

LINE_WIDTH_M = 0.2
"""Default width of the lines of a GeoJSON file (m)."""

_DIGITS = 6
_VECTOR_SUFFIXES = (".geojson", ".json")


@dataclass(frozen=True, eq=False)
class Paint:
    """Labels on some cells of a map, the others left open.

    Parameters
    ----------
    labels : (H, W) int16
        Index into ``classes`` of each painted cell, -1 where nothing is painted. Row 0 is the
        bottom of the map. Paint on cells that are not free is stored but has no effect.
    classes : tuple of str

    Raises
    ------
    LabelError
        A class is no valid name, or a label has no class.

    Examples
    --------
    >>> paint = Paint.blank((2, 3), ["corridor", "room"]).with_cells([[0, 1], [0, 2]], "room")
    >>> paint.labels.tolist()
    [[-1, 1, 1], [-1, -1, -1]]
    >>> paint
    Paint(2 of 6 cells: room 2)
    """

    labels: NDArray[np.int16]
    classes: tuple[str, ...]

    def __post_init__(self) -> None:
        names = plain_names("classes", list(self.classes))
        labels = label_raster("labels", self.labels, ("H", "W"), n_labels=len(names))
        set_frozen(self, classes=names, labels=labels)

    def __repr__(self) -> str:
        listed = ", ".join(f"{name} {n}" for name, n in self.counts.items() if n) or "nothing"
        return f"Paint({sum(self.counts.values())} of {self.labels.size} cells: {listed})"

    @classmethod
    def blank(cls, shape: tuple[int, int], classes: Sequence[str]) -> Self:
        """No paint on a map of ``shape`` rows and columns."""
        return cls(np.full(shape, -1, np.int16), tuple(classes))

    @classmethod
    def read(
        cls, path: Path | str, grid: OccupancyGrid, classes: Sequence[str] | None = None
    ) -> Self:
        """The paint in a file: a label image of the map's size, or GeoJSON in metres.

        Parameters
        ----------
        path : Path
            A label image with its names file (see
            :func:`~pgm_places.io.maps.label_image.load_labels`), or, ending in ``.geojson`` or
            ``.json``, polygons and lines with a property ``class``. Lines are 0.2 m wide unless
            their property ``width_m`` says otherwise; of overlapping shapes the smaller one wins.
        grid : OccupancyGrid
            The map.
        classes : sequence of str, optional
            The classes to paint; by default the names in an image's names file, or the classes
            of the GeoJSON features.

        Raises
        ------
        LabelError
            The file is missing, damaged, of another size, or paints nothing, or with a label that
            is not among ``classes``.
        """
        vector = Path(path).suffix.lower() in _VECTOR_SUFFIXES
        if classes is not None:
            names = tuple(classes)
        elif vector:
            shapes = read_regions(path, line_width_m=LINE_WIDTH_M)
            names = tuple(dict.fromkeys(shape.code for shape in shapes))
        else:
            names = tuple(listed_names(path))
        if vector:
            labels = load_regions(path, names, grid, line_width_m=LINE_WIDTH_M)
        else:
            same = {name: name for name in listed_names(path)}
            labels = load_labels(path, names, grid=grid, classes=same)
        return cls(labels, names)

    def save(self, path: Path | str, grid: OccupancyGrid) -> Path:
        """Write the paint as a label image (``.png``) or as polygons (``.geojson``); the path.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        target = Path(path)
        if target.suffix.lower() not in _VECTOR_SUFFIXES:
            return save_labels(target, self.labels, self.classes)[0]
        return write_text(target, json.dumps(self.features(grid), allow_nan=False) + "\n")

    def features(self, grid: OccupancyGrid) -> dict[str, Any]:
        """The paint as a GeoJSON FeatureCollection: the exact outline of each painted piece."""
        pieces = connected_components(self.labels)
        features = []
        for label, outline in zip(
            pieces.label.tolist(), outlines(pieces.piece, pieces.count, tolerance=0), strict=True
        ):
            listed = [[_ring(ring, grid) for ring in rings] for rings in outline.polygons]
            geometry = {"type": "MultiPolygon", "coordinates": listed}
            properties = {"class": self.classes[label]}
            features.append({"type": "Feature", "geometry": geometry, "properties": properties})
        return {"type": "FeatureCollection", "crs": LOCAL_METRES, "features": features}

    @property
    def painted(self) -> NDArray[np.bool_]:
        """(H, W) mask of the painted cells."""
        return np.asarray(self.labels >= 0)

    @property
    def counts(self) -> dict[str, int]:
        """Number of painted cells per class."""
        counts = np.bincount(self.labels[self.painted], minlength=len(self.classes))
        return dict(zip(self.classes, counts.tolist(), strict=True))

    def with_cells(self, cells_rc: ArrayLike, name: str | None) -> Self:
        """The paint with cells (n, 2), row and column, painted as ``name``; None erases them."""
        labels = self.labels.copy()
        r, c = np.asarray(cells_rc, np.int64).reshape(-1, 2).T
        labels[r, c] = -1 if name is None else self._number(name)
        return replace(self, labels=labels)

    def with_classes(self, classes: Sequence[str]) -> Self:
        """The paint with another list of classes.

        Raises
        ------
        LabelError
            A class that is painted is not among them.
        """
        names = list(classes)
        lost = [name for name, n in self.counts.items() if n and name not in names]
        if lost:
            raise LabelError(f"{lost[0]!r} is painted on the map and must stay a class: {names}")
        # The entry after the last is looked up by -1, "not painted".
        to = [names.index(name) if name in names else -1 for name in self.classes]
        return replace(
            self, labels=np.array([*to, -1], np.int16)[self.labels], classes=tuple(names)
        )

    def _number(self, name: str) -> int:
        if name not in self.classes:
            raise LabelError(f"{name!r} is not among the classes {', '.join(self.classes)}")
        return self.classes.index(name)


def _ring(ring: NDArray[np.int32], grid: OccupancyGrid) -> list[list[float]]:
    # Corner (row, column) of the raster is half a cell below and left of the cell's centre.
    points = grid.cell_centres_m(ring - 0.5)
    return [[round(x, _DIGITS), round(y, _DIGITS)] for x, y in points.tolist()]
