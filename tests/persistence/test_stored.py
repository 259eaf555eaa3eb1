"""One pair of functions for all that is learned; models saved by the version before still load.

``tests/data/stored`` was written by the version before this pair: a folder of each kind, and in
``expected.npz`` what they were asked to label and the labels that they gave.
"""

import dataclasses
import json
import shutil
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import (
    LabelGraph,
    LabelingProblem,
    OccupancyGrid,
    StructuredLabeler,
    Trajectory,
    TrajectoryLabeler,
    build,
    load,
    save,
)
from pgm_places.errors import InputError, ModelFileError, NotFittedError
from pgm_places.labelers.place_labeler import PlaceLabeler
from pgm_places.persistence.model_folder import load_folder, save_folder
from pgm_places.persistence.stored import KINDS, read
from pgm_places.topology.rules import TopologyOptions
from pgm_places.trained import model_folder
from tests.refusals import refused

STORED = Path(__file__).parents[1] / "data" / "stored"


@lru_cache
def expected() -> dict[str, NDArray[Any]]:
    with np.load(STORED / "expected.npz") as found:
        return dict(found)


def grid() -> OccupancyGrid:
    return OccupancyGrid(expected()["cells"], float(expected()["resolution_m"]))


def path() -> Trajectory:
    poses = expected()["poses"]
    return Trajectory(0.5 * np.arange(len(poses), dtype=np.float64), poses)


def chain() -> LabelingProblem:
    return LabelingProblem(
        LabelGraph.from_lattice((30,)),
        ("rest", "walk", "run"),
        unary=expected()["unary"],
        node_features=expected()["features"],
    )


@pytest.mark.parametrize("method", ["adaboost", "relaxation", "amn", "potts"])
def test_a_place_labeler_of_before_labels_as_it_did(method: str) -> None:
    labels = load(STORED / "place_labeler").label(grid(), method=method).labels
    np.testing.assert_array_equal(labels, expected()[f"place_labeler.{method}"])


def test_a_place_labeler_of_before_tracks_as_it_did() -> None:
    tracker = TrajectoryLabeler.from_places(load(STORED / "place_labeler"), every_m=0.3)
    labels = tracker.label(path(), known_map=grid()).labels
    np.testing.assert_array_equal(labels, expected()["place_labeler.track"])


def test_a_trajectory_labeler_of_before_labels_as_it_did() -> None:
    labels = load(STORED / "trajectory_labeler").label(path(), known_map=grid()).labels
    np.testing.assert_array_equal(labels, expected()["trajectory_labeler"])


def test_options_of_a_trajectory_labeler_are_stored(tmp_path: Path) -> None:
    options = {"n_folds": 3, "n_runs": 70, "seed": 9, "loop_m": 2.5}
    labeler = load(STORED / "trajectory_labeler").with_options(**options)
    again = load(save(labeler, tmp_path / "again"))
    assert {name: getattr(again, name) for name in options} == options


def test_a_structured_labeler_of_before_labels_as_it_did() -> None:
    labels = load(STORED / "structured_labeler").label(chain()).labels
    np.testing.assert_array_equal(labels, expected()["structured_labeler"])


@pytest.mark.parametrize("name", ["amn", "hmm", "independent", "potts", "relaxation"])
def test_a_backend_of_before_labels_as_it_did(name: str) -> None:
    labels = load(STORED / f"backend_{name}").infer(chain()).labels
    np.testing.assert_array_equal(labels, expected()[f"backend_{name}"])


def without_options(content: Any) -> Any:
    """A manifest but for the names of methods' options, which versions may change.

    What a method has learned is listed in any order.
    """
    if isinstance(content, dict):
        kept = {key: without_options(part) for key, part in content.items() if key != "options"}
        return kept | ({"learned": sorted(kept["learned"])} if "learned" in kept else {})
    return [without_options(part) for part in content] if isinstance(content, list) else content


@pytest.mark.parametrize("folder", sorted(item.name for item in STORED.iterdir() if item.is_dir()))
def test_a_folder_says_what_it_holds_and_is_saved_again_alike(folder: str, tmp_path: Path) -> None:
    found = read(STORED / folder)
    assert found.kind in KINDS and found.label_names
    names = found.label_names if found.kind == "backend" else ()
    save(found.item, tmp_path / "again", label_names=names, record=found.record)
    before, after = (load_folder(where) for where in (STORED / folder, tmp_path / "again"))
    wanted = {**before[0], "record": dict(found.record)}
    assert without_options(wanted) == without_options(shared(after[0], wanted))
    assert before[1].keys() == after[1].keys()
    for name, array in before[1].items():
        np.testing.assert_array_equal(array, after[1][name], strict=True)


def shared(after: Any, before: Any) -> Any:
    """What a manifest of today says of the keys that there were before; new ones have defaults."""
    if not (isinstance(after, dict) and isinstance(before, dict)):
        return after
    return {key: shared(value, before[key]) for key, value in after.items() if key in before}


def test_the_record_of_training_is_kept() -> None:
    assert read(STORED / "place_labeler").record == {"seed": 1, "title": "stored before"}
    assert read(STORED / "backend_potts").record == {}


def test_other_kinds_are_refused_where_one_is_wanted(tmp_path: Path) -> None:
    with pytest.raises(
        ModelFileError, match="holds a 'backend' model; expected a 'place-labeler' or"
    ):
        read(STORED / "backend_hmm", "place-labeler", "trajectory-labeler")
    save_folder(tmp_path / "joint", {"kind": "joint-labeler"}, {})
    with pytest.raises(ModelFileError, match="use this one with pgm-places track LOG --map MAP"):
        read(tmp_path / "joint", "place-labeler", "trajectory-labeler")
    save_folder(tmp_path / "steps", {"kind": "trajectory-labeler"}, {})
    with pytest.raises(ModelFileError, match="use this one with pgm-places track"):
        read(tmp_path / "steps", "place-labeler")
    save_folder(tmp_path / "cake", {"kind": "cake"}, {})
    with pytest.raises(ModelFileError, match="holds a 'cake' model; expected a 'place-labeler' or"):
        load(tmp_path / "cake")


def test_what_is_no_model_is_not_saved(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="item must be a Labeler or a Backend, got an Occupancy"):
        save(grid(), tmp_path / "model")  # type: ignore[arg-type]
    with pytest.raises(NotFittedError, match=r"this PlaceLabeler .* call fit\(maps\) first"):
        save(PlaceLabeler(["a", "b"]), tmp_path / "model")
    refused(NotFittedError, "call fit", save, StructuredLabeler("potts"), tmp_path / "model")
    with pytest.raises(InputError, match="a labeler stores its own label names"):
        save(load(STORED / "place_labeler"), tmp_path / "model", label_names=["a"])
    assert not (tmp_path / "model").exists()


@pytest.mark.parametrize("folder", ["place_labeler", "trajectory_labeler", "structured_labeler"])
def test_every_part_of_a_manifest_that_is_missing_is_one_clear_line(
    folder: str, tmp_path: Path
) -> None:
    manifest, arrays = load_folder(STORED / folder)
    optional = {"kind", "record", "features", "movement"}
    if folder != "structured_labeler":
        optional.add("options")
    for key in manifest.keys() - optional:
        less = {name: value for name, value in manifest.items() if name != key}
        save_folder(tmp_path / "spoiled", less, arrays)
        with pytest.raises(ModelFileError, match="spoiled") as caught:
            load(tmp_path / "spoiled")
        assert "\n" not in str(caught.value)


def test_arrays_that_are_missing_are_one_clear_line(tmp_path: Path) -> None:
    manifest, arrays = load_folder(STORED / "backend_amn")
    for key in arrays:
        less = {name: value for name, value in arrays.items() if name != key}
        save_folder(tmp_path / "spoiled", manifest, less)
        with pytest.raises(ModelFileError, match="does not have the format of this version"):
            load(tmp_path / "spoiled")


def test_an_unfitted_backend_can_be_kept_without_names(tmp_path: Path) -> None:
    assert load(save(build("potts", {"weight": 0.25}), tmp_path / "model")).weight == 0.25


def backends_in(value: Any) -> list[Any]:
    """The backends among the options of a labeler."""
    parts = value.values() if isinstance(value, dict) else [value]
    return [getattr(part, "backend", part) for part in parts]


@pytest.mark.parametrize(
    ("folder", "option"),
    [
        ("place_labeler", "methods"),
        ("trajectory_labeler", "method"),
        ("structured_labeler", "backend"),
    ],
)
def test_the_options_of_a_loaded_labeler_hold_nothing_learned(folder: str, option: str) -> None:
    labeler = load(STORED / folder)

    def learned(name: str) -> list[str]:
        return [
            item.name
            for backend in backends_in(getattr(labeler, name))
            for item in dataclasses.fields(backend)
            if item.metadata.get("learned") and getattr(backend, item.name) is not None
        ]

    assert learned(option) == []
    assert learned(f"{option}_")


@pytest.mark.parametrize(
    ("folder", "key", "value", "wanted"),
    [
        ("trajectory_labeler", "every_m", "far", "every_m must be a number of at least 0, got"),
        ("trajectory_labeler", "every_m", 1e400, "must be plain JSON data"),
        ("trajectory_labeler", "options", {"n_folds": 1}, "n_folds must be a whole number from 2"),
        ("place_labeler", "options", {"cake": 1}, "does not have the format of this version"),
        ("place_labeler", "connectivity", 6, "connectivity must be 4 or 8, got 6"),
    ],
)
def test_stored_options_are_checked_like_given_ones(
    folder: str, key: str, value: object, wanted: str, tmp_path: Path
) -> None:
    manifest, arrays = load_folder(STORED / folder)
    with pytest.raises(ModelFileError, match=wanted):
        load(save_folder(tmp_path / "spoiled", {**manifest, key: value}, arrays))


def spoiled(tmp_path: Path, source: Path, keys: tuple[str, ...], value: object) -> Path:
    """A copy of a model with another value at a place of its manifest."""
    folder = tmp_path / "model"
    shutil.copytree(source, folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    part = manifest["content"]
    for key in keys[:-1]:
        part = part.setdefault(key, {})
    part[keys[-1]] = value
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


@pytest.mark.parametrize("kind", sorted(path.name for path in STORED.iterdir() if path.is_dir()))
@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("label_names",), ["room", "\0"], "label_names must not hold control characters"),
        (("label_names",), ["room", "\ud800"], "label_names must not hold control characters"),
        (("label_names",), ["room", "room"], "label_names must differ, got 'room' twice"),
        (("label_names",), [1, 2], "label_names must be strings of 1 to 200 characters, got 1"),
        (("label_names",), "room", "label_names must be a list of names, got 'room'"),
        (("record",), None, "record must be a table of keys and values, got None"),
        (("record", "config"), [], "record.config must be a table of keys and values, got []"),
        (("record", "config", "topology"), None, "record.config.topology must be a table"),
        (
            ("record", "config", "topology"),
            {"min_width": 1.0},
            "unknown key 'record.config.topology.min_width'. Did you mean 'min_width_m'?",
        ),
        (("record", "config", "topology"), {"min_area_m2": 10**400}, "an integer has 401 digits"),
        (("record", "config", "topology"), {"doorway_label": 5}, "record.config.topology.doorway_"),
        (("record", "config", "topology"), {"split_rooms_m": 1.5}, "record.config.topology.split_"),
    ],
)
def test_the_whole_record_is_checked(
    kind: str, keys: tuple[str, ...], value: object, message: str, tmp_path: Path
) -> None:
    with pytest.raises(ModelFileError) as caught:
        load(spoiled(tmp_path, STORED / kind, keys, value))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_corrections_that_an_earlier_version_left_off_are_ignored(tmp_path: Path) -> None:
    earlier = {"min_area_m2": 2.0, "close_leaks_m": 0.0, "split_rooms_m": 0, "min_part_m2": 4.0}
    keys = ("record", "config", "topology")
    folder = spoiled(tmp_path, STORED / "place_labeler", keys, earlier)
    assert read(folder).rules == TopologyOptions(min_area_m2=2.0)


@pytest.mark.parametrize("value", [1e308, -1, 0, None, "0.05", True, [0.05]])
def test_cells_of_a_model_are_metres(value: object, tmp_path: Path) -> None:
    folder = spoiled(tmp_path, model_folder("generated"), ("resolution_m",), value)
    refused(ModelFileError, "resolution_m must be", load, folder)


def test_a_manifest_of_any_depth_is_one_message(tmp_path: Path) -> None:
    folder = spoiled(tmp_path, model_folder("generated"), ("record",), {})
    (folder / "manifest.json").write_text('{"a":' * 100_000)
    refused(ModelFileError, "nested too deep", load, folder)


def test_what_a_model_quotes_is_shortened(tmp_path: Path) -> None:
    shutil.copytree(STORED / "place_labeler", tmp_path / "model")
    path = tmp_path / "model" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["content"]["methods"][0]["options"] = {"a" * 5000: 0}
    path.write_text(json.dumps(manifest))
    with pytest.raises(ModelFileError, match=r"has no option 'a+ \.\.\. a+'") as found:
        load(tmp_path / "model")
    assert len(str(found.value)) < 1300
