"""Experiments on drives: sources, every method on steps, and steps joined with cells."""

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places.errors import ConfigError, LabelError, LogError
from pgm_places.experiment.comparison import Comparison
from pgm_places.experiment.config import ExperimentConfig, parse_config
from pgm_places.experiment.evaluated_items import EvalDrive, passage_scores
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.runs import compare, train
from pgm_places.experiment.sources import counted_objects, load_drives
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.io.logs.trajectories import write_trajectory
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.places.topology_files import save_topology
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.report.comparison_files import comparison_record
from pgm_places.report.comparison_page import report_page
from pgm_places.simulation import generate_building
from pgm_places.simulation.simulated_robot import SimulatedRobot
from pgm_places.topology.from_labels import topological_map
from pgm_places.trajectories.similarity import Similarity
from pgm_places.trajectories.trajectory import Trajectory

NAMES = ("corridor", "room", "doorway")
LASER = {"n_beams": 60, "range_m": 12.0}


def simulated(seed: int, **options: Any) -> dict[str, Any]:
    """A drive through a building of its own."""
    own = {"generated": seed + 1, "seed": seed, "length_m": 30.0, "laser": LASER}
    return {"drive": own | options}


def config(**changes: Any) -> ExperimentConfig:
    return parse_config(
        {
            "nodes": "steps",
            "resolution_m": 0.2,
            "labels": {"names": list(NAMES)},
            "classifier": {"n_rounds": 3, "n_folds": 2},
            "space": {"n_rounds": 3},
            "steps": {"every_m": 0.3, "n_runs": 20, "beams": {"missing": "known-map"}},
            "train": [simulated(0, length_m=60.0)],
            "test": [simulated(1)],
            "methods": [{"name": "independent"}],
        }
        | changes
    )


METHODS: list[dict[str, Any]] = [
    {"name": "independent"},
    {"name": "hmm", "id": "filter"},
    {"name": "hmm", "id": "viterbi", "mode": "viterbi"},
    {"name": "relaxation"},
    {"name": "potts", "weight": 0.5},
    {"name": "amn", "max_cuts": 5},
]


@lru_cache
def compared(nodes: str) -> Comparison:
    methods = METHODS if nodes == "steps" else [METHODS[0], METHODS[4]]
    return compare(Experiment(config(nodes=nodes, methods=methods), Path()))


def test_every_method_labels_the_steps_of_drives() -> None:
    found = compared("steps")
    [item] = found.maps
    assert isinstance(item, EvalDrive)
    for method in found.methods:
        [labeling] = method.labelings
        known = item.node_truth >= 0
        right = labeling.labels[known] == item.node_truth[known]
        assert method.evaluation.accuracy == pytest.approx(right.mean())
        assert right.mean() > 0.6
        low = method.intervals["accuracy"].low
        assert low <= right.mean() <= method.intervals["accuracy"].high
    assert {item.id for item in found.methods} == {m.get("id", m["name"]) for m in METHODS}


def test_results_of_drives_have_the_shape_of_those_of_maps() -> None:
    record = comparison_record(compared("steps"))
    json.dumps(record, allow_nan=False)
    [item] = record["maps"]
    assert item["steps_labelled"] >= item["steps_evaluated"] > 0
    for found in record["methods"].values():
        assert found["recall"].keys() == set(NAMES)
        assert 0 < found["balanced_accuracy"] <= 1
    assert record["config"]["nodes"] == "steps"
    page = report_page(compared("steps"))
    assert page.count("along the path, its labels and the true places") == len(METHODS)
    assert "steps evaluated" in page and "1 test drive;" in page
    assert "stretches of the path" in page


def test_steps_and_cells_are_labelled_together_and_scored_apart() -> None:
    found = compared("both")
    assert [item.unit for item in found.maps] == ["cell", "step"]
    for method in found.methods:
        parts = found.by_unit(method)
        assert sum(part.n for part in parts.values()) == method.evaluation.n
    record = comparison_record(found)["methods"]["potts"]
    steps = found.by_unit(found.methods[1])["step"]
    assert record["steps"]["accuracy"] == pytest.approx(steps.accuracy)
    assert record["cells"].keys() == record["steps"].keys()
    assert "Cells and steps apart" in report_page(found)


def test_the_same_run_twice_gives_the_same_labels() -> None:
    again = compare(Experiment(config(methods=METHODS[:2]), Path(), n_threads=1))
    for method, before in zip(again.methods, compared("steps").methods, strict=False):
        np.testing.assert_array_equal(method.labelings[0].labels, before.labelings[0].labels)


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"nodes": "cells"}, r"train\[0\] is a drive, but cells of maps are labelled"),
        ({"test": [{"generated": 1}]}, r"test\[0\] is a map, but steps of drives are labelled"),
        ({"nodes": "both", "train": [{"generated": 1}]}, "needs at least one drive"),
        (
            {
                "train": [{"generated": 1}],
                "select": {"options": {"steps.every_m": [0.1]}},
            },
            r"\[select\] evaluates options on held-out training drives; .* has no drive",
        ),
        ({"nodes": "step"}, "nodes must be 'cells', 'steps', 'both' or 'graph', got 'step'"),
        (
            {"nodes": "both", "test": [{"log": "a.log", "truth": "a.csv"}]},
            r"test\[0\]: nodes = 'both' needs the drive's map; add map",
        ),
        ({"test": [{"drive": {"generated": 1}, "truth": "t.csv"}]}, "truth does not apply to d"),
        ({"test": [{"map": "a.yaml", "labels": "l.png", "to_step": 3}]}, "to_step does not apply"),
        ({"test": [{"log": "a.log", "generated": 2}]}, "generated does not apply to log"),
        ({"test": [{"log": "a.log", "labels": "l.png"}]}, "labels and regions are .* add map"),
        (
            {"test": [{"log": "a.log", "laser": {}}]},
            "laser simulates scans in a map and requires map",
        ),
        ({"test": [{"log": "a.log", "drive": {"generated": 1}}]}, "cannot be combined"),
        (
            {"test": [{"log": "a.log", "region": [1.0, 0.0, 0.0, 1.0]}]},
            "region must be the minimum x",
        ),
        (
            {"nodes": "both", "test": [{"log": "a.log", "map": "a.yaml", "counts": "c.csv"}]},
            r"test\[0\]: counts are for nodes = 'steps'",
        ),
        ({"test": [{"log": "a.log", "counts_within_s": 2.0}]}, "counts_within_s requires counts"),
        ({"test": [{"drive": {"generated": 1}, "counts": "c.csv"}]}, "counts does not apply to d"),
        ({"steps": {"every": 0.1}}, r"unknown key 'steps.every'\. Did you mean 'every_m'"),
    ],
)
def test_sources_that_make_no_sense_are_refused_in_a_line(
    changes: dict[str, Any], wanted: str
) -> None:
    with pytest.raises(ConfigError, match=f"(?i){wanted}"):
        config(**changes)


def test_methods_for_chains_are_refused_where_cells_take_part_before_anything_is_read() -> None:
    chosen = config(nodes="both", methods=[{"name": "hmm"}])
    with pytest.raises(ConfigError, match=r"method 'hmm' \(HiddenMarkovModel\) labels only chains"):
        compare(Experiment(chosen, Path("/nowhere")))
    for nodes, wanted in (("steps", "unary is for cells"), ("both", "must have one unary")):
        methods = [{"name": "potts", "unary": "laser"}, {"name": "independent"}]
        with pytest.raises(ConfigError, match=wanted):
            train(Experiment(config(nodes=nodes, methods=methods), Path()))


def labelled_drive(truth: list[int]) -> EvalDrive:
    """A straight drive of 0.1 m a step."""
    poses = np.column_stack([0.1 * np.arange(len(truth)), np.zeros((len(truth), 2))])
    path = Trajectory(
        np.arange(len(truth), dtype=float), poses, labels=np.array(truth), label_names=NAMES
    )
    return EvalDrive("drive", path, OccupancyGrid(np.zeros((1, 1), np.int8), 0.1))


def test_doorways_passed_through_are_counted_once_each() -> None:
    truth = [0] * 10 + [2] * 5 + [1] * 10 + [2] * 5 + [0] * 10 + [-1] * 10
    early = [0] * 5 + [2] * 2 + [0] * 3 + [2] + [0] * 29 + [2] * 10  # 0.4 m early; at it; unknown
    found = passage_scores(labelled_drive(truth), Labeling(np.array(early), Status.EXACT), 2)
    assert (found.found, found.missed, found.invented) == (1, 1, 1)
    exact = Labeling(np.maximum(truth, 0), Status.EXACT)
    found = passage_scores(labelled_drive(truth), exact, 2)
    assert (found.found, found.missed, found.invented) == (2, 0, 0)
    cut = [2] * 3 + truth[3:]  # begins inside a doorway: not entered, so no passage, yet no error
    found = passage_scores(labelled_drive(cut), Labeling(np.maximum(cut, 0), Status.EXACT), 2)
    assert (found.found, found.missed, found.invented) == (2, 0, 0)
    late = [0] * 17 + [2] + [0] * 32  # 0.3 m after the last step in the doorway
    found = passage_scores(labelled_drive(truth), Labeling(np.array(late), Status.EXACT), 2)
    assert (found.found, found.missed, found.invented) == (1, 1, 0)


def test_a_simulated_drive_stays_in_the_window_of_its_map() -> None:
    train = [simulated(0, half="left"), simulated(0, half="right")]
    drives = load_drives(Experiment(config(train=train), Path()), "train")
    for item in drives:
        assert item.map is not None and item.map.window is not None
        row, column = item.map.grid.cells_at_m(item.positions_m).T
        assert item.map.window[row, column].all()
    assert drives[0].building == drives[1].building  # two halves of one building


# ---------------------------------------------------------------------- logs


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map with labels, and a log of a drive through it in a frame of its own."""
    path = tmp_path_factory.mktemp("logs")
    building = generate_building(1, size="small")
    save_map(building.grid, path / "map")
    save_labels(path / "labels.png", building.labels, building.label_names)
    known = LabelledMap(building.grid, building.labels)
    drive = SimulatedRobot(scan_every_s=1.0).explore(building.grid, max_length_m=20.0)
    drive = drive.labelled_by(known, building.label_names)
    write_trajectory(path / "drive.log.gz", drive)
    write_trajectory(path / "drive.csv", drive)
    moved = drive.transformed(Similarity(0.3, (5.0, -2.0)))
    write_trajectory(path / "moved.csv", moved)
    return path


LOG = {"log": "drive.log.gz", "map": "map.yaml", "labels": "labels.png"}


def loaded(folder: Path, **source: Any) -> Trajectory:
    chosen = config(labels={"names": list(NAMES)}, resolution_m=None, test=[source])
    [found] = load_drives(Experiment(chosen, folder), "test")
    return found.trajectory


def test_true_places_come_from_a_table_the_log_itself_or_a_labelled_map(folder: Path) -> None:
    by_map = loaded(folder, **LOG)
    by_table = loaded(folder, log="drive.log.gz", truth="drive.csv")
    by_itself = loaded(folder, log="drive.csv")
    assert by_map.geometry is not None and by_itself.geometry is None
    assert (by_map.name, loaded(folder, **LOG, name="monday").name) == ("drive", "monday")
    np.testing.assert_array_equal(by_map.labels, by_table.labels)
    np.testing.assert_array_equal(by_map.labels, by_itself.labels)
    with pytest.raises(LabelError, match=r"drive\.log\.gz has no true labels"):
        loaded(folder, log="drive.log.gz", map="map.yaml")
    write_trajectory(folder / "short.csv", by_itself[:7])
    with pytest.raises(LogError, match=r"short\.csv has 7 rows but the log \d+ steps"):
        loaded(folder, log="drive.log.gz", truth="short.csv")


def test_classes_are_translated_and_the_rest_is_unknown(folder: Path) -> None:
    plain = loaded(folder, log="drive.csv")
    found = loaded(folder, log="drive.csv", classes={"room": "corridor"})
    expected = np.where(plain.labels == NAMES.index("room"), 0, -1)
    np.testing.assert_array_equal(found.labels, expected)
    table = loaded(folder, log="drive.log.gz", truth="drive.csv", classes={"room": "corridor"})
    np.testing.assert_array_equal(table.labels, expected)


def test_a_log_is_brought_into_the_frame_of_its_map(folder: Path) -> None:
    back = Similarity(0.3, (5.0, -2.0)).inverse()
    frame = {"rotation_rad": back.rotation_rad, "translation_m": list(back.translation_m)}
    found = loaded(folder, log="moved.csv", frame=frame)
    np.testing.assert_allclose(
        found.poses[:, :2], loaded(folder, log="drive.csv").poses[:, :2], atol=1e-4
    )


def test_a_part_of_a_log_by_steps_or_by_region(folder: Path) -> None:
    whole = loaded(folder, **LOG)
    part = loaded(folder, **LOG, from_step=5, to_step=15)
    np.testing.assert_array_equal(part.poses, whole.poses[5:15])
    x = float(np.median(whole.poses[:, 0]))
    halved = loaded(folder, **LOG, region=[-100.0, -100.0, x, 100.0])
    assert whole.labels is not None and halved.labels is not None
    np.testing.assert_array_equal(halved.labels, np.where(whole.poses[:, 0] <= x, whole.labels, -1))
    with pytest.raises(LogError, match="from_step 9000 to to_step the end contains no step"):
        loaded(folder, **LOG, from_step=9000)
    with pytest.raises(LabelError, match=r"test\[0\] .* no step has a true label"):
        loaded(folder, **LOG, region=[900.0, 900.0, 901.0, 901.0])


def test_scans_are_simulated_along_recorded_positions(folder: Path) -> None:
    known = {"map": "map.yaml", "labels": "labels.png"}
    found = loaded(folder, log="drive.csv", laser=LASER, resample_m=0.05, **known)
    plain = loaded(folder, log="drive.csv")
    assert found.geometry is not None and found.geometry.n_beams == 60
    assert len(found) > 2 * len(plain)
    assert found.labels is not None
    assert (found.labels >= 0).mean() > 0.9  # the map tells places between recorded positions


def test_a_labelled_map_counts_in_tests_and_is_refused_elsewhere(tmp_path: Path) -> None:
    building = generate_building(seed=2)
    assert tuple(building.label_names) == NAMES
    right = topological_map(building.grid, building.labels, NAMES, correct=False)
    save_topology(tmp_path, right)
    methods = [{"name": "hmm"}, {"name": "relaxation"}]
    labelled = simulated(1) | {"map_labels": str(tmp_path)}
    plain = compare(Experiment(config(methods=methods), Path()))
    told = compare(Experiment(config(methods=methods, test=[labelled]), Path()))
    for before, after in zip(plain.methods, told.methods, strict=True):
        assert after.evaluation.accuracy > before.evaluation.accuracy + 0.02
    with pytest.raises(ConfigError, match=r"train\[0\]: map_labels is for drives to test on"):
        config(train=[simulated(0) | {"map_labels": "folder"}])


def test_drives_with_and_without_counts_are_not_mixed(folder: Path) -> None:
    (folder / "counts.csv").write_text("t_s,lamp\n0.0,1\n5.0,0\n")
    counted, plain = LOG | {"counts": "counts.csv"}, LOG
    labels = {"names": list(NAMES)}
    steps = {"every_m": 0.3, "n_runs": 20}

    def experiment(train: list[dict[str, Any]], test: list[dict[str, Any]]) -> Experiment:
        chosen = config(labels=labels, resolution_m=None, steps=steps, train=train, test=test)
        return Experiment(chosen, folder)

    [found] = compare(experiment([counted], [counted])).maps
    assert isinstance(found, EvalDrive)
    with pytest.raises(ConfigError, match="has no object counts, but other drives have"):
        compare(experiment([counted, plain], [counted]))
    with pytest.raises(ConfigError, match="has no object counts, but other drives have"):
        compare(experiment([counted], [plain]))
    with pytest.raises(ConfigError, match="the training drives have no counts; remove counts"):
        compare(experiment([plain], [counted]))
    [drive] = load_drives(experiment([counted], [counted]), "train")
    assert counted_objects([drive]) == ("lamp",)
    seen = drive.count_columns(("lamp", "person"))
    assert seen is not None
    assert seen[0].tolist() == [1.0, 0.0]
    assert (seen[drive.trajectory.times_s > 10.0] == 0).all()
