"""``label`` with many maps: which arguments make a batch, what it prints, and how it ends."""

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pgm_places.io.maps.map_server import save_map
from pgm_places.simulation import generate_building
from tests.cli.conftest import Run, building_in


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a model and three floors, one of them without its image."""
    folder = building_in(tmp_path_factory.mktemp("made"))
    train = [sys.executable, "-m", "pgm_places", "train", str(folder / "config.toml")]
    subprocess.run([*train, "--out", str(folder / "model"), "-q"], check=True)
    for seed in (1, 2, 3):
        floor = folder / "floors" / f"f{seed}"
        floor.mkdir(parents=True)
        save_map(generate_building(seed, size="small", resolution_m=0.1).grid, floor / "map")
    (folder / "floors" / "f3" / "map.png").unlink()
    return folder


@pytest.fixture
def floors(made: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(made, tmp_path / "floors"))


def test_a_folder_is_a_batch_that_ends_with_3_where_a_map_is_bad(floors: Path, run: Run) -> None:
    out = floors / "out"
    label = ["label", floors / "floors", "--model", floors / "model", "--out", out]
    code, text, error = run(*label)
    assert code == 3
    assert text.splitlines() == [
        "3 maps: 2 labelled, 1 failed",
        f"  f3/map: {floors / 'floors/f3/map.yaml'}: its image 'map.png' is missing: no file "
        f"{floors / 'floors/f3/map.png'}; correct the key 'image' or put the image there",
        *(f"wrote {out / name}" for name in ("failures.csv", "index.html", "summary.csv")),
        "",
        "Next:",
        f"  open {out}/index.html in a browser",
    ]
    assert [line.partition(":")[0] for line in error.splitlines()] == ["labelling maps"]
    assert (out / "f1" / "map" / "labels.png").exists()
    single = [*label[:1], floors / "floors/f1/map.yaml", *label[2:]]
    code, _, error = run(*single, "--quiet")
    assert code == 2
    assert f"{out} has the results of a batch: choose another folder" in error
    code, text, _ = run(*single, "--quiet", "--jobs", 1)
    assert (code, text.splitlines()[0]) == (0, "1 map: 0 labelled, 1 already done")
    (floors / "floors" / "f3" / "map.yaml").unlink()
    code, text, _ = run(*label, "--quiet")
    assert code == 0
    assert text.splitlines()[0] == "2 maps: 0 labelled, 2 already done"


def test_one_map_is_a_batch_where_workers_are_asked_for(floors: Path, run: Run) -> None:
    map_yaml, out = floors / "map.yaml", floors / "out"
    code, _, error = run(
        "label", map_yaml, "-m", floors / "model", "-o", out, "--jobs", 1, "--memory", "4GB", "-q"
    )
    assert code == 0, error
    assert (out / "map" / "labels.png").exists()
    assert (out / "index.html").exists()


def test_maps_that_take_too_long_are_given_up(floors: Path, run: Run) -> None:
    label = ["label", floors / "floors", "-m", floors / "model", "-o", floors / "out", "-q"]
    code, text, _ = run(*label, "--time-limit", 0.001)
    assert code == 3
    for name in ("f1/map", "f2/map"):
        assert f"  {name}: time limit of 0.001 s exceeded; raise --time-limit" in text.splitlines()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"],
            "--jobs cannot be combined",
        ),
        (["--memory", "much"], "--memory expects a size such as 4GB"),
        (["--method", "adabost"], "Did you mean 'adaboost'"),
        (["--doorways", "doors"], "--doorways"),
        (["--shard", "0/4"], "--shard expects I/N with I from 1 to N"),
        (["--outputs", "picture"], "Did you mean 'pictures'"),
        (["--time-limit", "0"], "--time-limit"),
    ],
)
def test_flags_that_are_wrong_are_refused_before_the_work(
    floors: Path, run: Run, arguments: list[str], message: str
) -> None:
    out = floors / "out"
    code, _, error = run(
        "label", floors / "floors", "-m", floors / "model", "-o", out, *arguments, "-q"
    )
    assert code == 2
    assert message in error
    assert not out.exists()


def test_a_batch_that_was_killed_goes_on_where_it_stopped(floors: Path, run: Run) -> None:
    for seed in range(4, 12):
        save_map(
            generate_building(seed, size="small", resolution_m=0.1).grid,
            floors / "floors" / f"f{seed}",
        )
    out = floors / "out"

    def manifests() -> list[Path]:
        try:
            return [path for path in out.rglob("manifest.json") if ".tmp" not in str(path)]
        except FileNotFoundError:  # a temporary file has gone while the folder was read
            return []

    label = ["label", floors / "floors", "-m", floors / "model", "-o", out, "--jobs", 1, "-q"]
    with subprocess.Popen([sys.executable, "-m", "pgm_places", *map(str, label)]) as process:
        while len(manifests()) < 2:
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
    time.sleep(2)  # for the worker to see that its parent is gone
    done = {path: path.stat().st_mtime_ns for path in manifests()}
    assert 2 <= len(done) < 10
    code, text, _ = run(*label)
    assert code == 3
    assert text.splitlines()[0] == (
        f"11 maps: {10 - len(done)} labelled, {len(done)} already done, 1 failed"
    )
    assert all(path.stat().st_mtime_ns == time_ns for path, time_ns in done.items())
    assert not list(out.rglob(".*.tmp"))


def test_a_batch_is_planned_done_in_parts_and_listed_anew(floors: Path, run: Run) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    out = floors / "out"
    label = ["label", floors / "floors", "-m", floors / "model", "-o", out, "-j", 1, "-q"]
    code, text, _ = run(*label, "--dry-run")
    assert (code, out.exists()) == (0, False)
    assert text.splitlines() == [
        "3 maps: 3 to label; nothing was written",
        "to label: f1/map, f2/map, f3/map",
    ]
    for part in ("1/2", "2/2"):
        run(*label, "--shard", part, "--outputs", "none")
    code, text, _ = run(*label, "--retry-failed")
    assert (code, text.splitlines()[0]) == (3, "1 map: 0 labelled, 1 failed")
    lists = {name: (out / name).read_text() for name in ("summary.csv", "failures.csv")}
    (out / "summary.csv").unlink()
    shutil.rmtree(floors / "floors" / "f2")
    code, text, error = run("index", out, "--parquet", "-q")
    assert (code, error) == (0, "")
    assert text.splitlines() == [
        "2 maps labelled, 1 failed",
        "no longer in the input: f2/map; results are kept until you remove the folder",
        *(
            f"wrote {out / name}"
            for name in ("failures.csv", "index.html", "summary.csv", "places.parquet")
        ),
    ]
    rows = (out / "summary.csv").read_text().splitlines()
    before = lists["summary.csv"].splitlines()
    assert [row.split(",")[:6] for row in rows] == [row.split(",")[:6] for row in before]
    assert [row.rpartition(",")[2] for row in rows] == ["in_input", "yes", "no"]
    table = parquet.read_table(out / "places.parquet").to_pylist()
    places = json.loads((out / "f1" / "map" / "places.json").read_text())["regions"]
    first = [row for row in table if row["map"] == "f1/map"]
    assert [(row["place"], row["name"]) for row in first] == [
        (place["id"], place["name"]) for place in places
    ]
    assert [row["area_m2"] for row in first] == [place["area_m2"] for place in places]


def test_a_folder_without_labelled_maps_is_no_index(floors: Path, run: Run) -> None:
    code, _, error = run("index", floors / "floors")
    assert code == 2
    assert "no labelled map (a folder with " in error
    assert not list((floors / "floors").glob("*.csv"))
