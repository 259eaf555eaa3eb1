"""Exports of the studio as the command line reads them."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pgm_places.cli.entry import main
from pgm_places.errors import InputError
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.labelling.model import LoadedModel
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.persistence.stored import read
from pgm_places.simulation import generate_building
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.studio.exports import write_export
from pgm_places.studio.session import MapSession
from pgm_places.topology.rules import TopologyOptions
from pgm_places.trained import trained_labeler
from tests.studio.conftest import rectangle, two_rooms, wait


def run(*arguments: object) -> None:
    """The command line in this process; it must succeed."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as ended:
        patch.setattr(sys, "argv", ["pgm-places", *map(str, arguments), "--quiet"])
        main()
    assert ended.value.code in (None, 0)


def paint(session: MapSession, label: int, *corners: tuple[int, int]) -> None:
    session.edit(rectangle(label, *corners))


def building_map(folder: Path) -> OccupancyGrid:
    """A small building of coarse cells, with its unknown cells in a grey that is read as free."""
    grid = generate_building(3, size="small", resolution_m=0.1).grid
    save_map(grid, folder / "rooms")
    text = (folder / "rooms.yaml").read_text()
    (folder / "rooms.yaml").write_text(text.replace("free_thresh: 0.196", "free_thresh: 0.25"))
    assert "0.25" in (folder / "rooms.yaml").read_text()
    return grid


@pytest.mark.parametrize("model", ["none", "generated"])
def test_the_training_configuration_gives_the_labels_of_the_studio(
    model: str, tmp_path: Path
) -> None:
    if model == "none":
        save_map(two_rooms(), tmp_path / "rooms")
        labeler, unknown_value = None, None
        painted = [(0, (6, 6), (24, 24)), (1, (27, 6), (45, 24)), (2, (25, 13), (26, 17))]
    else:
        grid = building_map(tmp_path)
        labeler, unknown_value = trained_labeler(model), 205
        rows, columns = np.nonzero(grid.free)
        x, y = int(columns[len(columns) // 2]), int(rows[len(rows) // 2])
        painted = [(1, (x, y), (x + 12, y + 12)), (3, (5, 5), (40, 40))]
    map_yaml, folder = tmp_path / "rooms.yaml", tmp_path / "kept"
    source = load_map(map_yaml, unknown_value=unknown_value)
    rules = TopologyOptions() if labeler is None else TopologyOptions(min_area_m2=0.5)
    entered = EnteredOptions() if labeler is None else EnteredOptions(disc_radius_m=0.25)
    loaded = None if labeler is None else LoadedModel(labeler, rules=rules, entered=entered)
    session = MapSession(source, folder, loaded, model=model)
    try:
        if model != "none":
            session.edit({"kind": "class", "index": 3, "name": "lab", "colour": "#6d6108"})
        session.start()
        for label, *corners in painted:
            paint(session, label, *corners)
        wait(session, session.painting.revision)
        assert session.taught is not None
        for what in ("training", "model", "labels"):
            write_export(session, what)
        own, names = session.taught.labels, session.taught.label_names
        assert (own != session.taught.paint.labels).any()
    finally:
        session.close()

    trained, labelled = tmp_path / "trained", tmp_path / "labelled"
    run("train", folder / "train.toml", "--out", trained)
    arrays = [(place / "arrays.safetensors").read_bytes() for place in (folder / "model", trained)]
    assert arrays[0] == arrays[1]
    known = ("--corrections", folder / "corrections.png")
    unknown = () if unknown_value is None else ("--unknown-value", unknown_value)
    run("label", map_yaml, "--model", trained, "--out", labelled, *known, *unknown)
    found = load_labels(labelled / "labels.png", names, grid=source.grid)
    np.testing.assert_array_equal(found, own)
    for stored in (read(trained), read(folder / "model")):
        assert (stored.rules, stored.entered) == (rules, entered)


def test_one_class_is_too_little_to_train_without_a_model(session: MapSession) -> None:
    paint(session, 0, (6, 6), (24, 24))
    with pytest.raises(InputError, match="paint at least two classes"):
        write_export(session, "training")
