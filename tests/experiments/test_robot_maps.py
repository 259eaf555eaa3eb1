"""Maps that robots made: what is declared of them, how a source labels them, the figures."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.floor_network.held_out import shipped_without
from experiments.known_maps import KnownMap
from experiments.robot_maps import __main__ as command
from experiments.robot_maps import catalogue
from experiments.robot_maps.figures import cut_spaces, measured, table, write_figures
from experiments.robot_maps.reliability import Bins, Reliability
from experiments.robot_maps.sources import Source, evidence_named, lists_alone
from pgm_places.errors import ConfigError
from pgm_places.floor.network import FloorNetwork
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.simulation import generate_building
from pgm_places.trained import trained_labeler
from pgm_places.unary.map_model import CellScores
from tests.quick_labeler import places
from tests.real_data import real_data_folder

CORRIDOR, ROOM, DOORWAY = range(3)


def known_map() -> KnownMap:
    made = generate_building(3, size="small", resolution_m=0.05)
    return KnownMap(LabelledMap(made.grid, made.labels, None, "small"), "homes", "robots' maps")


def truth_of(known: KnownMap) -> NDArray[np.float64]:
    truth = known.item.labels[known.item.grid.free]
    return np.log(np.where(np.arange(3) == truth[:, None], 0.98, 0.01))


def test_every_map_has_a_kind_a_weight_and_a_building() -> None:
    found = catalogue.declared()
    assert len(found) == 76
    assert found["hospital_aws"][:3] == ("hospitals", 1.0, "hospital")
    assert found["lab_ecn"][:3] == ("labs and offices", 0.25, "lab_ecn")
    same = [name for name, known in found.items() if known.building == "uom"]
    assert sorted(same) == ["floor_uom", "hallway_uom", "lab_hv"]


@pytest.mark.real_data
def test_all_maps_are_read_with_the_models_cells() -> None:
    found = list(catalogue.robot_maps(real_data_folder("robots").parent))
    assert len(found) == 76
    assert {weight for _, weight in found} == {1.0, 0.5, 0.25}
    assert max(known.item.grid.resolution_m for known, _ in found) <= 0.0501
    assert {known.group for known, _ in found} == {
        f"{known.kind}, robots' maps" for known in catalogue.declared().values()
    }


def test_a_folder_that_nobody_declared_is_refused(tmp_path: Path) -> None:
    for name in [*catalogue.declared(), "attic"]:
        (tmp_path / "robots" / name).mkdir(parents=True)
        (tmp_path / "robots" / name / "map.yaml").touch()
    with pytest.raises(ConfigError, match="differ in 'attic'"):
        next(catalogue.robot_maps(tmp_path))


def test_evidence_takes_the_place_of_the_list() -> None:
    known = known_map()
    shapes = []

    def evidence(grid: OccupancyGrid, graph: LabelGraph, scores: CellScores) -> NDArray[np.float64]:
        assert scores.space is not None
        shapes.append((int(grid.free.sum()), graph.n_nodes, *scores.space.shape))
        return truth_of(known)

    source = Source(places(), evidence=evidence)
    found = measured(known, 1.0, source.label(known.item.grid))
    n_free = int(known.item.grid.free.sum())
    assert shapes == [(n_free, n_free, n_free, 3)]
    assert found.cells.accuracy > 0.99
    assert found.painted.doors == found.painted.found > 0
    alone = measured(known, 1.0, Source(places()).label(known.item.grid))
    assert alone.cells.accuracy < found.cells.accuracy


def test_a_space_is_cut_where_a_part_of_it_has_another_label() -> None:
    cells = np.full((12, 40), 100, np.int8)
    cells[1:11, 1:19], cells[1:11, 20:39] = 0, 0
    grid = OccupancyGrid(cells, resolution_m=0.2)
    truth = np.where(grid.free, CORRIDOR, -1)
    truth[1:11, 20:39] = ROOM
    item = LabelledMap(grid, truth)
    assert cut_spaces(item, truth) == (0, 2)
    found = truth.copy()
    found[1:11, 10:19] = ROOM
    assert cut_spaces(item, found) == (1, 2)
    found[1:11, 1:10] = ROOM  # all of it wrong: not cut
    assert cut_spaces(item, found) == (0, 2)
    found[1:11, 30:39] = DOORWAY  # not counted
    assert cut_spaces(item, found) == (0, 2)


def test_means_are_weighed_and_doors_are_added_up(tmp_path: Path) -> None:
    known = known_map()
    right = Source(places(), evidence=lambda *_: truth_of(known)).label(known.item.grid)
    wrong = replace(right, labels=np.where(right.labels == ROOM, CORRIDOR, right.labels))
    figures = [measured(known, 1.0, right), measured(known, 0.25, wrong)]
    mean = (figures[0].cells.accuracy + 0.25 * figures[1].cells.accuracy) / 1.25
    line = table(figures).splitlines()[2]
    assert line.startswith(f"| homes, robots' maps | 2 | {100 * mean:.1f} / ")
    doors = figures[0].painted.doors
    assert f"| {2 * doors} of {2 * doors} = 100.0 / " in line
    write_figures(tmp_path / "figures.csv", figures)
    with (tmp_path / "figures.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["weight"] for row in rows] == ["1.0", "0.25"]
    assert float(rows[1]["accuracy"]) == pytest.approx(figures[1].cells.accuracy, abs=1e-4)
    assert [int(row["painted_doors"]) for row in rows] == [doors, doors]


def test_the_lists_of_a_model_can_be_measured_alone() -> None:
    shipped = trained_labeler()
    found = lists_alone(shipped)
    assert shipped.method("potts").unary == "floor"
    assert {name: method.unary for name, method in found.methods_.items()} == dict.fromkeys(
        shipped.methods_, "space"
    )
    assert found.unary_model_.floor is None
    assert shipped.unary_model_.floor is not None


def test_evidence_that_cannot_be_found_is_refused() -> None:
    found: object = evidence_named("numpy:log")
    assert found is np.log
    for name in ("numpy", "numpy:nothing_like_it", "no_such_module:log"):
        with pytest.raises(ConfigError, match="--evidence wants MODULE:NAME"):
            evidence_named(name)


def test_the_command_prints_the_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(command, "chosen_maps", lambda *_: iter([(known_map(), 1.0)]))
    monkeypatch.setattr(command, "trained_labeler", lambda _: places())
    picture = tmp_path / "worst.png"
    sheets = tmp_path / "sheets"
    written = ["--out", str(tmp_path / "figures.csv"), "--worst", str(picture)]
    command.main([*written, "--reliability", "--sheets", str(sheets)])
    assert picture.read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    assert "| homes, robots' maps | 1 |" in printed
    assert "| **all** | 1 |" in printed
    assert "| confidence | cells | without halls | places | doors |" in printed
    assert (sheets / "robots_homes.png").is_file()
    assert len((tmp_path / "figures.csv").read_text().splitlines()) == 2


def test_maps_of_one_building_are_in_one_fold() -> None:
    folds: dict[str, set[int]] = {}
    for known in catalogue.declared().values():
        folds.setdefault(known.building, set()).add(known.fold)
    assert {len(some) for some in folds.values()} == {1}
    assert set.union(*folds.values()) == set(range(4))


def test_a_map_has_the_networks_that_did_not_learn_its_building() -> None:
    labeler_of = shipped_without()
    shipped = trained_labeler().unary_model_.floor
    assert shipped is not None
    for name, known in catalogue.declared().items():
        floor = labeler_of(name).unary_model_.floor
        assert floor is not None
        assert [weights(network) for network in floor.networks] == [
            weights(network) for network in shipped.networks[known.fold :: 4]
        ]


def weights(network: FloorNetwork) -> bytes:
    return b"".join(np.asarray(network.weights[name]).tobytes() for name in sorted(network.weights))


def test_reliability_compares_confidence_with_what_is_right() -> None:
    known = known_map()
    found = Source(places(), evidence=lambda *_: truth_of(known)).label(known.item.grid)
    beliefs = found.labeling.beliefs
    assert beliefs is not None
    reliability = Reliability()
    reliability.add(known, found)
    label = found.labels[found.labels >= 0]
    truth = known.item.labels[found.labels >= 0]
    cells = reliability.cells
    assert cells.number.sum() == (truth >= 0).sum()
    assert cells.right.sum() == (label == truth)[truth >= 0].sum()
    sure = np.take_along_axis(beliefs, label[:, None], axis=1)[truth >= 0, 0]
    assert cells.confidence.sum() == pytest.approx(sure.sum())
    assert reliability.no_halls.number.sum() == cells.number.sum()  # this map has none
    assert reliability.places.right.sum() == pytest.approx(reliability.places.number.sum(), rel=0.1)
    assert "| error |" in reliability.table()


def test_bins_have_the_error_of_their_means() -> None:
    bins = Bins()
    bins.add([0.55, 0.55, 0.97, 1.0], [1, 0, 1, 1])
    assert bins.error == pytest.approx((2 * 0.05 + 0.03) / 4)


def test_halls_can_be_left_out_of_the_figures() -> None:
    known = known_map()
    halls = known.item.labels == CORRIDOR
    found = Source(places(), evidence=lambda *_: truth_of(known)).label(known.item.grid)
    wrong = replace(found, labels=np.where(found.labels == CORRIDOR, ROOM, found.labels))
    figures = measured(replace(known, halls=halls), 1.0, wrong)
    assert figures.no_halls is not None
    assert figures.cells.accuracy < 0.9 < figures.no_halls.accuracy
    assert figures.no_halls.n == figures.cells.n - int((halls & (wrong.labels >= 0)).sum())
    only = replace(known, halls=np.ones_like(halls))
    assert measured(only, 1.0, wrong).no_halls is None
    assert "nan / nan / nan" in table([measured(only, 1.0, wrong)])
