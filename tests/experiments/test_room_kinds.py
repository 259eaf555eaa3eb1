"""Kinds of rooms on generated buildings: the truth of places, the folds, the tables."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from experiments import room_kinds
from experiments.room_kinds import Floor, describe, kinds_of_places
from pgm_places.datasets import generate_building
from pgm_places.inference.problem import LabelingProblem
from pgm_places.spaces.door_truth import match_doors
from pgm_places.spaces.gates import gate_candidates
from pgm_places.spaces.place_neighbours import neighbour_graph
from pgm_places.spaces.places import places_between
from pgm_places.spaces.segmentation import Segmentation

KINDS = ("class room", "office", "corridor")
CLASS_ROOM, OFFICE, CORRIDOR = range(3)


def floor(seed: int) -> Floor:
    """A generated floor whose larger rooms are class rooms, the others offices."""
    made = generate_building(seed, size="small")
    gates = gate_candidates(Segmentation.of(made.grid))
    doorway, corridor = (made.label_names.index(name) for name in ("doorway", "corridor"))
    places = places_between(gates, match_doors(gates, made.labels, doorway).is_doorway)
    place, area_m2 = places.segments.raster(), places.segments.area_m2
    kind = np.where(area_m2 > np.median(area_m2), CLASS_ROOM, OFFICE)[place]
    kind = np.where(made.labels == corridor, CORRIDOR, kind)
    kind[(made.labels < 0) | (made.labels == doorway) | (place < 0)] = -1
    truth = kinds_of_places(place, places.count, kind)
    problem = LabelingProblem(neighbour_graph(places), KINDS, node_features=describe(places))
    name = ("school" if seed % 2 else "office") + str(seed)
    truth[0] = -1  # as are places that join several kinds
    return Floor(name, f"building {seed // 2}", problem, truth, area_m2, made.grid, place)


@pytest.fixture(scope="module")
def floors() -> Iterator[list[Floor]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room_kinds, "KINDS", KINDS)
        yield [floor(seed) for seed in range(2, 8)]


def test_a_place_has_the_kind_that_prevails() -> None:
    place = np.repeat(np.arange(4, dtype=np.int32), 10)[None]
    kind = np.full((1, 40), -1)
    kind[0, :10] = [0] * 7 + [1] * 3  # clearly 0
    kind[0, 10:20] = [0] * 5 + [1] * 5  # neither
    kind[0, 20:24] = 2  # labelled on less than half of it
    kind[0, 30:40] = len(room_kinds.KINDS)  # another kind
    assert kinds_of_places(place, 4, kind).tolist() == [0, -1, -1, -1]


def test_each_place_is_labelled_from_other_buildings(
    floors: list[Floor], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room_kinds, "N_TREES", 20)
    monkeypatch.setattr(room_kinds, "METHODS", {"potts": ("potts", {}, "weight", (0.0, 0.1))})
    score, learned = room_kinds.scored, []

    def watched(tests: Sequence[Floor], learn_from: Sequence[Floor]) -> list[Floor]:
        seen = {item.building for item in learn_from}
        assert seen.isdisjoint(item.building for item in tests)
        learned.append(seen)
        return score(tests, learn_from)

    monkeypatch.setattr(room_kinds, "scored", watched)
    labels = room_kinds.leave_one_out(floors)
    assert len(learned) == 3 * (1 + 2)  # the forest of each building left out, and those of folds
    truth = np.concatenate([item.truth for item in floors])
    known = truth >= 0
    assert np.isin([CLASS_ROOM, OFFICE, CORRIDOR], truth).all()
    for found in labels.values():
        assert (np.concatenate(found)[known] == truth[known]).mean() > 0.75


def test_tables_count_the_places(floors: list[Floor]) -> None:
    right = [np.maximum(item.truth, 0) for item in floors]
    wrong = [
        np.where(item.truth == OFFICE, CLASS_ROOM, labels)
        for item, labels in zip(floors, right, strict=True)
    ]
    assert room_kinds.figures(floors, right) == "100.0 / 100.0 / 100.0 / 100.0"
    share = room_kinds.figures(floors, wrong).split(" / ")
    assert share[2:] == [f"{200 / 3:.1f}", "100.0"]
    schools = [item for item in floors if item.is_school]
    n_offices = sum(int((item.truth == OFFICE).sum()) for item in schools)
    table = room_kinds.kinds_table({"schools": room_kinds.confusion_of(floors, wrong, school=True)})
    row = next(row for row in table.rows if row[0] == "office")
    assert row[1:] == (str(n_offices), "0 / –", f"class room {n_offices}")


def test_the_picture_shows_every_labelling(floors: list[Floor]) -> None:
    item = floors[0]
    assert room_kinds.picture(item, {"true": item.truth, "found": item.truth})[1:4] == b"PNG"
