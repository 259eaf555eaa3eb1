"""Bad input: one clear line on standard error, exit code 2, nothing left behind."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.conftest import CONFIG, Run


def map_image(folder: Path) -> Path:
    return next(path for path in (folder / "map.png", folder / "map.pgm") if path.exists())


def missing_image(folder: Path) -> None:
    map_image(folder).unlink()


def truncated_image(folder: Path) -> None:
    path = map_image(folder)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def huge_header(folder: Path) -> None:
    map_image(folder).write_bytes(b"P5\n1000000 1000000\n255\n\x00")


def not_an_image(folder: Path) -> None:
    map_image(folder).write_text("hello")


def labels_of_another_size(folder: Path) -> None:
    Image.fromarray(np.zeros((5, 7), np.uint8)).save(folder / "labels.png")


def missing_labels(folder: Path) -> None:
    (folder / "labels.png").unlink()


def nan_resolution(folder: Path) -> None:
    path = folder / "map.yaml"
    lines = path.read_text().splitlines()
    lines = ["resolution: .nan" if line.startswith("resolution") else line for line in lines]
    path.write_text("\n".join(lines))


def edit(folder: Path, old: str, new: str) -> None:
    assert old in CONFIG
    (folder / "config.toml").write_text(CONFIG.replace(old, new, 1))


def window_outside(folder: Path) -> None:
    edit(folder, "[[test]]\n", "[[test]]\ncolumns = [100000, 100010]\n")


def empty_window(folder: Path) -> None:
    edit(folder, "[[train]]\n", "[[train]]\nrows = [5, 5]\n")


def class_without_examples(folder: Path) -> None:
    edit(folder, "[[train]]\n", "[[train]]\ncolumns = [0, 12]\n")


def unknown_method(folder: Path) -> None:
    edit(folder, 'name = "relaxation"', 'name = "relaxaton"')


def option_out_of_range(folder: Path) -> None:
    edit(folder, "max_iterations = 5", "max_iterations = -5")


def typo(folder: Path) -> None:
    edit(folder, "[classifier]", "[clasifier]")


def no_test_maps(folder: Path) -> None:
    edit(folder, "[[test]]", "[[train]]")


def config_missing(folder: Path) -> None:
    (folder / "config.toml").unlink()


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (missing_image, ["map"]),
        (truncated_image, ["map", "truncated"]),
        (huge_header, ["1000000"]),
        (not_an_image, ["map"]),
        (labels_of_another_size, ["labels.png"]),
        (missing_labels, ["labels.png"]),
        (nan_resolution, ["resolution"]),
        (window_outside, ["columns"]),
        (empty_window, ["rows"]),
        (class_without_examples, ["train"]),
        (unknown_method, ["relaxaton", "Did you mean 'relaxation'"]),
        (option_out_of_range, ["iterations", "-5"]),
        (typo, ["clasifier", "Did you mean 'classifier'"]),
        (no_test_maps, ["[[test]]"]),
        (config_missing, ["config.toml"]),
    ],
)
def test_one_clear_line(spoil, words: list[str], building: Path, run: Run) -> None:  # type: ignore[no-untyped-def]
    spoil(building)
    out = building / "out"
    code, _, error = run("compare", building / "config.toml", "--out", out, "--quiet")
    assert code == 2
    lines = [line for line in error.splitlines() if line and not line.startswith("warning: ")]
    assert len(lines) == 1
    assert lines[0].startswith("pgm-places: ")
    for word in words:
        assert word in lines[0]
    assert not out.exists() or not any(out.iterdir())


def test_a_file_in_the_way_of_the_output_folder(building: Path, run: Run) -> None:
    (building / "out").write_text("mine")
    code, _, error = run("compare", building / "config.toml", "--out", building / "out", "-q")
    assert code == 2
    assert "is a file" in error or "in the way" in error
    assert (building / "out").read_text() == "mine"


def test_a_folder_that_is_no_model_is_not_overwritten(building: Path, run: Run) -> None:
    code, _, error = run("train", building / "config.toml", "--out", building, "-q")
    assert code == 2
    assert (building / "map.yaml").exists()
    assert len(error.strip().splitlines()) == 1


def test_a_model_that_is_none(building: Path, run: Run) -> None:
    arguments = ["label", building / "map.yaml", "--out", building / "x"]
    for model in (building, building / "nowhere"):
        code, _, error = run(*arguments, "--model", model)
        assert code == 2
        assert str(model) in error


def test_a_method_that_cannot_be_saved_is_refused_before_the_training(
    building: Path, run: Run
) -> None:
    edit(building, 'name = "relaxation"\n', 'name = "tests.inference.test_backends:AlwaysFirst"\n')
    text = (building / "config.toml").read_text().replace("max_iterations = 5", "id = 'first'")
    (building / "config.toml").write_text(text)
    code, _, error = run("train", building / "config.toml", "--out", building / "model", "-q")
    assert code == 2
    assert "AlwaysFirst cannot be saved" in error
    assert "pgm_places.inference.backends" in error
    assert not (building / "model").exists()
