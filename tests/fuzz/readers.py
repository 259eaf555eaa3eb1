"""Every reader of files, and how to spoil what it reads."""

import gzip
import hashlib
import json
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from pgm_places.batch.map_task import MANIFEST_FILE, done_figures, labelled_row
from pgm_places.experiment.config import load_config
from pgm_places.experiment.experiment import Experiment
from pgm_places.experiment.graphs import load_graphs
from pgm_places.io.logs.bags import read_map_messages
from pgm_places.io.logs.object_counts import read_detection_bag, read_object_counts
from pgm_places.io.logs.trajectories import read_trajectory
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.label_values import listed_names
from pgm_places.io.maps.map_server import load_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.io.output_set import RECORD_FILE, claim
from pgm_places.io.places.place_settings import load_settings
from pgm_places.io.places.topology_files import load_topology, read_own_names
from pgm_places.io.staging import NEW, UNFINISHED
from pgm_places.labelers.trajectory_labeler import TrajectoryLabeler
from pgm_places.labelling.label import label_map
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions
from pgm_places.live.session_file import read_session
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.persistence.map_prior import read_labelled_map
from pgm_places.persistence.stored import read
from pgm_places.studio.desk import Desk
from pgm_places.studio.journal import Journal
from pgm_places.studio.painting import Classes, Painting
from pgm_places.teaching.paint import Paint
from pgm_places.topology.from_labels import topological_map
from tests.fuzz.mutation import json_bytes, mutated_bytes, mutated_json, mutated_text
from tests.fuzz.seeds import JOURNAL_OF, MODELS, NAMES
from tests.quick_labeler import places
from tests.studio.conftest import HOST, TOKEN, Client

JSON_TYPE = "application/json"
MOST_STEPS = 20
"""Of a drive that is tracked."""

MAX_PIXELS = 4_000_000
"""The limit of a map in pixels, lowered so that its memory does not hide what leaks."""

Mutation = Callable[[bytes, random.Random], bytes]


@dataclass(frozen=True)
class Reader:
    """A reader, the file of a folder that is spoiled for it, and how.

    Parameters
    ----------
    read : callable
        Reads what is in the folder.
    file : str
        The file to spoil.
    mutations : tuple of callables
        One is chosen for each input.
    after : callable
        What to put in order after a file was spoiled, such as a checksum of it.
    """

    read: Callable[[Path], object]
    file: str
    mutations: tuple[Mutation, ...] = (mutated_bytes, mutated_text)
    after: Callable[[Path], None] = field(default=lambda _: None)

    def spoil(self, data: bytes, rng: random.Random) -> bytes:
        """Another file."""
        return rng.choice(self.mutations)(data, rng)


def of_json(data: bytes, rng: random.Random) -> bytes:
    return json_bytes(mutated_json(data, rng))


def unpacked(data: bytes, rng: random.Random) -> bytes:
    """Spoiled before it is packed."""
    return gzip.compress(mutated_text(gzip.decompress(data), rng), 1)


def map_of(name: str) -> Callable[[Path], object]:
    def read_it(folder: Path) -> object:
        text = (folder / "map.yaml").read_text()
        (folder / "map.yaml").write_text("\n".join([f"image: {name}", *text.split("\n")[1:]]))
        return load_map(folder / "map.yaml", max_pixels=MAX_PIXELS)

    return read_it


@lru_cache(1)
def grid_of(folder: Path) -> OccupancyGrid:
    """Of a map that is not the file to spoil."""
    return load_map(folder / "map.yaml").grid


@lru_cache(1)
def tracker() -> TrajectoryLabeler:
    return TrajectoryLabeler.from_places(places())


def tracked(name: str) -> Callable[[Path], object]:
    """A drive that is read, and whose first scans are labelled as they come."""

    def track(folder: Path) -> object:
        drive = read_trajectory(folder / name).trajectory
        if drive.ranges_m is None or drive.geometry is None:
            return drive.graph()
        online = tracker().online(drive.geometry)
        return [online.step(drive.scan(step)) for step in range(min(len(drive), MOST_STEPS))]

    return track


def labelled(name: str) -> Callable[[Path], object]:
    """A map that is read, labelled and divided into places."""

    def label(folder: Path) -> object:
        grid: OccupancyGrid = map_of(name)(folder).grid  # type: ignore[attr-defined]
        found = label_map(places(), grid, max_cells=MAX_PIXELS, n_threads=1)
        return topological_map(grid, found.labels, found.label_names, doorways=found.doorways)

    return label


def labels_of(folder: Path) -> object:
    image = folder / "labels.png"
    return load_labels(image, listed_names(image), grid=grid_of(folder))


def resealed(folder: Path) -> None:
    """The manifest with the SHA-256 of the arrays, so that it does not guard what comes next."""
    manifest = json.loads((folder / "manifest.json").read_text())
    data = (folder / "arrays.safetensors").read_bytes()
    manifest["arrays_sha256"] = hashlib.sha256(data).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))


def finished(folder: Path) -> object:
    """An interrupted swap with a list of what it has left to remove, as a run finds it."""
    target = folder / "swap"
    shutil.rmtree(target, ignore_errors=True)
    (target / UNFINISHED / NEW).mkdir(parents=True)
    shutil.copyfile(folder / "removed.json", target / UNFINISHED / "removed.json")
    return claim(target)


def painted(folder: Path) -> object:
    """A studio's painting from its journal; a copy, because a torn line is cut off."""
    copy = folder / "copy.jsonl"
    shutil.copyfile(folder / "journal.jsonl", copy)
    journal = Journal(copy, JOURNAL_OF)
    try:
        return Painting(grid_of(folder), Classes.named(NAMES), journal)
    finally:
        journal.close()


@lru_cache(1)
def model_for_batches() -> LoadedModel:
    return LoadedModel.load(LabelOptions())


def figures_of(folder: Path) -> object:
    labelled_row(folder / "batch", "hall")
    return done_figures(folder / "batch", folder / "map.yaml", model_for_batches(), LabelOptions())


def graphs_of(part: str) -> Callable[[Path], object]:
    def read_them(folder: Path) -> object:
        config = load_config(folder / "graphs.toml")
        return load_graphs(Experiment(config, folder), part)

    return read_them


def edited(folder: Path) -> object:
    """A studio that is asked for all of the edits in turn; it may refuse any of them."""
    shutil.rmtree(folder / "studio", ignore_errors=True)
    requests = json.loads((folder / "edits.json").read_bytes())
    desk = Desk(load_map(folder / "map.yaml"), folder / "studio", None)
    try:
        client = Client(desk, f"{HOST}/{TOKEN}/", {"origin": HOST, "content-type": JSON_TYPE})
        answers = [client.post("edit", content=json_bytes(item)) for item in requests]
    finally:
        desk.close()
    assert {answer.status_code for answer in answers} <= {200, 400}
    return answers


def of_lines(data: bytes, rng: random.Random) -> bytes:
    """One line of JSON spoiled."""
    lines = data.split(b"\n")
    at = rng.randrange(len(lines) - 1)
    lines[at] = of_json(lines[at], rng)
    return b"\n".join(lines)


def _of_folder(reader: Callable[..., object], *name: str, **options: Any) -> Any:
    return lambda folder: reader(folder.joinpath(*name), **options)


JSON = (mutated_bytes, of_json, of_json)
BYTES = (mutated_bytes,)
READERS: dict[str, Reader] = {
    "map.yaml": Reader(_of_folder(load_map, "map.yaml", max_pixels=MAX_PIXELS), "map.yaml"),
    "map.png": Reader(map_of("map.png"), "map.png", BYTES),
    "map.pgm": Reader(map_of("map.pgm"), "map.pgm", BYTES),
    "map.bmp": Reader(map_of("map.bmp"), "map.bmp", BYTES),
    "map.tif": Reader(map_of("map.tif"), "map.tif", BYTES),
    "map.jpg": Reader(map_of("map.jpg"), "map.jpg", BYTES),
    "labels.png": Reader(labels_of, "labels.png", BYTES),
    "labels.yaml": Reader(labels_of, "labels.yaml"),
    "regions.geojson": Reader(
        lambda folder: load_regions(folder / "truth.geojson", NAMES, grid_of(folder)),
        "truth.geojson",
        JSON,
    ),
    "config.toml": Reader(_of_folder(load_config, "config.toml"), "config.toml"),
    "drive.log": Reader(_of_folder(read_trajectory, "drive.log"), "drive.log"),
    "drive.log.gz": Reader(
        _of_folder(read_trajectory, "drive.log.gz"), "drive.log.gz", (mutated_bytes, unpacked)
    ),
    "poses.csv": Reader(_of_folder(read_trajectory, "poses.csv"), "poses.csv"),
    "counts.csv": Reader(_of_folder(read_object_counts, "counts.csv"), "counts.csv"),
    "counts.json": Reader(_of_folder(read_object_counts, "counts.json"), "counts.json", JSON),
    "drive.bag": Reader(_of_folder(read_trajectory, "drive.bag"), "drive.bag", BYTES),
    "drive.mcap": Reader(_of_folder(read_trajectory, "drive.mcap"), "drive.mcap", BYTES),
    "drive.db3": Reader(_of_folder(read_trajectory, "ros2"), "ros2/ros2.db3", BYTES),
    "metadata.yaml": Reader(_of_folder(read_trajectory, "ros2"), "ros2/metadata.yaml"),
    "packed.bag": Reader(_of_folder(read_trajectory, "packed.bag"), "packed.bag", BYTES),
    "packed.mcap.zstd": Reader(
        _of_folder(read_trajectory, "packed"), "packed/packed.mcap.zstd", BYTES
    ),
    "detections.mcap": Reader(
        _of_folder(read_detection_bag, "detections"), "detections/detections.mcap", BYTES
    ),
    "drive.log, tracked": Reader(tracked("drive.log"), "drive.log"),
    "drive.mcap, tracked": Reader(tracked("drive.mcap"), "drive.mcap", BYTES),
    "map.png, labelled": Reader(labelled("map.png"), "map.png", BYTES),
    "topology.json": Reader(_of_folder(load_topology), "topology.json", JSON),
    "regions.png": Reader(_of_folder(load_topology), "regions.png", BYTES),
    "places.json": Reader(_of_folder(load_settings), "places.json", JSON),
    "gate_places.png": Reader(_of_folder(load_settings), "gate_places.png", BYTES),
    "place_names.yaml": Reader(_of_folder(read_own_names), "place_names.yaml"),
    "record of outputs": Reader(_of_folder(claim, "outputs"), f"outputs/{RECORD_FILE}", JSON),
    "interrupted swap": Reader(finished, "removed.json", JSON),
}
READERS |= {
    "journal of a studio": Reader(
        painted, "journal.jsonl", (mutated_bytes, mutated_text, of_lines)
    ),
    "manifest of a batch": Reader(figures_of, f"batch/{MANIFEST_FILE}", JSON),
    "corrections.png": Reader(
        lambda folder: Paint.read(folder / "labels.png", grid_of(folder), NAMES),
        "labels.png",
        BYTES,
    ),
    "corrections.geojson": Reader(
        lambda folder: Paint.read(folder / "truth.geojson", grid_of(folder), NAMES),
        "truth.geojson",
        JSON,
    ),
}
READERS |= {
    "floors.toml": Reader(_of_folder(load_config, "floors.toml"), "floors.toml"),
    "buildings.csv": Reader(_of_folder(load_config, "floors.toml"), "buildings.csv"),
    "nodes.csv": Reader(graphs_of("train"), "nodes.csv"),
    "edges.csv": Reader(graphs_of("train"), "edges.csv"),
    "nodes.parquet": Reader(graphs_of("train"), "nodes.parquet", BYTES),
    "edges.parquet": Reader(graphs_of("train"), "edges.parquet", BYTES),
    "graph.graphml": Reader(graphs_of("test"), "graph.graphml"),
    "graphs.toml": Reader(graphs_of("train"), "graphs.toml"),
    "maps of a bag": Reader(
        lambda folder: list(read_map_messages(folder / "maps/made")), "maps/made/made.mcap", BYTES
    ),
    "probabilities": Reader(
        lambda folder: read_labelled_map(folder / "labelled", NAMES),
        "labelled/probability_room.png",
        BYTES,
    ),
    "edits of a studio": Reader(edited, "edits.json", (of_json,)),
    "session of a robot": Reader(_of_folder(read_session, "robot.session"), "robot.session", JSON),
}
for _model in MODELS:
    READERS[f"{_model}/manifest.json"] = Reader(
        _of_folder(read, _model), f"{_model}/manifest.json", JSON
    )
    READERS[f"{_model}/arrays"] = Reader(
        _of_folder(read, _model),
        f"{_model}/arrays.safetensors",
        BYTES,
        lambda folder, model=_model: resealed(folder / model),  # type: ignore[misc]
    )
