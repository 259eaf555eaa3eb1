"""Small files of every format, which all readers take."""

import gzip
import shutil
from functools import lru_cache
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image

from pgm_places.batch.map_task import LabelledRow, manifest_text
from pgm_places.inference.backends import build
from pgm_places.inference.factor_graph import FactorGraph
from pgm_places.io.logs.trajectories import write_trajectory
from pgm_places.io.maps.label_image import save_labels
from pgm_places.io.maps.map_server import save_map
from pgm_places.io.output_set import RECORD_FILE
from pgm_places.io.places.place_ids_file import write_session
from pgm_places.io.places.place_settings import PlaceSettings, save_settings
from pgm_places.io.places.result_folder import MANIFEST_FILE, probability_file
from pgm_places.io.places.topology_files import save_topology
from pgm_places.io.uai import read_uai, write_evidence, write_uai, write_uai_result
from pgm_places.labelers.joint_labeler import JointLabeler
from pgm_places.labelling.options import Outputs
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.models.factor_decoding import decode_factors
from pgm_places.persistence.model_folder import load_folder, save_folder
from pgm_places.persistence.stored import load, save
from pgm_places.simulation import generate_building
from pgm_places.studio.journal import Journal
from pgm_places.studio.painting import Classes, Painting
from pgm_places.studio.runs import runs_of_mask
from pgm_places.topology.place_ids import PlaceIds
from pgm_places.topology.rules import TopologyOptions
from pgm_places.trained import model_folder
from pgm_places.trajectories.scan import ScanGeometry
from tests import drives
from tests.fuzz.mutation import json_bytes
from tests.io.logs.bag_files import BagFile
from tests.io.logs.detection_files import detection_bag
from tests.io.logs.log_files import HEADER, drive, flaser, packed_chunks, packed_files, robotlaser
from tests.live.robot import driven, raw_map
from tests.persistence.test_stored import STORED, chain
from tests.topology.floors import gated_floor_map, gates_of

MODELS = (
    *sorted(path.name for path in STORED.iterdir() if path.is_dir()),
    "backend_crf",
    "backend_semi_markov",
    "joint_labeler",
    "space_model",
)
"""Folders of models."""
NAMES = ("corridor", "room", "doorway")
JOURNAL_OF = {"map": "0" * 64}

CONFIG = """\
title = "a config"
resolution_m = 0.1
[labels]
names = ["corridor", "room", "doorway"]
[sensor]
max_range_m = 20.0
[classifier]
n_rounds = 10
[[train]]
map = "map.yaml"
labels = "labels.png"
columns = [0, 12]
[[test]]
generated = 3
half = "left"
[[methods]]
id = "adaboost"
name = "independent"
[[methods]]
name = "relaxation"
max_iterations = 5
[topology]
min_area_m2 = 1.5
"""
FLOORS = """\
[labels]
names = ["corridor", "room", "doorway"]
[[train]]
map = "ma[p].yaml"
labels = "ma[p].png"
buildings = "buildings.csv"
[[test]]
map = "map.yaml"
labels = "labels.png"
building = "one"
[[methods]]
name = "potts"
"""
GRAPHS = """\
nodes = "graph"
[labels]
names = ["corridor", "room", "doorway"]
[[train]]
graph = { nodes = "nodes.csv", edges = "edges.csv", positions = ["x", "y"] }
[[train]]
graph = { nodes = "nodes.parquet", edges = "edges.parquet", positions = ["x", "y"] }
[[test]]
graph = { file = "graph.graphml", positions = ["x", "y"] }
[[methods]]
name = "crf"
"""
EDITS: tuple[dict[str, Any], ...] = (
    {"kind": "class", "index": 3, "name": "kitchen", "colour": "#336699"},
    {
        "kind": "stroke",
        "label": 1,
        "stroke": {"tool": "brush", "points": [[20, 12], [30, 12]], "radius": 3},
    },
    {
        "kind": "stroke",
        "label": 0,
        "stroke": {"tool": "polygon", "points": [[9, 9], [9, 20], [20, 9]]},
    },
    {"kind": "fill", "label": 2, "point": [30.0, 12.5]},
    {"kind": "merge", "first": 1, "second": 2},
    {"kind": "rename", "point_m": [1.0, 2.0], "name": "lab"},
    {"kind": "version", "name": "first"},
    {"kind": "undo"},
    {"kind": "redo"},
    {"kind": "restore", "revision": 1},
    {"kind": "learn", "on": False},
)
"""What a browser asks a studio for."""


def seeds(folder: Path) -> None:
    """Write a file of each kind."""
    made = generate_building(size="small")
    window = np.ascontiguousarray(made.grid.cells[:60, :80])
    grid = type(made.grid)(window, made.grid.resolution_m)
    save_map(grid, folder / "map")
    save_labels(folder / "labels.png", np.where(window == 0, 1, -1), NAMES)
    grey = np.asarray(Image.open(folder / "map.png"))
    for kind in ("bmp", "tif", "pgm"):
        packed = {"compression": "tiff_lzw"} if kind == "tif" else {}
        Image.fromarray(grey).save(folder / f"map.{kind}", **packed)
    Image.fromarray(grey).save(folder / "map.jpg", progressive=True)
    square = [[0, 0], [2, 0], [2, 2.5], [0, 2], [0, 0]]
    feature = {
        "type": "Feature",
        "properties": {"class": "room"},
        "geometry": {"type": "Polygon", "coordinates": [square]},
    }
    collection = {"type": "FeatureCollection", "features": [feature, feature]}
    (folder / "truth.geojson").write_bytes(json_bytes(collection))
    (folder / "config.toml").write_text(CONFIG)
    lines = [flaser([1.0, 2.0, 3.0], time=k) for k in range(3)] + [robotlaser([1.0, 2.0])]
    log = HEADER + b"ODOM 1 0 0.1 0 0 0 5 host 1\n" + b"".join(lines)
    (folder / "drive.log").write_bytes(log)
    (folder / "drive.log.gz").write_bytes(gzip.compress(log))
    path = drive(ScanGeometry.half_circle(4), 5)
    for name in ("drive.bag", "drive.mcap", "ros2", "poses.csv"):
        write_trajectory(folder / name, path)
    with packed_chunks("BZ2"):
        write_trajectory(folder / "packed.bag", path)
    with packed_files("MCAP"):
        write_trajectory(folder / "packed", path)
    (folder / "counts.csv").write_text("t_s,cup,person\n0.5,1,0\n1.5,2,3\n")
    record = {"t_s": 1.5, "counts": {"cup": 2, "person": 1}}
    (folder / "counts.json").write_bytes(json_bytes([record, record]))
    save_topology(folder, gated_floor_map())
    save_settings(folder, PlaceSettings(TopologyOptions(), gates_of(gated_floor_map().grid)))
    (folder / "place_names.yaml").write_text("1: kitchen\n2: lab\n")
    detection_bag(folder / "detections", [("/left", 10.1, [("62", 0.9)]), ("/right", 10.2, [])])
    record = {"by": "label", "sha256": "0" * 64}
    (folder / "outputs").mkdir()
    (folder / "outputs" / RECORD_FILE).write_bytes(
        json_bytes({"format": "pgm-places output", "schema": 1, "files": {"a.txt": record}})
    )
    (folder / "removed.json").write_bytes(json_bytes(["a.txt", "bag/one"]))
    memory = PlaceIds()
    memory.learn(gated_floor_map())
    write_session(folder / "robot.session", memory)
    _write_journal(folder, grid)
    _write_graphs(folder)
    (folder / "floors.toml").write_text(FLOORS)
    (folder / "graphs.toml").write_text(GRAPHS)
    (folder / "buildings.csv").write_text("map,building\nmap.yaml,one\nhall/map.yaml,two\n")
    (folder / "edits.json").write_bytes(json_bytes(EDITS))
    (folder / "maps").mkdir()
    recorded = BagFile()
    for time in (1.0, 2.0):
        recorded.map(time, grid)
    recorded.write(folder / "maps")
    labelled = folder / "labelled"
    save_topology(labelled, gated_floor_map())
    with Image.open(labelled / "regions.png") as image:
        half = Image.new("L", image.size, 128)
    (labelled / "details").mkdir()
    for name in gated_floor_map().label_names:
        half.save(labelled / probability_file(name))
    inputs = {"map": "0" * 64, "image": "map.png", "image_sha256": "0" * 64, "names": None}
    row = LabelledRow(
        name="hall",
        map="hall.yaml",
        method="potts",
        n_places=3,
        n_connections=2,
        area_m2={"room": 20.5},
        doubt=0.1,
        check_first="room 1",
        warnings=("grey 205",),
        seconds=1.5,
    )
    (folder / "batch/details").mkdir(parents=True)
    (folder / "batch" / MANIFEST_FILE).write_text(manifest_text(inputs, row, Outputs()))
    _write_models(folder)
    _write_networks(folder)
    messages = [("map", raw_map(grid)), *driven(drives.drive(1)[:3])]
    (folder / "messages.json").write_bytes(
        json_bytes([(what, raw.hex()) for what, raw in messages])
    )


def _write_networks(folder: Path) -> None:
    """A network of a factor of three nodes and a loop, and results for it."""
    rng = np.random.default_rng(0)
    scopes = ((0,), (0, 1), (1, 2), (2, 3), (3, 0), (1, 3, 4))
    sizes = (2, 3, 2, 2, 2)
    tables = tuple(rng.normal(size=[sizes[node] for node in scope]) for scope in scopes)
    network = FactorGraph.of(sizes, scopes, tables)
    write_uai(folder / "network.uai", network)
    network = read_uai(folder / "network.uai")
    write_evidence(folder / "network.evid", np.array([-1, 2, -1, 0, -1]))
    write_uai_result(folder / "network.MAP", decode_factors(network, "exact"), "MAP", graph=network)
    beliefs = decode_factors(network, "sum-product")
    write_uai_result(folder / "network.MAR", beliefs, "MAR", graph=network)


def _write_journal(folder: Path, grid: OccupancyGrid) -> None:
    """A studio's journal with an entry of every kind."""
    journal = Journal(folder / "journal.jsonl", JOURNAL_OF)
    painting = Painting(grid, Classes.named(NAMES), journal)
    free = np.flatnonzero(grid.free)
    for label, cells in ((1, free[:40]), (2, free[20:60])):
        mask = np.zeros(grid.shape, np.bool_)
        mask.reshape(-1)[cells] = True
        painting.paint_runs(runs_of_mask(mask), label)
    painting.set_class(3, "kitchen", "#336699")
    painting.rename((1.0, 2.0), "lab", [])
    painting.save_version("first")
    painting.undo()
    painting.redo()
    painting.restore(painting.versions[0].revision)
    journal.close()


def _write_graphs(folder: Path) -> None:
    """The same three nodes and two edges as CSV, as Parquet and as GraphML."""
    graph: Any = nx.Graph()
    for number, label in enumerate(("room", "doorway", "corridor")):
        where = {"x": 0.5 * number, "y": 1.0, "storey": number}
        graph.add_node(f"n{number}", **where, width=2.5 - number, label=label)
    graph.add_edge("n0", "n1", length=1.5)
    graph.add_edge("n1", "n2", length=2.0)
    nx.write_graphml(graph, folder / "graph.graphml")
    nodes = [{"node": name, **graph.nodes[name]} for name in graph]
    edges = [{"source": a, "target": b, **values} for a, b, values in graph.edges(data=True)]
    for kind, rows in (("nodes", nodes), ("edges", edges)):
        pq.write_table(pa.Table.from_pylist(rows), folder / f"{kind}.parquet")
        lines = [rows[0], *(row.values() for row in rows)]
        text = "".join(",".join(map(str, line)) + "\n" for line in lines)
        (folder / f"{kind}.csv").write_text(text)


def _write_learned(folder: Path) -> None:
    """A field and a semi-Markov model that have learned from a short chain."""
    problem = chain()
    assert problem.unary is not None
    truth = problem.unary.argmax(axis=1)
    for method in ("crf", "semi_markov"):
        backend = build(method).fit([problem], [truth])
        save(backend, folder / f"backend_{method}", label_names=problem.label_names)


def _write_models(folder: Path) -> None:
    _write_learned(folder)
    for model in STORED.iterdir():
        if model.is_dir():
            shutil.copytree(model, folder / model.name)
    # The shipped model without the record of its training, which is nearly all of its manifest.
    manifest, arrays = load_folder(model_folder("generated"))
    save_folder(folder / "space_model", {**manifest, "record": {}}, arrays)
    places, steps = (load(STORED / name) for name in ("place_labeler", "trajectory_labeler"))
    joint = JointLabeler(places.label_names_, build("potts"), places=places, steps=steps)
    joint.set_learned(
        places_=places,
        steps_=steps,
        method_=build("potts"),
        link_weight_=1.0,
        label_names_=places.label_names_,
    )
    save(joint, folder / "joint_labeler")


def remember_definitions() -> None:
    """Parse and compile what rosbags derives from a definition of messages once for all bags."""
    from rosbags.highlevel import anyreader
    from rosbags.serde import cdr, ros1

    compiled = cdr.compile_lines

    @lru_cache(1000)
    def once(text: str) -> Any:
        return compiled([text])

    cdr.compile_lines = ros1.compile_lines = lambda lines: once("\n".join(lines))
    anyreader.get_types_from_msg = lru_cache(1000)(anyreader.get_types_from_msg)
