"""What maps, drives and results draw: where, in which colours, and what notebooks show."""

import io
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.axes import Axes
from PIL import Image

import pgm_places as p
from pgm_places import palette
from pgm_places.errors import InputError, LabelError
from pgm_places.evaluation.bootstrap import Interval
from pgm_places.graph.layout import GridLayout
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.inference.potentials import Potentials
from pgm_places.labelers.labelled_places import LabelledPlaces
from pgm_places.models.decoding import decode
from tests.report.comparisons import small_comparison

NAMES = ("corridor", "room")
CELLS = np.full((12, 16), -1, np.int8)
CELLS[2:8, 3:13] = 100
CELLS[3:7, 4:12] = 0


@pytest.fixture(autouse=True)
def _no_windows() -> Iterator[None]:
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


def path(poses: Any) -> p.Trajectory:
    return p.Trajectory(np.arange(float(len(poses))), np.array(poses, float))


def some_grid(yaw_rad: float = 0.0) -> p.OccupancyGrid:
    return p.OccupancyGrid(CELLS, 0.5, (10.0, 20.0), yaw_rad)


def some_places(beliefs: bool = True) -> LabelledPlaces:
    grid = some_grid()
    layout = GridLayout.of_map(grid)
    columns = layout.cells_rc[:, 1]
    labels = (columns >= 8).astype(np.int64)
    rows = np.where(labels[:, None] == [0, 1], 0.75, 0.25) if beliefs else None
    labeling = Labeling(labels, Status.CONVERGED, rows)
    raster = layout.to_raster(labels, fill=-1).astype(np.int16)
    return LabelledPlaces(grid, raster, layout, labeling, NAMES, "potts")


def pixel(ax: Any, x: float, y: float) -> tuple[int, ...]:
    """The colour of the rendered figure at a position of the axes' data."""
    figure = ax.figure
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())
    column, row = ax.transData.transform((x, y))
    return tuple(int(value) for value in image[image.shape[0] - 1 - int(row), int(column), :3])


def rgb(colour: str) -> tuple[int, ...]:
    return tuple(int(value) for value in palette.rgb_of(colour))


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_cells_are_drawn_where_they_lie_in_the_map_frame(yaw: float) -> None:
    grid = some_grid(yaw)
    ax: Any = grid.plot()
    for cell, colour in (((4, 6), "#ffffff"), ((2, 6), palette.WALL)):
        [position] = grid.cell_centres_m([cell])
        assert pixel(ax, *position) == rgb(colour)


def test_the_view_is_of_what_is_known() -> None:
    (left, right), (low, high) = (
        limits(some_grid().plot()) for limits in (Axes.get_xlim, Axes.get_ylim)
    )
    assert 10.0 < left < 11.5 and 16.5 < right < 18.0
    assert 20.0 < low < 21.0 and 24.0 < high < 26.0


def test_labels_have_the_colours_of_all_pictures() -> None:
    places = some_places()
    ax: Any = places.plot()
    for cell, name in (((4, 5), 0), ((4, 10), 1)):
        [position] = places.grid.cell_centres_m([cell])
        assert pixel(ax, *position) == rgb(palette.label_colours(NAMES)[name])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == list(NAMES)


@pytest.mark.parametrize(("show", "value"), [("probability", 0.75), ("uncertainty", 0.8113)])
def test_values_of_cells_are_those_of_the_beliefs(show: Any, value: float) -> None:
    ax: Any = some_places().plot(show=show)
    shown = np.ma.masked_invalid(ax.images[-1].get_array())
    assert shown.count() == np.count_nonzero(CELLS == 0)
    assert shown.compressed() == pytest.approx(value, abs=1e-4)


def test_without_beliefs_there_is_no_uncertainty_to_show() -> None:
    with pytest.raises(InputError, match="potts has no beliefs, so its uncertainty is unknown"):
        some_places(beliefs=False).plot(show="uncertainty")


def test_a_topological_map_draws_its_places_and_connections() -> None:
    places = some_places()
    topology = p.topological_map(places.grid, places.labels, NAMES, correct=False)
    ax: Any = topology.plot()
    assert {text.get_text() for text in ax.texts} == {region.name for region in topology.regions}
    assert len(ax.lines) == len(topology.connections) == 1
    [connection] = topology.connections
    assert tuple(ax.lines[0].get_xydata()[1]) == connection.point_m
    graph = topology.to_networkx()
    graph.remove_node(1)
    assert len(topology.graph) == 2


def test_a_drive_is_drawn_over_a_map() -> None:
    drive = path([[12.5, 22, 0], [13, 22, 0], [14.5, 22, 0]])
    ax: Any = some_grid().plot()
    assert drive.with_labels([0, 1, -1], NAMES).plot(ax) is ax
    assert ax.lines[0].get_xydata() == pytest.approx(drive.poses[:, :2])
    dots = [np.asarray(dots.get_offsets()).tolist() for dots in ax.collections]
    assert dots == [[[12.5, 22.0]], [[13.0, 22.0]]]


def test_beliefs_are_stacked_to_one() -> None:
    labeling = Labeling(np.array([0, 1]), Status.EXACT, np.array([[0.7, 0.3], [0.2, 0.8]]))
    ax: Any = labeling.plot_beliefs(NAMES, along=[0.0, 2.5], xlabel="time (s)")
    tops = [part.get_paths()[0].vertices[:, 1].max() for part in ax.collections]
    assert tops == pytest.approx([0.7, 1.0])
    assert ax.get_xlabel() == "time (s)" and ax.get_xlim() == (0.0, 2.5)
    with pytest.raises(InputError, match="label_names must be 2, got 1"):
        labeling.plot_beliefs(["corridor"])


def test_convergence_shows_the_bound_and_the_score() -> None:
    graph = p.LabelGraph.from_lattice((6, 6))
    unary = np.random.default_rng(0).normal(size=(36, 3))
    labeling = decode(graph, Potentials.potts(unary, 0.5), "trw-s")
    lines = {line.get_label(): line.get_ydata() for line in labeling.plot_convergence().lines}
    assert lines["bound"] == pytest.approx(labeling.info["history"])
    assert lines["score"] == pytest.approx(labeling.info["score_history"])
    cut: Any = decode(graph, Potentials.potts(unary, 0.5), "graph-cut").plot_convergence()
    assert cut.get_ylabel() == "score" and all(tick % 1 == 0 for tick in cut.get_xticks())
    problem = p.LabelingProblem(graph, ["a", "b", "c"], unary)
    relaxed = p.build("relaxation", compatibility=np.eye(3)).infer(problem)
    ax: Any = relaxed.plot_convergence()
    assert ax.get_ylabel() == "support"
    assert ax.lines[0].get_ydata() == pytest.approx(relaxed.info["history"]["support"])
    with pytest.raises(InputError, match="no figure by iteration"):
        Labeling(np.array([0]), Status.EXACT).plot_convergence()


def test_ground_truth_without_names_shows_numbers() -> None:
    places = some_places()
    known = p.LabelledMap(places.grid, places.labels)
    legend: Any = known.plot().get_legend()
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["label 0", "label 1"]
    with pytest.raises(LabelError, match="label"):
        known.plot(label_names=["corridor"])


def test_notebooks_show_pictures_and_leave_no_figure_open() -> None:
    places = some_places()
    drive = path([[12, 22, 0], [13, 22, 0]])
    topology = p.topological_map(places.grid, places.labels, NAMES)
    truth = p.LabelledMap(places.grid, places.labels)
    for item in (places.grid, truth, places, topology, drive):
        assert Image.open(io.BytesIO(item._repr_png_())).size == (640, 480)
    assert pyplot.get_fignums() == []


def test_a_huge_map_is_drawn_from_every_other_cell() -> None:
    ax: Any = p.OccupancyGrid(np.zeros((10, 4001), np.int8), 0.05).plot()
    assert max(ax.images[0].get_array().shape) <= 2001
    assert ax.get_xlim()[1] >= 4001 * 0.05


def test_a_labeling_is_a_table_with_its_status_in_words() -> None:
    table = Labeling(np.zeros(1200, int), Status.EXACT, score=-0.5, bound=-0.5)._repr_html_()
    assert "1,200" in table and Status.EXACT.meaning in table and "decoder" not in table


def test_tables_hold_places_and_steps() -> None:
    pytest.importorskip("pandas")
    places = some_places()
    topology = p.topological_map(places.grid, places.labels, NAMES, correct=False)
    table = topology.to_dataframe()
    assert table["name"].tolist() == [region.name for region in topology.regions]
    assert table.loc[1, "neighbours"] == (2,)
    assert table["area_m2"].sum() == pytest.approx(np.count_nonzero(CELLS == 0) * 0.25)
    drive = path([[1, 2, 0.5], [3, 4, 0]]).with_labels([1, -1], NAMES)
    steps = drive.to_dataframe()
    assert steps.loc[0].to_dict() == {
        "time_s": 0.0, "x_m": 1.0, "y_m": 2.0, "heading_rad": 0.5, "label": "room",
    }  # fmt: skip
    assert steps["label"].isna().tolist() == [False, True]


def test_a_comparison_draws_its_methods_with_intervals() -> None:
    comparison = small_comparison()
    first, second = comparison.methods
    sure = replace(first, intervals={"accuracy": Interval(0.96, 0.8, 0.99)})
    ax: Any = replace(comparison, methods=(sure, second)).plot()
    assert [label.get_text() for label in ax.get_yticklabels()] == ["plain", "relaxation"]
    widths = [round(bar.get_width(), 6) for bar in ax.patches]
    accuracy = 100 * first.evaluation.accuracy
    assert widths[:2] == [round(accuracy, 6)] * 2
    ends = ax.collections[0].get_segments()[0][:, 0]
    assert ends == pytest.approx([80.0, 99.0])
    assert Image.open(io.BytesIO(comparison._repr_png_())).size == (640, 480)


def test_a_comparison_is_a_table_by_method() -> None:
    pytest.importorskip("pandas")
    table = small_comparison().to_dataframe()
    assert table.index.tolist() == ["plain", "relaxation"]
    evaluation = small_comparison().methods[0].evaluation
    assert table.loc["plain", "balanced_accuracy"] == evaluation.balanced_accuracy
    assert table.loc["plain", "recall_doorway"] == evaluation.recall["doorway"]
    assert table["accuracy_low"].isna().all()
    assert table["seconds_learn"].tolist() == [1.5, 1.5]
