"""Halls that are shown as corridors: what label and topology keep of them."""

import csv
from pathlib import Path

import numpy as np
import pytest

from pgm_places import LabelledMap, trained_labeler
from pgm_places.cli.entry import main
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.places.topology_files import load_hall, load_topology
from pgm_places.labelling.label import label_map
from pgm_places.topology.place_edits import split_across
from tests.foyer import foyer_map


def call(*arguments: str) -> None:
    """Run the command line."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["pgm-places", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
    assert not ended.value.code


@pytest.fixture(scope="module")
def foyer() -> LabelledMap:
    return foyer_map()


@pytest.fixture(scope="module")
def written(foyer: LabelledMap, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The foyer, labelled with another map by the command, halls as corridors."""
    folder = tmp_path_factory.mktemp("foyer")
    map_yaml = save_map(foyer.grid, folder / "foyer")
    part = foyer.grid.with_cells(foyer.grid.cells[:150, :150])
    other = save_map(part, folder / "part")
    arguments = ["label", str(map_yaml), str(other), "--model", "generated"]
    call(*arguments, "--outputs", "probabilities", "--out", str(folder / "found"))
    return folder / "found" / "foyer"


def test_a_hall_that_is_shown_as_a_corridor_keeps_its_probability(
    foyer: LabelledMap, written: Path
) -> None:
    shown, named = (
        label_map(trained_labeler("generated").with_options(halls=halls), foyer.grid)
        for halls in ("corridor", "hall")
    )
    assert named.hall is None and shown.hall is not None
    assert named.labeling.beliefs is not None
    np.testing.assert_allclose(shown.hall, named.labeling.beliefs[:, 3], rtol=0, atol=1e-6)
    layout = shown.layout
    found = load_hall(written, shown.label_names, layout)
    assert found is not None
    np.testing.assert_allclose(found, shown.hall, rtol=0, atol=0.51 / 255)
    assert load_hall(written, named.label_names, layout) is None


def test_the_table_of_places_names_the_hall_among_the_corridors(
    foyer: LabelledMap, written: Path
) -> None:
    with (written / "check.csv").open() as file:
        rows = {int(row["id"]): row for row in csv.DictReader(file)}
    truth = foyer.labels
    topology = load_topology(written)
    by_row = {number: row["finer_label"] for number, row in rows.items()}
    large = [item for item in topology.regions if item.label != "doorway" and item.area_m2 > 4]
    assert large
    for item in large:
        cells = topology.region == item.id
        is_hall = (truth[cells] == 3).mean() > 0.5
        assert by_row[item.id] == ("hall" if is_hall else item.label)
        assert item.is_likely_hall == is_hall
        assert item.hall is not None and float(rows[item.id]["hall"]) == pytest.approx(
            item.hall, abs=1e-4
        )
    assert "hall" in by_row.values()


def test_places_found_again_and_edited_keep_the_halls(
    foyer: LabelledMap, written: Path, tmp_path: Path
) -> None:
    before = load_topology(written)
    arguments = ["topology", str(written / "labels.png"), str(written.parents[1] / "foyer.yaml")]
    call(*arguments, "--out", str(tmp_path / "again"))
    for item in load_topology(tmp_path / "again").regions:
        assert item.hall == pytest.approx(before.place(item.id).hall, abs=2 / 255)
    hall = max(before.regions, key=lambda item: item.hall or 0.0)
    left, low, right, high = hall.box_m
    x = (left + right) / 2
    parts = split_across(before, hall.id, (x, low - 1.0), (x, high + 1.0))
    new = parts.regions[-1]
    assert new.id == before.next_id and new.is_likely_hall
    assert new.hall == pytest.approx(hall.hall, abs=1e-6)
    properties = parts.to_geojson()["features"][-1]["properties"]
    assert properties["hall"] == pytest.approx(new.hall, abs=1e-6)
