"""Tables of poses: names of columns, what is missing, what is wrong."""

from pathlib import Path

import numpy as np
import pytest

from pgm_places import ScanGeometry
from pgm_places.errors import LabelError, LogError
from pgm_places.io.logs.pose_csv import iter_pose_csv, read_pose_csv, write_pose_csv
from tests.io.logs.log_files import drive
from tests.real_data import real_data_folder


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    return path


def test_columns_are_found_by_name_in_any_order(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "y_m,other,label,t_s,x_m,heading_rad\n2,?,room,5,1,0.5\n")
    found = read_pose_csv(path).trajectory
    assert found.times_s.tolist() == [5.0]
    assert found.poses.tolist() == [[1.0, 2.0, 0.5]]
    assert (found.label_names, found.name) == (("room",), "a")


def test_what_is_missing_is_derived_and_degrees_become_radians(tmp_path: Path) -> None:
    found = read_pose_csv(write(tmp_path / "a.csv", "x,y\n0,0\n0,1\n0,2\n")).trajectory
    assert found.times_s.tolist() == [0, 1, 2]
    np.testing.assert_allclose(found.poses[:, 2], np.pi / 2, rtol=0, atol=1e-12)
    assert found.labels is None
    found = read_pose_csv(write(tmp_path / "a.csv", "\ufeffx,y,yaw_deg\n0,0,180\n")).trajectory
    np.testing.assert_allclose(found.poses[0, 2], np.pi, rtol=0, atol=1e-12)


def test_labels_may_come_from_any_column_in_any_order(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "x,y,place,kind\n0,0,room,B\n1,0,,A\n2,0,corridor,B\n")
    for options, names, labels in (
        ({}, ("corridor", "room"), [1, -1, 0]),
        ({"label_column": "kind", "label_names": ["B", "A", "C"]}, ("B", "A", "C"), [0, 1, 0]),
    ):
        found = read_pose_csv(path, **options).trajectory  # type: ignore[arg-type]
        assert found.label_names == names
        np.testing.assert_array_equal(found.labels, labels)
    with pytest.raises(LogError, match="no column for the places: wanted sort"):
        read_pose_csv(path, label_column="sort")


def test_an_unknown_place_is_refused_where_the_labels_are_given(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "x,y,label\n0,0,room\n1,0,attic\n")
    with pytest.raises(LabelError, match=r"row 2 .* label is 'attic', but the labels are room"):
        read_pose_csv(path, label_names=["room"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty; expected a line of column names"),
        ("x,y\n", "has column names but no rows"),
        ("x,t\n1,2\n", "no column for y in metres: wanted y_m or y, the columns are ['x', 't']"),
        ("x,y,x\n1,2,3\n", "the column 'x' appears twice"),
        ("x,y\n1\n", "row 1 after the header: 1 fields, but there are 2 columns"),
        ("x,y\n1,2\nnan,2\n", "row 2 after the header: x must be a finite number, got 'nan'"),
        ("x,y\n1,2\n1,1e308\n", "row 2 after the header: the pose (1, 1e+308, "),
        ("x,y,yaw\n1,-2e7,0\n", "must be metres and radians up to 1e+07; correct or remove"),
        ("x,y\n1,two\n", "y must be a finite number, got 'two'"),
        ('x,y\n"1,2\n', "not a table of comma-separated values"),
        ("x,y\n\udcff\udcfe,1\n", "not UTF-8 text; expected a table of poses"),
    ],
)
def test_what_is_no_such_table_is_one_message(tmp_path: Path, text: str, message: str) -> None:
    path = write(tmp_path / "a.csv", text)
    with pytest.raises(LogError) as caught:
        read_pose_csv(path)
    assert message in str(caught.value)


def test_a_growing_table_ends_at_a_pose_that_no_robot_has(tmp_path: Path) -> None:
    lines = [b"t,x,y\n", b"0,1,2\n", b"1,1,1e308\n"]
    rows = iter_pose_csv(tmp_path / "a.csv", lines)
    assert next(rows)[1].tolist() == [1.0, 2.0, 0.0]
    with pytest.raises(LogError, match="row 2 after the header: the pose"):
        next(rows)


@pytest.mark.parametrize("labelled", [True, False])
def test_a_written_table_reads_back(tmp_path: Path, labelled: bool) -> None:
    path = drive(ScanGeometry.half_circle(4), 9)
    if not labelled:
        path = type(path)(path.times_s, path.poses)
    written = write_pose_csv(tmp_path / "a.csv", path)
    again = read_pose_csv(written, label_names=path.label_names).trajectory
    for name in ("times_s", "poses", "labels"):
        np.testing.assert_array_equal(getattr(again, name), getattr(path, name))


@pytest.mark.real_data
@pytest.mark.parametrize(("column", "n_labels"), [(None, 3), ("category", 7)])
def test_real_labels_of_building_79(column: str | None, n_labels: int) -> None:
    path = real_data_folder("freiburg079") / "scan_labels.csv"
    found = read_pose_csv(path, label_column=column).trajectory
    assert len(found) == 4791
    assert found.label_names is not None
    assert len(found.label_names) == n_labels
