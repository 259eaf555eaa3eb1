"""index.html of a labelled map: what it shows, and one area for each place in every file."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgm_places.io.places.topology_files import load_topology
from pgm_places.io.staging import file_names
from pgm_places.labelling.files import output_file_names
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.pictures.map_page import MapPage
from pgm_places.topology.from_labels import topological_map
from tests.cli.conftest import Run, building, run
from tests.topology.floors import gated_floor_map

__all__ = ["building", "run"]


def page_of(**values: object) -> str:
    found = gated_floor_map()
    options = {"title": "floor", "names": output_file_names(found.label_names), **values}
    return MapPage(found.grid, found, **options).content().decode("utf-8")  # type: ignore[arg-type]


def test_a_page_names_every_place_and_holds_its_picture() -> None:
    text = page_of()
    for region in gated_floor_map().regions:
        assert f">{region.name}</th>" in text
    assert 'src="data:image/png;base64,' in text and "<script" not in text
    assert 'src="data:' not in page_of(picture=False)


def test_a_page_has_the_position_of_each_place() -> None:
    text = page_of()
    for region in gated_floor_map().regions:
        x, y = region.anchor_m
        assert f"<td>{x:.2f}, {y:.2f}</td>" in text


def test_many_neighbours_are_folded() -> None:
    """A corridor with seven doors."""
    names = ("corridor", "room")
    labels = np.full((12, 7 * 10), 0)
    labels[6:] = 1
    labels[6:, ::10] = -1
    grid = OccupancyGrid(np.where(labels < 0, 100, 0).astype(np.int8), 0.2)
    found = topological_map(grid, labels, names)
    [corridor] = [region for region in found.regions if region.label == "corridor"]
    assert len(found.neighbours(corridor.id)) == 7
    text = MapPage(grid, found, title="floor", names=()).content().decode()
    rooms = ", ".join(region.name for region in found.neighbours(corridor.id))
    assert f"<details><summary>7 places</summary>{rooms}</details>" in text
    assert text.count("<details>") == 1


def test_free_space_in_no_place_has_its_own_area() -> None:
    """A speck that corrections dropped has a label in labels.png, but no place."""
    found = gated_floor_map()
    dropped = found.regions[0]
    region = np.where(found.region == dropped.id, 0, found.region)
    others = tuple(
        item for item in found.connections if dropped.id not in (item.first, item.second)
    )
    without = replace(found, region=region, regions=found.regions[1:], connections=others)
    before = (found.grid.free & (found.region == 0)).sum() * found.grid.resolution_m**2
    text = MapPage(found.grid, without, title="floor", names=()).content().decode()
    area = f"{before + dropped.area_m2:.1f} m²: unreachable, or specks apart from all places"
    assert re.search(f"free, in no place.*{area}", text)
    assert "free, unlabelled" not in text


def test_names_are_text_and_not_markup() -> None:
    found = gated_floor_map()
    named = replace(
        found, regions=(replace(found.regions[0], name="<b>&kitchen"), *found.regions[1:])
    )
    text = MapPage(found.grid, named, title="<i>", names=(), warnings=("<u>",)).content().decode()
    assert "&lt;b&gt;&amp;kitchen</th>" in text
    assert not {"<i>", "<u>", "<b>&kitchen"} & set(re.findall("<[^>]*>[^<]*", text))


def test_only_files_of_the_folder_are_listed() -> None:
    links = set(re.findall(r'<dt><a href="([^"]*)"', page_of(names=("labels.png", "details/a"))))
    assert links == {"labels.png", "details/"}


@pytest.fixture
def labelled(building: Path, run: Run) -> Path:
    assert run("train", building / "config.toml", "-o", building / "model", "-q")[0] == 0
    out = building / "labelled"
    code, text, error = run(
        "label", building / "map.yaml", "-m", building / "model", "-o", out, "-q"
    )
    assert code == 0, error
    (building / "said.txt").write_text(text)
    return out


def test_a_place_has_one_area_in_every_file_and_message(labelled: Path) -> None:
    topology = load_topology(labelled)
    areas = {region.id: region.area_m2 for region in topology.regions}
    with (labelled / "check.csv").open(newline="") as file:
        listed = {int(row["id"]): float(row["area_m2"]) for row in csv.DictReader(file)}
    assert listed == pytest.approx(areas, abs=1e-3)
    features = json.loads((labelled / "regions.geojson").read_text())["features"]
    drawn = {item["id"]: item["properties"]["area_m2"] for item in features}
    assert drawn == pytest.approx(areas, abs=1e-5)
    cell_m2 = topology.grid.resolution_m**2
    for region in topology.regions:
        assert len(topology.cells(region.id)) * cell_m2 == pytest.approx(region.area_m2)
    summary = json.loads((labelled / "details/summary.json").read_text())["area_m2"]
    assert summary == pytest.approx(topology.area_m2)
    said = (labelled.parent / "said.txt").read_text()
    page = (labelled / "index.html").read_text()
    for label, area in topology.area_m2.items():
        assert area
        assert f"{label} {area:.1f} m²" in said
        assert f'{label}&ensp;<span class="muted">{area:.1f} m²' in page
    for region in topology.regions:
        shown = f"{region.area_m2:.1f}" if region.area_m2 >= 1 else f"{region.area_m2:.2f}"
        assert re.search(
            rf">{region.name}</th>.*?<td>{region.id}</td><td>{re.escape(shown)}</td>", page
        )


def test_the_files_that_the_page_links_to_are_there(labelled: Path) -> None:
    page = (labelled / "index.html").read_text()
    links = re.findall(r'href="([^"#]+)"', page)
    assert {"labels.png", "places.json", "details/"} <= set(links)
    assert all((labelled / link).exists() for link in links)
    listed = {name.split("/")[0] for name in file_names(labelled)} - {".pgm-places.json"}
    assert listed == {link.rstrip("/") for link in links} | {"index.html"}
