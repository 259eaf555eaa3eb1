"""Tables, pictures and scores that the paper's experiments share."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.paper.comparison_pictures import error_sheet, label_sheet, window_grid
from experiments.paper.figures import away_from_borders, finding, method_table, percent
from experiments.paper.markdown import overview_table
from experiments.paper.scored_steps import scored_steps
from experiments.paper.section import Finding, Section
from pgm_places.experiment.comparison import score_intervals
from pgm_places.experiment.evaluated_items import EvalMap
from pgm_places.inference.labeling import Labeling, Status
from pgm_places.maps.occupancy_grid import UNKNOWN
from pgm_places.trajectories.trajectory import Trajectory
from tests.report.comparisons import NAMES, small_comparison, small_map


def test_a_method_s_line_has_its_interval() -> None:
    comparison = small_comparison()
    method = comparison.methods[0]
    labelled = replace(
        method, intervals=score_intervals(comparison.maps, [method.labelings], len(NAMES))
    )
    line = finding("cells", labelled, paper=0.973)
    assert line.accuracy == pytest.approx(26 / 27)
    assert line.interval is not None
    assert line.interval[0] < 26 / 27 < line.interval[1]
    table = method_table("Methods", {"5 cm": replace(comparison, methods=(labelled,))})
    assert table.rows[0][:3] == ("5 cm", "plain", "96.3")
    assert table.rows[0][3] == f"{percent(line.interval[0])} to {percent(line.interval[1])}"


def test_cells_at_a_border_do_not_count_away_from_borders() -> None:
    comparison = small_comparison()
    # Labels change from column to column of 0.5 m: everything is within 0.3 m of a border.
    assert away_from_borders(comparison, comparison.methods[0]) is None
    item = comparison.maps[0]
    assert isinstance(item, EvalMap)
    one = replace(item, truth=np.where(item.truth >= 0, 0, -1).astype(np.int16))
    wrong = replace(comparison, maps=(one,))
    found = away_from_borders(wrong, comparison.methods[0])
    assert found == pytest.approx(comparison.methods[0].evaluation.confusion[0, 0] / 27, abs=0.1)


def test_pictures_show_the_tested_part_of_the_map_only() -> None:
    item = small_map()
    window = np.zeros(item.grid.shape, np.bool_)
    window[2:4, 3:5] = True
    shown = window_grid(item.grid, window)
    assert (shown.cells[2:4, 3:5] == item.grid.cells[2:4, 3:5]).all()
    assert (shown.cells[:, 7:] == UNKNOWN).all()
    comparison = small_comparison()
    for sheet in (label_sheet, error_sheet):
        assert sheet(comparison)[1:4] == b"PNG"


def test_steps_without_a_true_place_do_not_count() -> None:
    poses = np.column_stack([np.arange(40.0), np.zeros((40, 2))])
    truth = np.array([0, 1, -1, 1] * 10)
    drive = Trajectory(np.arange(40.0), poses, labels=truth, label_names=("room", "doorway"))
    labeling = Labeling(np.ones(40, np.int64), Status.CONVERGED)
    found = scored_steps([drive, drive], [labeling, labeling], ("room", "doorway"))
    assert found.evaluation.n == 60
    assert found.evaluation.accuracy == pytest.approx(2 / 3)
    assert found.interval.low < 2 / 3 < found.interval.high
    assert found.finding("steps", "as printed", paper=0.5).doorway_f1 == pytest.approx(0.8)


def test_ablations_stand_in_the_overview_only_by_themselves() -> None:
    def section(key: str, paper: str) -> Section:
        return Section(key, "T", paper, True, 1.0, "1", "s", (Finding(f"what {key}", 0.5),))

    both = overview_table([section("7.1", "97.3 %"), section("beams", "")])
    assert [row[0] for row in both.rows] == ["7.1 what 7.1"]
    alone = overview_table([section("beams", "")])
    assert [row[0] for row in alone.rows] == ["beams what beams"]


def test_both_ways_stand_in_one_row_of_the_overview() -> None:
    findings = (
        Finding("filter", 0.9, 0.8, paper=0.912, way="as printed"),
        Finding("filter", 0.95, 0.7),
        Finding("doors", counts="6 of 7", way="as printed"),
    )
    table = overview_table([Section("7.2", "T", "p", True, 1.0, "1", "s", findings)])
    assert table.heading == ("experiment", "buildings", "paper", "as printed", "by default")
    assert table.rows == (
        ("7.2 filter", "real", "91.2", "90.0 / 80.0", "95.0 / 70.0"),
        ("7.2 doors", "real", "-", "6 of 7", "-"),
    )
