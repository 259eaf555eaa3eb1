"""Paint that is carried over to a map that has changed, and paint that a file brings."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places.errors import InputError
from pgm_places.io.maps.map_server import save_map
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.studio.paint_migration import map_shift
from pgm_places.studio.session import MapSession
from pgm_places.teaching.paint import Paint
from tests.studio.conftest import two_rooms

Reopen = Callable[[], MapSession]


def painted_session(open_session: Reopen) -> MapSession:
    """A session with a painted room, a class of its own and a named place."""
    session = open_session()
    session.edit({"kind": "class", "index": 3, "name": "lab", "colour": "#112233"})
    corners = [[6, 6], [24, 24]]
    stroke = {"tool": "rectangle", "points": corners, "radius": 1}
    session.edit({"kind": "stroke", "label": 3, "stroke": stroke})
    [[x, y]] = session.grid.cell_centres_m([[10, 10]]).tolist()
    session.painting.rename((x, y), "kitchen", [])
    session.close()
    return session


def grown(grid: OccupancyGrid, rows: int, columns: int, *, says_so: bool) -> OccupancyGrid:
    """The map with unknown space below and to the left; the origin may say so."""
    cells = np.pad(grid.cells, ((rows, 3), (columns, 5)), constant_values=UNKNOWN)
    x, y = grid.origin_xy_m
    side = grid.resolution_m
    origin = (x - columns * side, y - rows * side) if says_so else (x, y)
    return OccupancyGrid(cells, side, origin)


def test_a_pixel_that_changed_costs_the_paint_of_that_cell(
    open_session: Reopen, map_yaml: Path
) -> None:
    before = painted_session(open_session).painting
    cells = two_rooms().cells.copy()
    cells[10, 12] = OCCUPIED
    save_map(two_rooms().with_cells(cells), map_yaml.with_suffix(""))
    session = open_session()
    expected = before.labels.copy()
    expected[10, 12] = -1
    assert (session.painting.labels == expected).all()
    assert session.painting.classes == before.classes
    assert session.painting.names == pytest.approx(before.names)
    assert session.migration is not None
    assert session.migration.message == (
        "The map has changed since it was painted. 323 painted cells were carried over, 1 is no "
        "longer free; the history up to then is in journal-1.jsonl."
    )
    session.close()
    assert open_session().migration is None  # it is that map's paint now


@pytest.mark.parametrize("says_so", [True, False])
def test_paint_moves_with_a_map_that_has_grown(
    open_session: Reopen, map_yaml: Path, says_so: bool
) -> None:
    before = painted_session(open_session).painting
    larger = grown(two_rooms(), 7, 4, says_so=says_so)
    save_map(larger, map_yaml.with_suffix(""))
    session = open_session()
    assert (session.painting.labels[7:37, 4:54] == before.labels).all()
    assert session.painting.n_painted == before.n_painted
    [point] = session.painting.names
    assert larger.cells_at_m([point]).tolist() == [[17, 14]]


def test_another_map_is_refused_and_its_paint_stays(open_session: Reopen, map_yaml: Path) -> None:
    painted_session(open_session)
    journal = map_yaml.parent / "kept" / "journal.jsonl"
    before = journal.read_bytes()
    save_map(OccupancyGrid(np.full((30, 50), FREE, np.int8), 0.2), map_yaml.with_suffix(""))
    with pytest.raises(InputError, match=r"less than 90 % of the cells agree"):
        open_session()
    assert journal.read_bytes() == before
    save_map(two_rooms(), map_yaml.with_suffix(""))
    assert open_session().painting.n_painted == 18 * 18


def test_a_journal_from_before_maps_were_kept_is_refused_in_words(
    open_session: Reopen, map_yaml: Path
) -> None:
    painted_session(open_session)
    for path in (map_yaml.parent / "kept").glob("map-*"):
        path.unlink()
    save_map(grown(two_rooms(), 1, 1, says_so=True), map_yaml.with_suffix(""))
    with pytest.raises(InputError, match=r"exported paint with --corrections$"):
        open_session()


@settings(max_examples=40, deadline=None)
@given(st.integers(-9, 9), st.integers(-12, 12), st.booleans())
def test_a_shift_is_found_whether_or_not_the_origin_tells(
    rows: int, columns: int, says_so: bool
) -> None:
    grid = two_rooms()
    cells = np.full((60, 90), UNKNOWN, np.int8)
    cells[15 + rows : 45 + rows, 20 + columns : 70 + columns] = grid.cells
    shift = (15 + rows, 20 + columns)
    x, y = grid.origin_xy_m
    origin = (x - shift[1] * 0.2, y - shift[0] * 0.2) if says_so else (0.0, 0.0)
    assert map_shift(grid, OccupancyGrid(cells, 0.2, origin)) == shift
    assert map_shift(grid, OccupancyGrid(cells, 0.1, origin)) is None


@pytest.mark.parametrize("name", ["corrections.png", "corrections.geojson"])
def test_what_was_exported_is_read_and_newer_paint_stays(
    session: MapSession, open_session: Reopen, name: str
) -> None:
    labels = np.full(session.grid.shape, -1, np.int16)
    labels[6:10, 6:10], labels[6:10, 30:34] = 1, 0
    path = Paint(labels, ("lab", "room")).save(session.folder / name, session.grid)
    stroke = {"tool": "rectangle", "points": [[6, 6], [8, 8]], "radius": 1}
    session.edit({"kind": "stroke", "label": 0, "stroke": stroke})
    assert session.take(Paint.read(path, session.grid)) == 28
    assert session.painting.classes.names == ("corridor", "room", "doorway", "lab")
    assert (session.painting.labels[6:10, 30:34] == 3).all()
    assert session.painting.labels[6, 6] == 0 and session.painting.labels[9, 9] == 1
    assert session.take(Paint.read(path, session.grid)) == 0  # as often as one likes
    session.edit({"kind": "undo"})


def test_a_cut_moves_with_a_map_that_has_grown(open_session: Reopen, map_yaml: Path) -> None:
    before = painted_session(open_session)
    session = open_session()
    ends = session.grid.cell_centres_m([[4, 15], [25, 15]]).tolist()
    session.painting.set_cuts((((ends[0][0], ends[0][1]), (ends[1][0], ends[1][1])),))
    session.close()
    larger = grown(before.grid, 7, 4, says_so=True)
    save_map(larger, map_yaml.with_suffix(""))
    [line] = open_session().painting.cuts
    assert larger.cells_at_m(line).tolist() == [[11, 19], [32, 19]]
