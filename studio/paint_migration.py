"""Migrating paint to a changed map."""

import os
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pgm_places.errors import InputError, OutputError
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.io.staging import as_output_errors
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, overlap, shifted
from pgm_places.studio.journal import Journal, subject_of
from pgm_places.studio.painting import Classes, Painting
from pgm_places.studio.runs import runs_of_mask

JOURNAL = "journal.jsonl"

LEAST_SAME = 0.9
"""Share of known cells that must be equal on both maps for paint to be migrated."""

MOST_SEARCHED = 50_000_000
"""Cells of the largest map in which a shift is searched; in larger ones only origins count."""


@dataclass(frozen=True)
class Migration:
    """Numbers of painted cells migrated from an earlier state of the map and lost; its journal."""

    migrated: int
    lost: int
    journal: Path

    @property
    def message(self) -> str:
        """The message to the user."""
        no_longer = "is" if self.lost == 1 else "are"
        lost = f", {self.lost} {no_longer} no longer free" if self.lost else ""
        return (
            f"The map has changed since it was painted. {self.migrated} painted cells were carried "
            f"over{lost}; the history up to then is in {self.journal.name}."
        )


def opened_painting(
    folder: Path, grid: OccupancyGrid, classes: Classes, map_sha256: str
) -> tuple[Painting, Migration | None]:
    """The painting of a map in a folder, and the migration from an earlier state of the map."""
    path, migration = folder / JOURNAL, None
    earlier = subject_of(path)
    if earlier is not None:
        saved_map = _saved_map(folder, str(earlier.get("map")))
        if earlier.get("map") != map_sha256 or not _has_frame(saved_map, grid):
            migration = _migrated(path, saved_map, grid, classes, map_sha256)
    journal = Journal(path, {"map": map_sha256})
    try:
        if migration is not None or not _saved_map(folder, map_sha256).exists():
            save_map(grid, _saved_map(folder, map_sha256).with_suffix(""))
        return Painting(grid, classes, journal), migration
    except BaseException:
        journal.close()
        raise


def _saved_map(folder: Path, map_sha256: str) -> Path:
    """The file with the raster that a journal belongs to."""
    return folder / f"map-{map_sha256[:12]}.yaml"


def _has_frame(saved_map: Path, grid: OccupancyGrid) -> bool:
    """Whether the saved raster has the map's origin and rotation; True if none is saved."""
    return not saved_map.exists() or load_map(saved_map).grid.frame == grid.frame


def _migrated(
    path: Path, saved_map: Path, grid: OccupancyGrid, classes: Classes, map_sha256: str
) -> Migration:
    """Replace the journal at ``path`` by one that begins with its paint."""
    if not saved_map.exists():
        raise InputError(
            f"{path} belongs to another map, whose raster was not saved; choose "
            "another folder with --out, and give exported paint with --corrections"
        )
    before = load_map(saved_map).grid
    is_same = np.array_equal(before.cells, grid.cells)  # with another origin, perhaps rotated
    shift = (0, 0) if is_same else map_shift(before, grid)
    if shift is None:
        raise InputError(
            f"{path} belongs to another map: less than {100 * LEAST_SAME:.0f} % of the cells agree "
            "at any shift; choose another folder with --out"
        )
    with closing(Journal(path, subject_of(path) or {})) as journal:
        old = Painting(before, classes, journal)
        staged = path.with_name(f".{path.name}.new")
        staged.unlink(missing_ok=True)
        with closing(Journal(staged, {"map": map_sha256})) as fresh:
            migrated, lost = _repaint(old, Painting(grid, classes, fresh), shift)
        aside = _free_name(path)
        with as_output_errors(path):
            os.link(path, aside)
            staged.replace(path)
    return Migration(migrated, lost, aside)


def _free_name(path: Path) -> Path:
    numbered = (path.with_name(f"{path.stem}-{k}{path.suffix}") for k in range(1, 10_000))
    free_name = next((name for name in numbered if not name.exists()), None)
    if free_name is None:
        raise OutputError(f"{path.parent} holds 9999 earlier journals; move some away")
    return free_name


def _repaint(old: Painting, new: Painting, shift: tuple[int, int]) -> tuple[int, int]:
    """Migrate paint, classes and names to the new map; numbers of cells migrated and lost."""
    for index, place_class in enumerate(old.classes.items):
        if index >= len(new.classes) or new.classes.items[index] != place_class:
            new.set_class(index, place_class.name, place_class.colour)
    labels = shifted(old.labels, shift, new.grid.shape, -1)
    was_painted = int((old.labels >= 0).sum())
    labels[~new.grid.free] = -1
    for label in np.unique(labels[labels >= 0]).tolist():
        new.paint_runs(runs_of_mask(labels == label), label)
    for point, name in old.names.items():
        row, column = (old.grid.cells_at_m([point])[0] + shift).tolist()
        [[x, y]] = new.grid.cell_centres_m([[row, column]]).tolist()
        new.rename((x, y), name, [])
    ends_m = np.reshape(old.cuts, (-1, 2))
    moved = new.grid.cell_centres_m(old.grid.points_at_m(ends_m)[:, ::-1] - 0.5 + shift)
    pairs = moved.reshape(-1, 2, 2).tolist()
    new.set_cuts(tuple(((x0, y0), (x1, y1)) for (x0, y0), (x1, y1) in pairs))
    new.set_learning(old.learns)
    migrated = new.n_painted
    return migrated, was_painted - migrated


def map_shift(before: OccupancyGrid, after: OccupancyGrid) -> tuple[int, int] | None:
    """The shift of a map's cells in rows and columns; None if it is a different map.

    The shift of the origins is tried first, then no shift, then every shift.

    Examples
    --------
    >>> cells = np.zeros((6, 8), np.int8)
    >>> cells[2, 3:] = 100
    >>> grown = np.full((9, 10), -1, np.int8)
    >>> grown[3:, 1:9] = cells
    >>> map_shift(OccupancyGrid(cells, 0.1), OccupancyGrid(grown, 0.1))
    (3, 1)
    """
    same_size = np.isclose(before.resolution_m, after.resolution_m, rtol=1e-6, atol=0)
    if not same_size or not np.isclose(before.yaw_rad, after.yaw_rad, rtol=0, atol=1e-9):
        return None
    [[row, column]] = after.cells_at_m(before.cell_centres_m([[0, 0]])).tolist()
    for shift in ((row, column), (0, 0)):
        if _same(before, after, shift) >= LEAST_SAME:
            return shift
    if before.cells.size + after.cells.size > MOST_SEARCHED:
        return None
    found = _best_shift(before, after)
    return found if _same(before, after, found) >= LEAST_SAME else None


def _same(before: OccupancyGrid, after: OccupancyGrid, shift: tuple[int, int]) -> float:
    """The share of the cells known before that are equal after a shift."""
    here, there = overlap(shift, before.shape, after.shape)
    one, other = before.cells[here], after.cells[there]
    known = int((before.cells != UNKNOWN).sum())
    return float(((one == other) & (one != UNKNOWN)).sum()) / max(known, 1)


def _best_shift(before: OccupancyGrid, after: OccupancyGrid) -> tuple[int, int]:
    """The shift at which most walls lie on walls and most free cells on free ones."""
    from scipy import fft

    shape = tuple(
        fft.next_fast_len(a + b, real=True) for a, b in zip(before.shape, after.shape, strict=True)
    )
    total = np.zeros(shape, np.float32)
    for value in (FREE, OCCUPIED):
        one, other = (
            fft.rfft2((g.cells == value).astype(np.float32), shape) for g in (before, after)
        )
        total += fft.irfft2(np.conj(one) * other, shape)
    row, column = divmod(int(total.argmax()), shape[1])
    # Shifts down and to the left wrap around to the far ends.
    row -= shape[0] if row >= after.shape[0] else 0
    column -= shape[1] if column >= after.shape[1] else 0
    return row, column
