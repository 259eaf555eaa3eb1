"""Counts of objects in files and bags."""

from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import InputError, LogError
from pgm_places.features.object_counts import ObjectCounts
from pgm_places.io.logs.object_counts import read_detection_bag, read_object_counts
from tests.io.files import write_counts
from tests.io.logs.detection_files import detection_bag


def test_counts_survive_csv(tmp_path: Path) -> None:
    counts = ObjectCounts(
        np.array([0.1, 1e9 + 1 / 3]), np.array([[0, 2], [1, 0]]), ("coffee machine", 'a "cup", red')
    )
    again = read_object_counts(write_counts(tmp_path / "counts.csv", counts))
    assert again.object_names == counts.object_names
    assert (again.times_s == counts.times_s).all()
    assert (again.counts == counts.counts).all()


def test_json_names_only_what_was_seen(tmp_path: Path) -> None:
    path = tmp_path / "counts.json"
    path.write_text('[{"t_s": 2, "counts": {"cup": 1}}, {"t_s": 1, "counts": {"chair": 2.0}}]')
    counts = read_object_counts(path)
    assert counts.object_names == ("cup", "chair")
    assert counts.times_s.tolist() == [1.0, 2.0]
    assert counts.counts.tolist() == [[0, 2], [1, 0]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("time,cup\n1,2\n", "the header must name t_s"),
        ("t_s,cup\n1,2\n1\n", "row 2 after the header: 1 fields, but there are 2 columns"),
        ("t_s,cup\n1,-2\n", "row 1: cup must be a whole number from 0 to 2147483647, got -2"),
        ("t_s,cup\n1,x\n", "cup must be a finite number, got 'x'"),
        ("t_s,cup\nnan,1\n", "t_s must be a finite number"),
        ("\xff\xfe\0", "not UTF-8 text; expected counts of objects"),
        ("{", "not a JSON file"),
        ("{}", "must hold a list of records"),
        ('[{"t_s": 1}]', "record 1"),
        ('[{"t_s": 1, "counts": {"cup": true}}]', "cup must be a finite number"),
        ('[{"t_s": 1, "counts": {"cup": 0.5}}]', "cup must be a whole number from 0"),
    ],
)
def test_damage_is_said(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / ("a.json" if text.startswith(("{", "[")) else "a.csv")
    path.write_text(text, encoding="latin-1")
    with pytest.raises(LogError, match=words):
        read_object_counts(path)


def test_detections_of_several_cameras_are_added_up(tmp_path: Path) -> None:
    bag = detection_bag(
        tmp_path / "bag",
        [
            ("/left", 10.1, [("62", 0.9), ("62", 0.8), ("41", 0.3)]),
            ("/right", 10.2, [("62", 0.7)]),
            ("/left", 20.1, [("41", 0.6)]),
            ("/left", 20.3, [("62", 0.6)]),  # the same camera again: this one counts
        ],
    )
    counts = read_detection_bag(bag, names={"62": "monitor on"}, together_s=0.5)
    assert counts.object_names == ("monitor on",)
    assert counts.counts.tolist() == [[3], [1]]
    assert counts.times_s.tolist() == [10.25, 20.25]
    left = read_detection_bag(bag, topics=["/left"], min_score=0.0)
    assert left.object_names == ("41", "62")
    assert left.counts.tolist() == [[1, 2], [0, 1]]


def test_a_bag_without_such_a_topic(tmp_path: Path) -> None:
    bag = detection_bag(tmp_path / "bag", [("/left", 1.0, [])])
    with pytest.raises(LogError, match=r"lacks the topic /right of type .*: /left"):
        read_detection_bag(bag, topics=["/right"])
    with pytest.raises(InputError, match="together_s must be a number above 0"):
        read_detection_bag(bag, together_s=0.0)
    assert len(read_detection_bag(bag)) == 1
