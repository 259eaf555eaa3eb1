"""Repeatability: the labels of several maps of one floor: ``python -m experiments.repeat FOLDER``.

FOLDER holds the maps (``*.yaml``), such as DATA/repeat/open_office. Each is labelled by the shipped
model, registered to the map with the largest free area by its walls, and compared with every other
map: the share of the cells labelled in both that have the same label. Pairs count where 60 % of the
walls of each meet walls of the other within 0.25 m, and where 60 % of the smaller free area is free
in both. No ground truth is needed. ``--kept FOLDER`` keeps labels and transforms.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.signal import fftconvolve

from pgm_places import label_map, load_map, trained_labeler
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

NAMES = ("corridor", "room", "doorway")
MEET_M, LEAST_SHARE = 0.25, 0.6
COARSE = (0.4, np.arange(0.0, 360.0, 3.0))
FINER = ((0.2, np.arange(-3.0, 3.01, 0.5)), (0.1, np.arange(-0.5, 0.51, 0.25)))
"""Cells in metres and turns in degrees, around the best one so far, that are tried one by one."""

FREE_WEIGHT = 0.1
"""What a free cell on a free cell counts, against a wall on a wall."""


@dataclass(frozen=True)
class Transform:
    """Turns points of a map by an angle, then shifts them into the frame of another map."""

    degrees: float = 0.0
    shift_m: tuple[float, float] = (0.0, 0.0)

    def of(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 2) in the other frame."""
        return np.asarray(points_m @ self._turn.T + self.shift_m)

    def back(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 2) of the other frame in this one."""
        return np.asarray((points_m - self.shift_m) @ self._turn)

    @property
    def _turn(self) -> NDArray[np.float64]:
        cosine, sine = np.cos(np.radians(self.degrees)), np.sin(np.radians(self.degrees))
        return np.array([[cosine, -sine], [sine, cosine]])


def registered(reference: OccupancyGrid, other: OccupancyGrid) -> Transform:
    """The transform that lays the walls of a map on those of another one."""
    best = _best(reference, other, *COARSE)
    for cell_m, turns in FINER:
        best = _best(reference, other, cell_m, best.degrees + turns)
    return best


def _best(
    reference: OccupancyGrid, other: OccupancyGrid, cell_m: float, turns: NDArray[np.float64]
) -> Transform:
    """The best of some turns, each with its best shift, by correlation of blurred rasters."""
    target, origin = _raster(*_points(reference), cell_m)
    scores = []
    for degrees in turns.tolist():
        turned = Transform(degrees)
        occupied, free = (turned.of(points) for points in _points(other))
        image, corner = _raster(occupied, free, cell_m)
        fit = fftconvolve(target, image[::-1, ::-1], mode="full")
        at = np.array(np.unravel_index(int(fit.argmax()), fit.shape)) - image.shape + 1
        x, y = (origin + cell_m * at[::-1] - corner).tolist()
        scores.append((float(fit.max()), Transform(degrees, (x, y))))
    return max(scores, key=lambda item: item[0])[1]


def _points(grid: OccupancyGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres of occupied and of free cells."""
    occupied, free = (
        grid.cell_centres_m(np.argwhere(grid.cells == value)) for value in (OCCUPIED, FREE)
    )
    return occupied, free


def _raster(
    occupied: NDArray[np.float64], free: NDArray[np.float64], cell_m: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Blurred walls and free space, rows along y, and the lower left corner."""
    both = np.concatenate([occupied, free])
    corner = np.floor(both.min(axis=0) / cell_m) * cell_m
    size = np.floor((both.max(axis=0) - corner) / cell_m).astype(np.int64) + 1
    walls, inside = np.zeros((2, size[1], size[0]))
    for raster, points in ((walls, occupied), (inside, free)):
        column, row = np.floor((points - corner) / cell_m).astype(np.int64).T
        raster[row, column] = 1.0
    return gaussian_filter(walls, 1.0) + FREE_WEIGHT * inside, corner


@dataclass(frozen=True, eq=False)
class OnReference:
    """A map on the cells of the reference map: labels (-1 for none), walls, free space."""

    name: str
    label: NDArray[np.int64]
    wall: NDArray[np.bool_]
    free: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        name: str,
        grid: OccupancyGrid,
        labels: NDArray[np.int64],
        reference: OccupancyGrid,
        transform: Transform,
    ) -> "OnReference":
        """The map, laid on the cells of the reference."""
        rows, columns = np.indices(reference.shape)
        centres = reference.cell_centres_m(np.stack([rows.ravel(), columns.ravel()], axis=1))
        cells = grid.cells_at_m(transform.back(centres))
        inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
        found = []
        for raster, outside in ((labels, -1), (grid.cells == OCCUPIED, 0), (grid.free, 0)):
            values = np.full(len(cells), outside, raster.dtype)
            values[inside] = raster[tuple(cells[inside].T)]
            found.append(values.reshape(reference.shape))
        return cls(name, *found)


def pairs(
    maps: list[OnReference], resolution_m: float
) -> Iterator[tuple[str, str, float, float, float]]:
    """Of each pair: names, share of walls that meet, of free space shared, of labels alike."""
    away = {item.name: distance_transform_edt(~item.wall) * resolution_m for item in maps}
    for one, other in combinations(maps, 2):
        meet = min(
            float((away[first.name][second.wall] <= MEET_M).mean())
            for first, second in ((one, other), (other, one))
        )
        shared = (one.free & other.free).sum() / max(min(one.free.sum(), other.free.sum()), 1)
        both = (one.label >= 0) & (other.label >= 0)
        yield (
            one.name,
            other.name,
            meet,
            float(shared),
            float((one.label == other.label)[both].mean()) if both.any() else float("nan"),
        )


def main(argv: list[str] | None = None) -> None:
    """Print the areas of each map, the agreement of each pair, and the means."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.repeat", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("maps", type=Path, metavar="FOLDER")
    parser.add_argument("--kept", type=Path, help="folder for labels and transforms")
    arguments = parser.parse_args(argv)
    labeler = trained_labeler()
    grids = {path.stem: load_map(path).grid for path in sorted(arguments.maps.glob("*.yaml"))}
    reference = max(grids, key=lambda name: int(grids[name].free.sum()))
    maps, corridor_m2 = [], []
    for name, grid in grids.items():
        kept = None if arguments.kept is None else arguments.kept / f"{name}.npz"
        if kept is not None and kept.exists():
            with np.load(kept) as file:
                degrees, x, y = file["turn"].tolist()
                labels, turn = file["labels"], Transform(degrees, (x, y))
        else:
            labels = label_map(labeler, grid).labels
            turn = Transform() if name == reference else registered(grids[reference], grid)
            if kept is not None:
                kept.parent.mkdir(parents=True, exist_ok=True)
                np.savez_compressed(kept, labels=labels, turn=[turn.degrees, *turn.shift_m])
        area_m2 = [float((labels == k).sum()) * grid.resolution_m**2 for k in range(len(NAMES))]
        corridor_m2.append(area_m2[0])
        print(
            name,
            ", ".join(f"{k} {m2:.0f} m2" for k, m2 in zip(NAMES, area_m2, strict=True)),
            flush=True,
        )
        maps.append(OnReference.of(name, grid, labels, grids[reference], turn))
    alike = []
    for one, other, meet, shared, share in pairs(maps, grids[reference].resolution_m):
        counts = min(meet, shared) >= LEAST_SHARE
        alike += [share] if counts else []
        note = "" if counts else " (does not count)"
        print(f"{one} {other}: walls {meet:.2f}, free {shared:.2f}, labels {share:.3f}{note}")
    print(
        f"corridor: {min(corridor_m2):.0f} to {max(corridor_m2):.0f} m2, standard deviation "
        f"{np.std(corridor_m2):.0f}"
    )
    if alike:
        print(f"{len(alike)} pairs: mean {np.mean(alike):.3f}, least {min(alike):.3f}")


if __name__ == "__main__":
    main()
