"""Places from the command line: found, kept, exported, asked for."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from pgm_places import load_topology
from pgm_places.io.output_set import RECORD_FILE
from pgm_places.io.staging import file_names
from pgm_places.labelling.files import PLACES
from pgm_places.topology.regions import extent
from tests.cli.conftest import Run


@pytest.fixture
def places(building: Path, run: Run) -> Path:
    """A folder that the topology command wrote."""
    out = building / "places"
    code, text, _ = run(
        "topology", building / "labels.png", building / "map.yaml", "--out", out, "-q"
    )
    assert code == 0
    assert "places: " in text
    return out


def test_topology_writes_files_and_a_picture(places: Path) -> None:
    assert file_names(places) == {RECORD_FILE, *PLACES, "details/settings.json"}
    page = (places / "index.html").read_text()
    assert '<a href="details/">' in page and "check.csv" not in page  # no probabilities are known
    found = json.loads((places / "places.json").read_text())
    assert {region["label"] for region in found["regions"]} == {"corridor", "room", "doorway"}
    assert found["connections"]


def test_a_second_run_keeps_ids_and_takes_the_users_names(
    building: Path, places: Path, run: Run
) -> None:
    before = json.loads((places / "places.json").read_text())["regions"]
    (places / "place_names.yaml").write_text(f"{before[0]['id']}: my place\n")
    assert (
        run("topology", building / "labels.png", building / "map.yaml", "-o", places, "-q")[0] == 0
    )
    after = json.loads((places / "places.json").read_text())["regions"]
    assert [region["id"] for region in after] == [region["id"] for region in before]
    assert after[0]["name"] == "my place"
    assert [region["name"] for region in after[1:]] == [region["name"] for region in before[1:]]
    assert (places / "place_names.yaml").read_text().endswith("my place\n")


def test_topology_takes_other_names_and_another_grey_for_unknown(building: Path, run: Run) -> None:
    names = (building / "labels.yaml").read_text().replace("room", "office")
    (building / "other.yaml").write_text(names)
    image, described, out = building / "labels.png", building / "map.yaml", building / "out"
    assert run("topology", image, described, "-o", out, "--names", building / "other.yaml")[0] == 0
    regions = json.loads((out / "places.json").read_text())["regions"]
    assert {region["label"] for region in regions} == {"corridor", "office", "doorway"}
    free = run("topology", image, described, "-o", out, "--unknown-value", 254, "-q")
    assert free[0] == 2 or "places: 0" in free[1]


def test_where(places: Path, run: Run) -> None:
    region = json.loads((places / "places.json").read_text())["regions"][0]
    code, text, _ = run("where", places, *region["anchor_m"])
    assert code == 0
    assert region["name"] in text
    assert "next to: " in text
    assert run("where", places, "attic", 1)[2].endswith("X must be a finite number, got 'attic'\n")
    assert "there is no place 'attic'. Known: " in run("where", places, "attic")[2]
    code, text, _ = run("where", places, -1000, -1000)
    assert code == 1
    assert "no place at this position" in text


@pytest.mark.parametrize(
    ("to", "options", "names"),
    [
        ("nav2-route", ["--keep-out", "room"], ["nav2_route.geojson", "nav2_route.png"]),
        (
            "nav2",
            ["--set", "corridor=0.8", "--keep-out", "room"],
            [
                *("nav2_route.geojson", "nav2_params.yaml", "bringup.launch.py"),
                *("places.launch.py", "go_to_place.py", "poses.yaml"),
            ],
        ),
        ("zones", [], ["zones.png", "zones.yaml", "zones_params.yaml"]),
        ("keepout", ["--set", "room=100"], ["keepout.png"]),
        ("graphml", [], ["places.graphml"]),
        ("geotiff", [], ["regions.tif", "labels.tif"]),
    ],
)
def test_export(to: str, options: list[str], names: list[str], places: Path, run: Run) -> None:
    out = places / "exported"
    code, text, _ = run("export", places, "--to", to, "--out", out, *options)
    assert code == 0
    for name in names:
        assert (out / name).exists()
        assert name in text


def test_nav2_without_routes_says_so_and_writes_the_rest(places: Path, run: Run) -> None:
    code, out, _ = run("export", places, "--to", "nav2", "--robot-radius", "1.0")
    assert code == 0
    assert "no route graph: no two places are connected by a passage wide enough" in out
    assert (places / "poses.yaml").exists()
    assert not (places / "nav2_route.geojson").exists()
    launch, beside = out.splitlines()[-2:]
    assert launch.startswith(f"  ros2 launch {places / 'bringup.launch.py'} params_file:=")
    assert beside.startswith(f"  ros2 launch {places / 'places.launch.py'}  # Humble, Jazzy")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["export", "--to", "nav2-rout"], "Did you mean 'nav2-route'"),
        (["export", "--to", "nav"], "Did you mean 'nav2'? Known: binary,"),
        (["export", "--to", "mapp"], "Did you mean 'map'"),
        (["export", "--to", "waypoints"], "zones; 'pgm-places export --help' describes them"),
        (["export", "--to", "dot", "--keep-out", "room"], "accepts no --keep-out; nav2 and"),
        (["export", "--to", "nav2-route", "--keep-out", "rom"], "there is no class or place 'rom'"),
        (["export", "--to", "nav2-route", "--map", "m.yaml"], "accepts no --map; nav2 and map do"),
        (["export", "--to", "nav2", "--keep-out", "rom"], "there is no class or place 'rom'"),
        (
            ["export", "--to", "keepout"],
            "needs values by class or place, such as room=100; classes: ",
        ),
        (["export", "--to", "keepout", "--set", "room"], "NAME=NUMBER"),
        (["export", "--to", "keepout", "--set", "room=12345678901"], "NAME=NUMBER"),
        (["export", "--to", "keepout", "--set", "rom=3"], "there is no class or place 'rom'"),
        (["export", "--to", "keepout", "--set", "room=101"], "must be 0 to 100, got 101"),
        (["export", "--to", "dot", "--set", "room=1"], "accepts no values"),
        (["export", "--to", "nav2-route", "--robot-radius", "50"], "no two places are connected"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], words: str, places: Path, run: Run) -> None:
    code, _, error = run(arguments[0], places, *arguments[1:])
    assert code == 2
    assert words in error
    assert len(error.strip().splitlines()) == 1


def test_label_writes_places_with_the_models_rules(building: Path, run: Run) -> None:
    config = building / "config.toml"
    config.write_text(config.read_text() + "\n[topology]\nmin_area_m2 = 1e6\n")
    code, _, error = run("train", config, "--out", building / "model", "-q")
    assert (code, error) == (0, "")
    out = building / "labelled"
    code, text, _ = run("label", building / "map.yaml", "-m", building / "model", "-o", out, "-q")
    assert code == 0
    assert " relabelled or dropped\n" in text
    found = json.loads((out / "places.json").read_text())
    assert found["regions"]
    assert all(region["confidence"] is not None for region in found["regions"])
    assert {"regions.geojson", "regions.png", "topology.png"} <= {p.name for p in out.iterdir()}
    assert sum(region["label"] != "doorway" for region in found["regions"]) <= 1


def test_topology_takes_the_settings_and_gates_of_the_labels_folder(
    building: Path, run: Run
) -> None:
    config = building / "config.toml"
    config.write_text(config.read_text() + "\n[topology]\nmin_width_m = 0.3\nmin_area_m2 = 2.0\n")
    assert run("train", config, "-o", building / "model", "-q")[0] == 0
    labelled = building / "labelled"
    words = ("label", building / "map.yaml", "-m", building / "model", "-o", labelled, "-q")
    assert run(*words)[0] == 0

    def regions(*options: object, out: Path) -> tuple[list[dict[str, object]], str]:
        words = ("topology", labelled / "labels.png", building / "map.yaml", "--out", out, "-q")
        code, text, error = run(*words, *options)
        assert code == 0, error
        return json.loads((out / "places.json").read_text())["regions"], text

    before = json.loads((labelled / "places.json").read_text())["regions"]
    n_gates = sum("gate" in each for each in before)
    assert n_gates > 5
    again, text = regions(out=building / "again")
    line = (
        f"settings of {labelled / 'details/settings.json'}: min_area_m2 = 2.0, "
        "min_clearance_m = 0.2, min_width_m = 0.3; "
    )
    assert any(said.startswith(line) and said.endswith(" gates") for said in text.splitlines())
    assert [(r["id"], r["name"], r["area_m2"]) for r in again] == [
        (r["id"], r["name"], r["area_m2"]) for r in before
    ]
    assert [r.get("gate") for r in again] == [r.get("gate") for r in before]
    for each, other in zip(again, before, strict=True):  # from images of 256 greys
        assert each["probabilities"] == pytest.approx(other["probabilities"], abs=0.003)
        assert each["confidence"] == pytest.approx(other["confidence"], abs=0.003)
    assert (building / "again/regions.png").read_bytes() == (labelled / "regions.png").read_bytes()
    fewer, _ = regions("--min-area", "1e6", out=building / "fewer")
    assert len(fewer) < len(before)
    painted, _ = regions("--doorways", "labels", out=building / "painted")
    assert not any("gate" in each for each in painted)
    same, _ = regions(out=labelled)  # over what label wrote
    assert [each["name"] for each in same] == [each["name"] for each in before]
    assert len((labelled / "check.csv").read_text().splitlines()) == 1 + len(before)
    with Image.open(labelled / "labels.png") as image:
        image.transpose(Image.Transpose.ROTATE_180).transpose(Image.Transpose.ROTATE_180).save(
            labelled / "labels.png", compress_level=1
        )
    changed, _ = regions(out=building / "changed")
    assert {each["confidence"] for each in changed if "gate" not in each} == {None}


def test_gates_that_are_not_known_are_said_to_be(building: Path, run: Run) -> None:
    code, _, error = run(
        *("topology", building / "labels.png", building / "map.yaml"),
        *("--out", building / "gated", "--doorways", "gates"),
    )
    assert code == 0
    assert "no details/settings.json with gates next to the labels" in error


def test_label_takes_gates_as_doorways_unless_told_otherwise(building: Path, run: Run) -> None:
    assert run("train", building / "config.toml", "-o", building / "model", "-q")[0] == 0

    def gates(*options: str) -> list[bool]:
        out = building / "-".join(["labelled", *options])
        code, _, _ = run(
            "label", building / "map.yaml", "-m", building / "model", "-o", out, "-q", *options
        )
        assert code == 0
        regions = json.loads((out / "places.json").read_text())["regions"]
        return ["gate" in region for region in regions if region["label"] == "doorway"]

    found = gates()
    assert len(found) > 5
    assert all(found)
    assert not any(gates("--doorways", "labels"))


def test_places_are_renamed_merged_and_split(places: Path, run: Run) -> None:
    before = json.loads((places / "places.json").read_text())
    room = next(region for region in before["regions"] if region["label"] == "room")
    number, (x, y) = room["id"], room["anchor_m"]
    (places / "place_names.yaml").write_text(f"# ours\n{number}: old # name\n")
    assert run("where", places, x, y)[1].startswith(f"old: room {number} (")
    code, _, err = run("rename", places, "old", "Anna's office")
    assert code == 0, err
    assert (places / "place_names.yaml").read_text() == f'# ours\n{number}: "Anna\'s office"\n'
    assert run("where", places, x, y)[1].startswith(f"Anna's office: room {number} (")
    by_name = run("where", places, "Anna's office")
    assert by_name[:2] == (0, run("where", places, x, y)[1]) == (0, run("where", places, number)[1])
    assert f"\nanchor: {x:.2f} {y:.2f} (clearance " in by_name[1]
    assert f"\nextent: {extent(load_topology(places).place(number))}\n" in by_name[1]
    code, said, err = run("split", places, "Anna's office", x, y)
    assert code == 0, err
    after = json.loads((places / "places.json").read_text())
    assert len(after["regions"]) == len(before["regions"]) + 1
    new = max(region["id"] for region in after["regions"])
    assert new == before["next_id"]
    sizes = {region["id"]: region["area_m2"] for region in after["regions"]}
    whole, part = f"Anna's office ({sizes[number]:.1f} m²)", f"room {new} ({sizes[new]:.1f} m²)"
    assert said.splitlines()[0] == f"Anna's office was split into {whole}, {part}"
    code, said, err = run("merge", places, "Anna's office", new)
    assert code == 0, err
    grown = f"Anna's office ({room['area_m2']:.1f} m²)"
    assert said.splitlines()[0] == f"room {new} became part of {grown}"
    again = json.loads((places / "places.json").read_text())
    whole = next(region for region in again["regions"] if region["id"] == number)
    assert whole["area_m2"] == pytest.approx(room["area_m2"])
    assert whole["anchor_m"] == pytest.approx(room["anchor_m"])


def test_edits_that_make_no_sense_are_refused(places: Path, run: Run) -> None:
    code, _, err = run("rename", places, "attic", "loft")
    assert code == 2 and "there is no place 'attic'" in err
    code, _, err = run("split", places, 1, 1.0, 2.0, 3.0)
    assert code == 2 and "a point X Y, a line X1 Y1 X2 Y2 or nothing, got 3 numbers" in err
    regions = json.loads((places / "places.json").read_text())["regions"]
    one, other = [region["name"] for region in regions if region["label"] == "room"][:2]
    code, _, err = run("rename", places, one, other)
    assert code == 2 and f"{other!r} twice" in err


def test_where_imports_nothing_that_it_does_not_need(places: Path) -> None:
    code = (
        "import sys, numpy\n"
        "before = set(sys.modules)\n"  # NumPy 1 imports numpy.ma by itself
        "from pgm_places.cli.app import run\n"
        "try: run(['where', sys.argv[1], '-1000', '-1000'])\n"
        "except SystemExit: pass\n"
        "heavy = {'importlib.metadata', 'scipy', 'rich', 'numpy.ma'}\n"
        "print(*(heavy & set(sys.modules)) - before)"
    )
    command = [sys.executable, "-c", code, str(places)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "no place at this position\n\n"


def texts(folder: Path, name: str) -> list[str]:
    """The files of a folder that hold a name."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return sorted(
        path.relative_to(folder).as_posix() for path in files if name.encode() in path.read_bytes()
    )


@pytest.fixture
def exported(places: Path, run: Run) -> tuple[Path, int]:
    """Places of which one is called kitchen, with exports that name it; its id."""
    record = json.loads((places / "places.json").read_text())
    rooms = [region["id"] for region in record["regions"] if region["label"] == "room"]
    assert run("rename", places, rooms[0], "kitchen")[0] == 0
    for arguments in (
        ("nav2", "--set", "kitchen=0.4", "--set", "corridor=0.8", "--robot-radius", "0.1"),
        ("graphml",),
        ("node-link",),
        ("dot",),
        ("mcap",),
        ("coverage", "--robot-radius", "0.1"),
        ("lif", "--robot-radius", "0.1"),
        ("zones", "--set", "kitchen=100"),
    ):
        code, _, err = run("export", places, "--to", *arguments)
        assert code == 0, err
    return places, rooms[0]


def test_rename_changes_every_file_of_the_folder(exported: tuple[Path, int], run: Run) -> None:
    folder, number = exported
    named = texts(folder, "kitchen")
    least = {"places.json", "regions.geojson", "place_names.yaml", "poses.yaml", "places.dot"}
    least |= {"nav2_route.geojson", "places.graphml", "place_graph.json", "details/exports.json"}
    assert {*named} >= least
    masks = [(folder / file).read_bytes() for file in ("speed_m_s.png", "zones.png")]
    picture = (folder / "topology.png").read_bytes()
    code, _, err = run("rename", folder, "kitchen", "workshop")
    assert code == 0, err
    assert texts(folder, "kitchen") == []
    assert texts(folder, "workshop") == named
    assert [(folder / file).read_bytes() for file in ("speed_m_s.png", "zones.png")] == masks
    assert (folder / "topology.png").read_bytes() != picture
    assert load_topology(folder).place("workshop").id == number
    code, _, err = run("export", folder, "--to", "dot")  # its files still belong to the export
    assert code == 0, err


def test_a_rename_that_fails_changes_no_file(exported: tuple[Path, int], run: Run) -> None:
    folder, _ = exported
    (folder / "poses.yaml").unlink()
    (folder / "poses.yaml").mkdir()
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    code, _, err = run("rename", folder, "kitchen", "workshop")
    assert code == 2 and "poses.yaml" in err
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_an_export_changed_by_hand_stays_and_is_named(exported: tuple[Path, int], run: Run) -> None:
    folder, _ = exported
    edited = (folder / "places.dot").read_text() + "// mine\n"
    (folder / "places.dot").write_text(edited)
    code, _, err = run("rename", folder, "kitchen", "workshop")
    assert code == 0
    assert "places.dot was changed since it was exported and still has the old name" in err
    assert (folder / "places.dot").read_text() == edited
    assert texts(folder, "kitchen") == ["places.dot"]


def test_rename_names_the_exports_in_other_folders(places: Path, tmp_path: Path, run: Run) -> None:
    out = tmp_path / "elsewhere"
    for to in ("graphml", "dot"):
        code, _, err = run("export", places, "--to", to, "--out", out)
        assert code == 0, err
    code, _, err = run("rename", places, 1, "workshop")
    assert code == 0
    assert (
        f"exports in other folders still have the old name: graphml in {out}, dot in {out}\n" in err
    )
    assert "workshop" not in (out / "places.graphml").read_text()
    shutil.rmtree(out)
    assert "other folders" not in run("rename", places, "workshop", "lab")[2]


def test_a_damaged_record_does_not_keep_an_export_from_another_folder(
    places: Path, tmp_path: Path, run: Run
) -> None:
    record = places / "details" / "exports.json"
    record.write_text("{")
    code, _, err = run("export", places, "--to", "dot", "--out", tmp_path / "elsewhere")
    assert code == 0 and (tmp_path / "elsewhere" / "places.dot").exists()
    assert "exports.json" in err and "will not know of the export" in err
    assert record.read_text() == "{"


def test_the_title_of_the_page_stays_when_places_change(places: Path, run: Run) -> None:
    page = places / "index.html"
    title = re.search("<title>.*</title>", page.read_text())
    summary = places / "details" / "summary.json"
    assert title is not None and places.name not in title[0]
    summary.unlink(missing_ok=True)  # so that the map is not known any more
    record = json.loads((places / "places.json").read_text())
    room = next(region for region in record["regions"] if region["label"] == "room")
    assert run("split", places, room["id"], *room["anchor_m"])[0] == 0
    assert title[0] in page.read_text()
