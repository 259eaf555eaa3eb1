"""The teacher: labels that follow the paint."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgm_places import LabelledMap, PlaceLabeler
from pgm_places.errors import LabelError
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.labelers.method import PlaceMethod
from pgm_places.labelling.label import label_map
from pgm_places.labelling.model import LoadedModel
from pgm_places.models.decision_list import DecisionListClassifier
from pgm_places.persistence.stored import load, save
from pgm_places.progress import Silent, Stage
from pgm_places.simulation import LabelledBuilding, generate_building
from pgm_places.teaching import learning
from pgm_places.teaching.interactive_labeler import InteractiveLabeler, InteractiveResult
from pgm_places.teaching.paint import Paint
from pgm_places.teaching.training_selection import TeachingOptions
from pgm_places.topology.rules import TopologyOptions
from pgm_places.trained import trained_labeler
from pgm_places.unary import cell_scorers
from pgm_places.unary.training_cells import training_features
from tests.refusals import refused

NAMES = ("corridor", "room", "doorway")


@cache
def building() -> LabelledBuilding:
    return generate_building(4, size="small", resolution_m=0.1)


@cache
def teacher() -> InteractiveLabeler:
    return InteractiveLabeler(building().grid, trained_labeler())


@cache
def plain() -> LabelledPlaces:
    return label_map(trained_labeler(), building().grid)


def test_without_paint_it_labels_as_the_labeler_does() -> None:
    taught = teacher().label(teacher().blank())
    np.testing.assert_array_equal(taught.labels, plain().labels)
    labeler = trained_labeler()
    labeler.methods_["alone"] = PlaceMethod("independent", "floor")
    alone = label_map(labeler, building().grid, method="alone")
    np.testing.assert_array_equal(taught.unary_labels, alone.labels)
    assert taught.probabilities is not None and taught.unary_probabilities is not None
    free = taught.labels >= 0
    np.testing.assert_allclose(taught.probabilities[free].sum(axis=1), 1, rtol=0, atol=1e-5)
    assert len(taught.gates) == len(plain().doorways or ())
    assert taught.checks and taught.seconds > 0


def test_painted_cells_keep_their_labels_and_ids_stay() -> None:
    first = teacher().label(teacher().blank())
    place = max(first.topology.regions, key=lambda region: region.area_m2)
    other = "room" if place.label == "corridor" else "corridor"
    paint = first.paint.with_cells(first.topology.cells(place.id)[::5], other)
    second = teacher().label(paint)
    assert (second.labels[paint.painted] == NAMES.index(other)).all()
    unchanged = {r.id: r.label for r in first.topology.regions if r.label == "doorway"}
    assert unchanged.items() <= {r.id: r.label for r in second.topology.regions}.items()


def test_a_place_that_is_painted_another_class_gets_an_id_that_no_place_has_had() -> None:
    alone = InteractiveLabeler(
        building().grid, trained_labeler()
    )  # others remember what they taught
    first = alone.label(alone.blank())
    place = max(first.topology.regions, key=lambda region: region.area_m2)
    other = "room" if place.label == "corridor" else "corridor"
    paint = first.paint.with_cells(first.topology.cells(place.id), other)
    found = alone.label(paint).topology.region_at(*place.anchor_m)
    assert found is not None and found.label == other
    assert found.id >= first.topology.next_id


def test_the_rules_of_places_are_those_that_were_given() -> None:
    rules = TopologyOptions(min_width_m=100.0, correct=False, doorways="labels")
    strict = InteractiveLabeler(building().grid, LoadedModel(trained_labeler(), rules=rules))
    found = strict.label(strict.blank()).topology
    assert (found.connections, found.corrections) == ((), ())
    assert all(region.gate is None for region in found.regions)


def test_learning_from_nothing_but_paint() -> None:
    truth, grid = building().labels, building().grid
    pupil = InteractiveLabeler(grid, classes=NAMES)
    refused(LabelError, "at least two classes; painted so far: none", pupil.label, pupil.blank())
    one = pupil.blank().with_cells(np.argwhere(grid.free & (truth == 1))[:50], NAMES[1])
    refused(LabelError, f"at least two classes; painted so far: {NAMES[1]}", pupil.label, one)
    few = np.random.default_rng(0).random(grid.shape) < 0.02
    paint = pupil.blank()
    for label, name in enumerate(NAMES):
        paint = paint.with_cells(np.argwhere(few & grid.free & (truth == label)), name)
    taught = pupil.teach(paint)
    right = taught.labels == truth
    assert right[grid.free & (truth >= 0)].mean() > 0.9
    assert right[paint.painted].all()


def test_classes_must_hold_those_of_the_labeler() -> None:
    with pytest.raises(LabelError, match="'doorway' is a label of the labeler and must be among"):
        InteractiveLabeler(building().grid, trained_labeler(), classes=NAMES[:2])
    with pytest.raises(LabelError, match="without a labeler, 'classes' must list"):
        InteractiveLabeler(building().grid)


def relabelled(share: float) -> Paint:
    """Some cells of the west of the building: what is a room there is called a corridor."""
    grid, truth = building().grid, building().labels
    west = np.zeros(grid.shape, np.bool_)
    west[:, : grid.shape[1] // 2] = True
    chosen = west & grid.free & (np.random.default_rng(1).random(grid.shape) < share)
    paint = Paint.blank(grid.shape, NAMES).with_cells(
        np.argwhere(chosen & (truth == 1)), "corridor"
    )
    return paint.with_cells(np.argwhere(chosen & (truth == 0)), "room")


@cache
def taught() -> InteractiveResult:
    return teacher().teach(relabelled(0.05))


@pytest.mark.parametrize(("keep", "label"), [(0.0, 0), (30.0, 1)])
def test_what_is_learned_in_one_half_is_applied_in_the_other_unless_it_is_held(
    keep: float, label: int
) -> None:
    grid, truth = building().grid, building().labels
    east = grid.free & (truth == 1)
    east[:, : grid.shape[1] // 2 + 20] = False
    assert (plain().labels[east] == 1).mean() > 0.95
    pupil = InteractiveLabeler(grid, trained_labeler(), options=TeachingOptions(keep=keep))
    assert (pupil.teach(relabelled(0.05)).labels[east] == label).mean() > 0.8
    painted = relabelled(0.05)
    np.testing.assert_array_equal(taught().labels[painted.painted], painted.labels[painted.painted])


def test_the_taught_labeler_is_a_model_like_any_other(tmp_path: Path) -> None:
    """Stored, read, and used by label_map it labels as it did while it was taught."""
    save(taught().labeler, tmp_path / "model")
    found = label_map(load(tmp_path / "model"), building().grid, known=relabelled(0.05).labels)
    np.testing.assert_array_equal(found.labels, taught().labels)
    before = trained_labeler().unary_model_.space
    after = taught().labeler.unary_model_.space
    assert before is not None and after is not None
    for old, new in zip(before.classifier.classifiers, after.classifier.classifiers, strict=True):
        np.testing.assert_array_equal(new.feature[: old.n_rounds], old.feature)


def test_the_given_labeler_is_as_before_and_no_paint_teaches_nothing() -> None:
    taught()
    np.testing.assert_array_equal(teacher().teach(teacher().blank()).labels, plain().labels)


def test_maps_too_large_for_a_table_get_the_same_labels() -> None:
    labeler = InteractiveLabeler(building().grid, trained_labeler())
    labeler._table.max_bytes = 1000
    found = labeler.teach(relabelled(0.05))
    np.testing.assert_array_equal(found.labels, taught().labels)


def test_only_what_paint_can_reach_is_scored_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    labeler, grid = trained_labeler(), building().grid
    scored: list[int] = []
    asked = cell_scorers.aligned_log_proba

    def counted(fitted: Any, values: Any, *more: Any) -> Any:
        scored.append(len(values))
        return asked(fitted, values, *more)

    monkeypatch.setattr(cell_scorers, "aligned_log_proba", counted)
    teacher = InteractiveLabeler(grid, labeler)
    first = teacher.label(teacher.blank())
    n_cells = sum(scored)
    assert n_cells >= int(grid.free.sum())
    scored.clear()
    paint = first.paint.with_cells(first.topology.cells(first.checks[0].place.id), "room")
    again = teacher.label(paint)
    assert sum(scored) < n_cells / 2
    fresh = InteractiveLabeler(grid, labeler).label(paint)
    np.testing.assert_array_equal(again.labels, fresh.labels)
    np.testing.assert_array_equal(again.labelled.labeling.beliefs, fresh.labelled.labeling.beliefs)
    taught = teacher.teach(paint)
    np.testing.assert_array_equal(
        taught.labels, InteractiveLabeler(grid, labeler).teach(paint).labels
    )


def test_another_class_computes_no_features_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    labeler, grid = trained_labeler(), building().grid
    computed: list[int] = []

    def counted(*given: Any, **more: Any) -> Any:
        computed.append(1)
        return training_features(*given, **more)

    monkeypatch.setattr(learning, "training_features", counted)
    teacher = InteractiveLabeler(grid, labeler)
    first = teacher.label(teacher.blank())
    assert len(computed) == 1
    wider = teacher.with_classes([*teacher.classes, "kitchen"])
    place = max(first.topology.regions, key=lambda region: region.area_m2).id
    paint = wider.blank().with_cells(first.topology.cells(place), "kitchen")
    found = wider.teach(paint)
    assert len(computed) == 1
    fresh = InteractiveLabeler(grid, labeler, classes=wider.classes).teach(paint)
    assert found.label_names == fresh.label_names
    np.testing.assert_array_equal(found.labels, fresh.labels)
    again = wider.with_classes(teacher.classes)
    np.testing.assert_array_equal(again.label(teacher.blank()).labels, first.labels)
    assert len(computed) == 2  # by the fresh one


def test_any_number_of_threads_gives_the_same_bits() -> None:
    one = InteractiveLabeler(building().grid, trained_labeler(), n_threads=1).teach(
        relabelled(0.05)
    )
    assert one.probabilities is not None and taught().probabilities is not None
    np.testing.assert_array_equal(one.probabilities, taught().probabilities)


@pytest.mark.parametrize("halls", ["corridor", "hall"])
def test_a_new_class_is_learned_beside_those_that_are_known(halls: str, tmp_path: Path) -> None:
    grid = building().grid
    labeler = trained_labeler().with_options(halls=halls)
    classes = (*labeler.label_names_, "office")
    pupil = InteractiveLabeler(grid, labeler, classes=classes)
    first = pupil.label(pupil.blank())
    rooms = [region for region in first.topology.regions if region.label == "room"]
    paint = pupil.blank()
    for room in rooms[::2]:
        paint = paint.with_cells(first.topology.cells(room.id), "office")
    refused(LabelError, "'office' is painted, but is no label of the labeler", pupil.label, paint)
    found = pupil.teach(paint)
    office = found.label_names.index("office")
    assert {*found.label_names} == {*classes}
    assert (found.labels[paint.painted] == office).all()
    corridor = first.labels == 0
    assert (found.labels[corridor] == 0).mean() > 0.9
    save(found.labeler, tmp_path / "model")
    known = paint.with_classes(found.label_names).labels
    again = label_map(load(tmp_path / "model"), grid, known=known)
    np.testing.assert_array_equal(again.labels, found.labels)


def test_halls_can_be_painted() -> None:
    grid = building().grid
    pupil = InteractiveLabeler(grid, trained_labeler().with_options(halls="hall"))
    first = pupil.label(pupil.blank())
    room = max(
        (region for region in first.topology.regions if region.label == "room"),
        key=lambda region: region.area_m2,
    )
    paint = pupil.blank().with_cells(first.topology.cells(room.id), "hall")
    found = pupil.teach(paint)
    inside = tuple(first.topology.cells(room.id).T)
    assert (found.labels[inside] == found.label_names.index("hall")).mean() > 0.9


def test_a_labeler_that_looks_at_scans_only_learns_by_stumps() -> None:
    grid, truth = building().grid, building().labels
    classifier = DecisionListClassifier(n_rounds=20, order="rarest-first")
    labeler = PlaceLabeler(NAMES, ["independent"], classifier=classifier, space=None)
    labeler.fit([LabelledMap(grid, truth)])
    free = InteractiveLabeler(grid, labeler, options=TeachingOptions(keep=0.0))
    found = free.teach(relabelled(0.05))
    assert found.labeler.unary_model_.classifier.classifiers[1].n_rounds == 50
    free = grid.free & (truth == 1)
    free[:, grid.shape[1] // 2 :] = False
    assert (found.unary_labels[free] == 0).mean() > 0.6


def test_progress_that_raises_ends_a_call_and_the_next_one_is_as_ever() -> None:
    class Newer(Exception):  # noqa: N818  nothing went wrong
        pass

    class Stops(Silent):
        @contextmanager
        def stage(self, name: str) -> Iterator[Stage]:
            if name == "places":
                raise Newer
            with super().stage(name) as stage:
                yield stage

    refused(Newer, r"^$", teacher().label, relabelled(0.05), progress=Stops())
    np.testing.assert_array_equal(teacher().label(teacher().blank()).labels, plain().labels)
