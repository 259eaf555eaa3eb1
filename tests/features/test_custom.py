"""Features of one's own: computed, learned from, labelled with, named in files, and refused."""

from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import (
    LabelledMap,
    OccupancyGrid,
    PlaceLabeler,
    Sensor,
    Trajectory,
    TrajectoryLabeler,
    load,
    save,
)
from pgm_places.errors import ConfigError, InputError, ModelFileError, OutputError
from pgm_places.experiment.config import parse_config
from pgm_places.experiment.setup import make_labeler
from pgm_places.features.custom import (
    FEATURES,
    MapFeature,
    ScanFeature,
    as_features,
    column_names,
    feature_values,
    n_columns,
    values_on_map,
)
from pgm_places.features.extraction import extract
from pgm_places.models.decision_list import DecisionListClassifier
from tests.refusals import refused

NAMES = ("near a wall", "in the open")
SENSOR = Sensor(n_beams=360, max_range_m=10.0)


@dataclass(frozen=True)
class Shortest:
    """The shortest beams, which no laser feature holds."""

    n: int = 1

    @property
    def column_names(self) -> tuple[str, ...]:
        return tuple(f"shortest[{k}]" for k in range(self.n))

    def of_scans(self, ranges_m: NDArray[np.float32], max_range_m: float) -> NDArray[np.float32]:
        return np.sort(ranges_m, axis=1)[:, : self.n]


@dataclass(frozen=True)
class East:
    """How far east a cell lies."""

    column_names: ClassVar[tuple[str, ...]] = ("east",)

    def of_cells(self, grid: OccupancyGrid, cells_rc: NDArray[np.int64]) -> NDArray[np.float64]:
        return grid.cell_centres_m(cells_rc)[:, :1]


@dataclass(frozen=True)
class Broken:
    """Returns what it is told to."""

    width: int = 1
    value: float = 0.0
    column_names: ClassVar[tuple[str, ...]] = ("broken",)

    def of_scans(self, ranges_m: NDArray[np.float32], max_range_m: float) -> NDArray[np.float64]:
        return np.full((len(ranges_m), self.width), self.value)


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint(name, f"{__name__}:{target}", FEATURES.group)
        for name, target in (("shortest", "Shortest"), ("east", "East"))
    ]
    monkeypatch.setattr(
        "importlib.metadata.entry_points",
        lambda group: points if group == FEATURES.group else [],
    )


@pytest.fixture(scope="module")
def known() -> LabelledMap:
    """A bare hall, whose cells are labelled by how near a wall is."""
    cells = np.full((24, 44), 100, np.int8)
    cells[1:-1, 1:-1] = 0
    rows, columns = np.indices(cells.shape)
    margin = np.minimum(np.minimum(rows, 23 - rows), np.minimum(columns, 43 - columns))
    return LabelledMap(OccupancyGrid(cells, 0.1), (margin > 5).astype(np.int16))


def unfitted(*features: object) -> PlaceLabeler:
    return PlaceLabeler(
        NAMES,
        sensor=SENSOR,
        classifier=DecisionListClassifier(n_rounds=5, order="rarest-first"),
        learn_on="in-sample",
        features=features,
        space=None,
    )


def test_own_columns_follow_the_lasers() -> None:
    own = as_features([Shortest(2), East()])
    assert isinstance(own[0], ScanFeature)
    assert isinstance(own[1], MapFeature)
    assert n_columns(own) == 324
    assert column_names(own)[320:] == ("f23", "shortest[0]", "shortest[1]", "east")


def test_any_choice_of_columns_has_the_values_of_all(known: LabelledMap) -> None:
    ranges = np.random.default_rng(0).uniform(0.5, 8.0, (7, 360)).astype(np.float32)
    own = (Shortest(2), East())
    cells = np.argwhere(known.cells)[:7]
    from_map = values_on_map(own, known.grid, cells)
    whole = feature_values(ranges, own, max_range_m=10.0, from_map=from_map)
    np.testing.assert_array_equal(whole[:, :321], extract(ranges, max_range_m=10.0))
    np.testing.assert_array_equal(whole[:, 321], ranges.min(axis=1))
    np.testing.assert_array_equal(whole[:, 323], known.grid.cell_centres_m(cells)[:, 0].astype("f"))
    for columns in ([3, 322], [323], [5, 100], [0, 321, 323]):
        wanted = np.array(columns)
        part = feature_values(
            ranges,
            own,
            wanted,
            max_range_m=10.0,
            from_map=values_on_map(own, known.grid, cells, wanted),
        )
        np.testing.assert_array_equal(part, whole[:, columns])


def test_a_feature_that_is_not_wanted_is_not_asked(known: LabelledMap) -> None:
    ranges = np.ones((2, 360), np.float32)
    broken = (Broken(value=np.nan),)
    assert feature_values(ranges, broken, np.array([0, 5]), max_range_m=10.0).shape == (2, 2)
    assert values_on_map((East(),), known.grid, np.zeros((1, 2), np.int64), np.array([7])) == {}


@pytest.mark.parametrize("feature", [Shortest(2), East()])
def test_lists_learn_from_them_and_a_model_keeps_them_by_name(
    feature: object, known: LabelledMap, installed: None, tmp_path: Path
) -> None:
    labeler = unfitted(feature).fit([known])
    if isinstance(feature, Shortest):
        assert labeler.unary_model_.classifier.used_features.max() >= 321
    loaded = load(save(labeler, tmp_path / "model"))
    assert tuple(loaded.features) == (feature,)
    _, before = labeler.scores(known.grid)
    _, after = loaded.scores(known.grid)
    np.testing.assert_array_equal(before.laser, after.laser)
    truth = known.truth(known.graph())
    assert before.laser is not None
    assert (before.laser.argmax(axis=1) == truth).mean() > 0.95


def test_the_list_with_context_sees_them_too(known: LabelledMap) -> None:
    labeler = PlaceLabeler(
        NAMES,
        {"potts": "potts", "amn": "amn"},
        SENSOR,
        DecisionListClassifier(n_rounds=5, order="rarest-first"),
        context_m=(0.3,),
        n_folds=2,
        features=[Shortest()],
        space=None,
        unary="context",
    ).fit([known])
    assert labeler.unary_model_.context_classifier is not None
    assert labeler.unary_model_.context_classifier.n_features == 321 + 1 + 2
    assert 321 in labeler.unary_model_.node_columns
    labels = labeler.label(known.grid, method="amn").labels
    assert (labels == known.truth(known.graph())).mean() > 0.95


def test_a_model_whose_feature_is_absent_or_changed_says_so(
    known: LabelledMap, installed: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(unfitted(Shortest()).fit([known]), tmp_path / "model")
    with monkeypatch.context() as changed:
        changed.setattr(Shortest, "column_names", ("closest",))
        with pytest.raises(ModelFileError, match=r"has the columns \['closest'\], but the model"):
            load(tmp_path / "model")
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: [])
    with pytest.raises(ModelFileError, match=r"no feature 'shortest' is installed; install the"):
        load(tmp_path / "model")


def test_an_unregistered_feature_is_not_saved(known: LabelledMap, tmp_path: Path) -> None:
    labeler = unfitted(Shortest()).fit([known])
    with pytest.raises(OutputError, match=r"Shortest cannot be saved.*pgm_places\.features"):
        save(labeler, tmp_path / "model")


def test_a_scan_feature_serves_trajectories(
    known: LabelledMap, installed: None, tmp_path: Path
) -> None:
    centres = known.grid.cell_centres_m(np.argwhere(known.cells))[::40]
    poses = np.column_stack([centres, np.zeros(len(centres))])
    path = Trajectory(np.arange(len(poses), dtype=np.float64), poses)
    places = unfitted(Shortest()).fit([known])
    labeler = TrajectoryLabeler.from_places(places)
    _, on_map = places.scores(known.grid)
    scores = labeler.scores(path, known_map=known.grid)
    assert on_map.laser is not None
    np.testing.assert_allclose(scores, on_map.laser[::40], rtol=0, atol=1e-6)

    fitted = TrajectoryLabeler(
        NAMES,
        features=["shortest"],
        sensor=SENSOR,
        classifier=DecisionListClassifier(n_rounds=5, order="rarest-first"),
        n_folds=2,
        n_runs=20,
    ).fit([known])
    loaded = load(save(fitted, tmp_path / "model"))
    before, after = (one.scores(path, known_map=known.grid) for one in (fitted, loaded))
    np.testing.assert_array_equal(before, after)


def test_a_map_feature_serves_no_trajectory(known: LabelledMap) -> None:
    places = unfitted(East()).fit([known])
    refused(InputError, "East looks at a map's cells", TrajectoryLabeler.from_places, places)
    with pytest.raises(InputError, match="East looks at a map's cells"):
        TrajectoryLabeler(NAMES, features=[East()]).fit([known])


def config(features: object) -> dict[str, object]:
    return {
        "labels": {"names": list(NAMES)},
        "train": [{"generated": 0}],
        "features": features,
        "methods": [{"name": "independent"}],
    }


def test_a_configuration_names_them_with_options(installed: None) -> None:
    parsed = parse_config(config([{"name": "shortest", "n": 3}, {"name": "east"}]))
    assert tuple(make_labeler(parsed).features) == (Shortest(3), East())


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ([{"name": "shortes"}], "unknown feature 'shortes'. Did you mean 'shortest'?"),
        ([{"name": "shortest", "m": 3}], "feature 'shortest' has no option 'm'"),
        ([{"name": "shortest", "n": "3"}], "feature 'shortest': n must be a whole number"),
        ([{"name": "east", "n": 3}], "feature 'east' has no option 'n'. It has none"),
        ([{"n": 3}], "features[0] has no name"),
        ({"name": "shortest"}, "features must be tables; write [[features]] above each"),
        ([{"name": "east"}, {"name": "east"}], "two feature columns are called 'east'"),
    ],
)
def test_a_configuration_that_does_not_fit_is_refused(
    features: object, message: str, installed: None
) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config(config(features), "a.toml")
    assert str(caught.value).startswith("a.toml: ")
    assert message in str(caught.value)


def test_without_plugins_the_message_says_where_they_come_from() -> None:
    refused(ConfigError, r"unknown feature 'glass'.*pgm_places\.features", as_features, ["glass"])


@pytest.mark.parametrize("bad", [object(), "f2", 3])
def test_what_is_no_feature_is_refused(bad: object) -> None:
    refused(ConfigError, "feature", as_features, [bad])
    refused(ConfigError, "must be a list", as_features, "east")


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        (Broken(width=2), r"Broken\.of_scans\(\.\.\.\) must have shape \(3, 1\), got \(3, 2\)"),
        (Broken(value=np.nan), r"Broken\.of_scans\(\.\.\.\) must hold finite numbers, got nan"),
    ],
)
def test_what_a_feature_returns_is_checked(feature: Broken, message: str) -> None:
    with pytest.raises(InputError, match=message):
        feature_values(np.ones((3, 360), np.float32), (feature,), max_range_m=10.0)
