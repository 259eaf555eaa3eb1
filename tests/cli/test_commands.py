"""The commands do what they say, and write everything they promise."""

import functools
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pgm_places.inference.labeling import Status
from pgm_places.io.output_set import RECORD_FILE
from pgm_places.io.staging import file_names
from pgm_places.labelling import files as label_files
from pgm_places.simulation import building as building_module
from tests.cli.conftest import Run


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


def test_compare_writes_results_and_report(building: Path, run: Run) -> None:
    out = building / "out"
    code, text, _ = run("compare", building / "config.toml", "--out", out, "--quiet")
    assert code == 0
    assert "adaboost" in text
    assert "relaxation" in text
    results = json.loads((out / "results.json").read_text())
    for method in ("adaboost", "relaxation"):
        found = results["methods"][method]
        confusion = np.array(found["confusion"])
        assert found["accuracy"] == pytest.approx(np.trace(confusion) / confusion.sum())
        assert set(found["recall"]) == {"corridor", "room", "doorway"}
        assert {"balanced_accuracy", "macro_f1", "precision", "seconds"} <= set(found)
    doors_table = text.partition("Doors: found / missed / invented")[2]
    for method in ("adaboost", "relaxation"):
        doors = results["methods"][method]["doors"]
        row = next(line for line in doors_table.splitlines() if line.startswith(method))
        counted = "/".join(str(doors[name]) for name in ("found", "missed", "invented"))
        assert counted in row.split()
    assert results["config"]["methods"][1]["max_iterations"] == 5
    assert len(results["inputs"]) == 4
    assert {"numpy", "scipy", "pgm-places"} <= set(results["versions"])
    html = (out / "report.html").read_text()
    assert html.lstrip().lower().startswith("<!doctype html>")
    assert {path.name for path in out.iterdir()} == {RECORD_FILE, *label_files.COMPARISON}


def test_train_then_label(building: Path, run: Run) -> None:
    code, text, _ = run("train", building / "config.toml", "--out", building / "model", "-q")
    assert code == 0
    assert "methods: adaboost, relaxation" in text
    out = building / "labelled"
    code, text, _ = run(
        "label", building / "map.yaml", "--model", building / "model", "--out", out, "-q"
    )
    assert code == 0
    assert "% free" in text
    source, written = pixels(building / "map.png"), pixels(out / "labels.png")
    assert written.shape == source.shape
    summary = json.loads((out / "details/summary.json").read_text())
    assert summary["method"] == "relaxation"
    status = Status(summary["status"])
    assert summary["status_meaning"] == status.meaning
    assert (f"({status}: {status.meaning})" in text) == bool(status.note)
    labels = ("corridor", "room", "doorway")
    assert file_names(out) == {RECORD_FILE, *label_files.output_file_names(labels)}

    rows = (out / "check.csv").read_text().splitlines()
    regions = json.loads((out / "places.json").read_text())["regions"]
    assert len(rows) == 1 + len(regions)
    assert "Uncertain: " in text
    assert text.splitlines()[-4:] == [
        "Next:",
        f"  open {out}/index.html in a browser",
        f"  pgm-places studio {building / 'map.yaml'}  # to correct the labels",
        f"  pgm-places export {out} --to nav2 --out nav2  # --robot-radius 0.2, in metres",
    ]

    truth = pixels(building / "labels.png")
    known = truth > 0
    assert (truth[known] == written[known]).mean() > 0.85


HEAVY = {"cvxpy", "matplotlib", "networkx", "pandas", "scipy", "sklearn"}
LEARNING = {"pgm_places.labelers.place_learning", "pgm_places.unary.learning"}


def test_label_imports_nothing_heavy(building: Path) -> None:
    command = [sys.executable, "-X", "importtime", "-m", "pgm_places", "label"]
    said = subprocess.run(
        [*command, building / "map.yaml", "--out", building / "out", "--quiet"],
        capture_output=True,
        text=True,
        check=True,
    )
    imported = {line.rpartition("|")[2].strip() for line in said.stderr.splitlines()}
    assert "pgm_places.unary.space_model" in imported
    assert imported & (HEAVY | LEARNING) == set()


def test_label_by_another_method(building: Path, run: Run) -> None:
    _, text, _ = run("train", building / "config.toml", "--out", building / "model", "-q")
    assert text.endswith(f"label map.yaml --model {building}/model --out labelled  # any map\n")
    arguments = ["label", building / "map.yaml", "-m", building / "model", "-o", building / "x"]
    code, _, error = run(*arguments, "--method", "adabost", "-q")
    assert code == 2
    assert "Did you mean 'adaboost'" in error
    assert not (building / "x").exists()
    described = (building / "map.yaml").read_text()
    turned = re.sub(r"(origin: .*), [^,]*]", r"\1, .nan]", described)
    (building / "map.yaml").write_text(turned)
    code, _, error = run(*arguments, "--method", "adaboost", "--halls", "room", "-q")
    assert code == 0
    assert "--halls: this model was not trained to tell halls from corridors" in error
    assert error.count("the yaw of the origin is .nan") == 1


def test_progress_is_a_line_per_stage_without_a_terminal(building: Path) -> None:
    command = [sys.executable, "-m", "pgm_places", "compare", str(building / "config.toml")]
    done = subprocess.run(
        [*command, "--out", str(building / "out")], capture_output=True, text=True, check=True
    )
    assert "decision list: " in done.stderr
    assert "\x1b" not in done.stderr


def test_train_on_a_generated_building(
    building: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = functools.partial(building_module.generate_building, size="small")
    monkeypatch.setattr(building_module, "generate_building", small)
    files, config = 'map = "map.yaml"\nlabels = "labels.png"', building / "config.toml"
    config.write_text(config.read_text().replace(files, "generated = 1", 1))
    code, _, err = run("train", config, "--out", building / "model")
    assert code == 0, err
    assert (building / "model" / "manifest.json").is_file()


def test_compare_says_what_it_selected_on_the_training_maps(building: Path, run: Run) -> None:
    config = building / "config.toml"
    config.write_text(
        config.read_text()
        + '\n[select]\nmethod = "adaboost"\nn_folds = 2\n'
        + '[select.options]\n"classifier.n_rounds" = [2, 12]\n'
    )
    code, text, _ = run("compare", config, "--out", building / "out", "--quiet")
    assert code == 0
    results = json.loads((building / "out" / "results.json").read_text())
    chosen = results["selection"]["chosen"]["classifier.n_rounds"]
    assert results["config"]["classifier"]["n_rounds"] == chosen
    assert f"classifier.n_rounds = {chosen}" in text
    assert len(results["selection"]["candidates"]) == 2
