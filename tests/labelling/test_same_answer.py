"""A map has the same labels, places and ids, whichever command labels it."""

import shutil
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import label_map, load_labels, load_topology
from pgm_places.batch.map_task import LabelledRow, MapTask, label_one
from pgm_places.io.maps.map_server import MapFile, load_map, save_map
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions, ModelOptions
from pgm_places.labelling.places import places_of
from pgm_places.persistence.stored import save
from pgm_places.simulation import generate_building
from pgm_places.spaces.entered_options import EnteredOptions
from pgm_places.studio.exports import write_export
from pgm_places.studio.session import MapSession
from pgm_places.topology.rules import TopologyOptions
from pgm_places.topology.topological_map import TopologicalMap
from tests.cli.conftest import Run, run
from tests.io.logs.bag_files import BagFile
from tests.quick_labeler import places
from tests.real_data import real_data_folder

__all__ = ["run"]

OF_ROBOTS = (
    "corridor_piso5",
    "corridor_team6",
    "home_envinav",
    "home_ex2",
    "hospital_aws",
    "lab_dduro",
    "lab_kefmur",
    "lab_nursing",
    "lab_urjc",
)
"""Small maps of robots with rays through windows; two are not of the model's resolution."""


@dataclass(frozen=True, eq=False)
class Answer:
    """The labels of a map, where a command writes them, and its places."""

    labels: NDArray[np.int16] | None
    topology: TopologicalMap

    def check_same(self, other: "Answer") -> None:
        if other.labels is not None:
            np.testing.assert_array_equal(other.labels, self.labels)
        np.testing.assert_array_equal(other.topology.region, self.topology.region)
        mine, others = (
            [(place.id, place.name, place.label) for place in found.regions]
            for found in (self.topology, other.topology)
        )
        assert others == mine
        assert other.topology.graph.edges == self.topology.graph.edges


@dataclass(frozen=True, eq=False)
class Commands:
    """The commands on one map and model; each writes into a folder of its own."""

    run: Run
    map: MapFile
    model: str
    folder: Path

    @property
    def loaded(self) -> LoadedModel:
        return _loaded(self.model)

    @property
    def names(self) -> tuple[str, ...]:
        return self.loaded.labeler.label_names_

    def command(self, name: str, *arguments: object) -> None:
        code, _, error = self.run(name, *arguments, "-q")
        assert code == 0, error

    def answer(self, out: Path) -> Answer:
        path, labels = out / "labels.png", None
        if path.exists():
            labels = load_labels(path, self.names, grid=self.map.grid)
        return Answer(labels, load_topology(out))

    def label(self, *options: object) -> Answer:
        out = self.folder / "label"
        self.command("label", self.map.yaml_path, "-m", self.model, "-o", out, *options)
        return self.answer(out)

    def batch(self) -> Answer:
        options, out = LabelOptions(model=self.model), self.folder / "batch"
        task = MapTask("map", self.map.yaml_path, out, options, self.loaded.sha256)
        assert isinstance(label_one(task), LabelledRow)
        return self.answer(out)

    def python(self) -> Answer:
        model = self.loaded
        found = label_map(model.labeler, self.map.grid, entered=model.entered)
        return Answer(found.labels, places_of(found.cells, model.rules))

    def topology(self) -> Answer:
        labels, out = self.folder / "label" / "labels.png", self.folder / "topology"
        self.command("topology", labels, self.map.yaml_path, "-o", out)
        return self.answer(out)

    def live(self, at: tuple[float, float]) -> Answer:
        bag, out = BagFile(), self.folder / "live"
        bag.map(1.0, self.map.grid)
        for second in (2, 3):
            bag.transform(second, "map", "laser", at[0], y=at[1])
            bag.scan(second, [1.0, 1.0, 1.0])
        log = bag.write(self.folder / "bag")
        self.command("live", "--replay", log, "-m", self.model, "-o", out, "--force")
        return self.answer(out)

    def studio(self, desk: MapSession, name: str) -> Answer:
        while desk.relabelling is None or desk.relabelling.revision < desk.painting.revision:
            assert not desk.learner.state.problem and desk.learner.is_alive  # however slow it is
            time.sleep(0.02)
        for what in ("labels", "places"):
            write_export(desk, what)
        return self.answer(shutil.copytree(desk.folder, self.folder / name))


@cache
def _loaded(model: str) -> LoadedModel:
    return LoadedModel.load(ModelOptions(model=model))


def check_all(commands: Commands) -> None:
    answer = commands.label()
    assert answer.topology.regions and answer.labels is not None
    largest = max(answer.topology.regions, key=lambda place: place.area_m2)
    for other in (
        commands.batch(),
        commands.python(),
        commands.topology(),
        commands.live(largest.anchor_m),
    ):
        answer.check_same(other)

    desk = MapSession(
        commands.map, commands.folder / "studio", commands.loaded, model=commands.model
    )
    try:
        desk.start()
        answer.check_same(commands.studio(desk, "unpainted"))
        [[row, column]] = commands.map.grid.cells_at_m([largest.anchor_m]).tolist()
        label = (commands.names.index(largest.label) + 1) % 2
        corners = [[column - 6, row - 6], [column + 7, row + 7]]
        stroke = {"tool": "rectangle", "points": corners, "radius": 1}
        desk.edit({"kind": "stroke", "label": label, "stroke": stroke})
        painted = commands.studio(desk, "painted")
        write_export(desk, "corrections")
    finally:
        desk.close()
    # Into the same folder: places keep their ids, as they do in the studio.
    corrections = desk.folder / "corrections.png"
    commands.label("--corrections", corrections).check_same(painted)
    assert painted.labels is not None and painted.labels[row, column] == label


def test_every_command_labels_a_generated_map_alike(run: Run, tmp_path: Path) -> None:
    save_map(generate_building(5, size="small", resolution_m=0.1).grid, tmp_path / "map")
    rules = TopologyOptions(min_width_m=0.3, min_area_m2=1.5, min_clearance_m=0.25)
    entered = EnteredOptions(disc_radius_m=0.25)
    options = {name: vars(item) for name, item in (("topology", rules), ("entered", entered))}
    model = save(places(), tmp_path / "model", record={"config": options})
    assert _loaded(str(model)).rules == rules and _loaded(str(model)).entered == entered
    check_all(Commands(run, load_map(tmp_path / "map.yaml"), str(model), tmp_path))


@pytest.mark.real_data
@pytest.mark.parametrize("name", OF_ROBOTS)
def test_every_command_labels_a_map_of_a_robot_alike(name: str, run: Run, tmp_path: Path) -> None:
    found = load_map(real_data_folder("robots") / name / "map.yaml")
    # Networks take most of the time; two of the maps are labelled with them.
    model = "default" if name in ("corridor_team6", "lab_dduro") else "generated"
    check_all(Commands(run, found, model, tmp_path))


@pytest.mark.real_data
def test_every_command_labels_building_79_alike(run: Run, tmp_path: Path) -> None:
    found = load_map(real_data_folder("freiburg079") / "map.yaml")
    check_all(Commands(run, found, "default", tmp_path))
