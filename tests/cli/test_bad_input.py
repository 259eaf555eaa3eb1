"""Bad input: one clear line on standard error, exit code 2, nothing left behind."""

from pathlib import Path

import pytest

from tests.cli.conftest import CONFIG, Run


@pytest.mark.parametrize(
    ("file", "change", "words"),
    [
        ("map.png", None, ["map"]),
        ("map.png", ("", "hello"), ["map"]),
        ("labels.png", None, ["labels.png"]),
        ("config.toml", None, ["config.toml"]),
        ("config.toml", ("[[test]]\n", "[[test]]\ncolumns = [100000, 100010]\n"), ["columns"]),
        ("config.toml", ("[[train]]\n", "[[train]]\nrows = [5, 5]\n"), ["rows"]),
        ("config.toml", ("[[train]]\n", "[[train]]\ncolumns = [0, 12]\n"), ["train"]),
        ("config.toml", ("relaxation", "relaxaton"), ["relaxaton", "Did you mean 'relaxation'"]),
        ("config.toml", ("iterations = 5", "iterations = -5"), ["iterations", "-5"]),
        ("config.toml", ("[classifier]", "[clasifier]"), ["Did you mean 'classifier'"]),
        ("config.toml", ("[[test]]", "[[train]]"), ["[[test]]"]),
    ],
)
def test_one_clear_line(
    file: str, change: tuple[str, str] | None, words: list[str], building: Path, run: Run
) -> None:
    path, out = building / file, building / "out"
    if change is None:
        path.unlink()
    else:
        path.write_text(CONFIG.replace(*change, 1) if change[0] else change[1])
    code, _, error = run("compare", building / "config.toml", "--out", out, "--quiet")
    assert code == 2
    [line] = [line for line in error.splitlines() if line and not line.startswith("warning: ")]
    assert line.startswith("pgm-places: ")
    assert all(word in line for word in words)
    assert not out.exists() or not any(out.iterdir())


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
    text = CONFIG.replace('"relaxation"', '"tests.inference.test_backends:AlwaysFirst"')
    (building / "config.toml").write_text(text.replace("max_iterations = 5", "id = 'first'"))
    code, _, error = run("train", building / "config.toml", "--out", building / "model", "-q")
    assert code == 2
    assert "AlwaysFirst cannot be saved" in error
    assert "pgm_places.inference.backends" in error
    assert not (building / "model").exists()
