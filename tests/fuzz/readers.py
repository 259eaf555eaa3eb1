"""Every reader of files, with small files that it takes, and how to spoil them."""

import gzip
import hashlib
import json
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from pgm_places.datasets import generate_building
from pgm_places.experiment.config import load_config
from pgm_places.io.logs.object_counts import read_object_counts
from pgm_places.io.logs.trajectories import read_trajectory, write_trajectory
from pgm_places.io.maps.label_image import load_labels, save_labels
from pgm_places.io.maps.label_values import listed_names
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.io.maps.regions import load_regions
from pgm_places.io.places.topology_files import load_topology, read_own_names, save_topology
from pgm_places.persistence.stored import read
from pgm_places.trajectories.scan import ScanGeometry
from tests.fuzz.mutation import json_bytes, mutated_bytes, mutated_json, mutated_text
from tests.io.logs.log_files import HEADER, drive, flaser, robotlaser
from tests.topology.floors import gated_floor_map

__all__ = ["READERS", "Reader", "seeds"]

STORED = Path(__file__).parents[1] / "data" / "stored"
NAMES = ("corridor", "room", "doorway")
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
    return json_bytes(mutated_json(json.loads(data), rng))


def unpacked(data: bytes, rng: random.Random) -> bytes:
    """Spoiled before it is packed."""
    return gzip.compress(mutated_text(gzip.decompress(data), rng), 1)


def map_of(name: str) -> Callable[[Path], object]:
    def read_it(folder: Path) -> object:
        text = (folder / "map.yaml").read_text()
        (folder / "map.yaml").write_text("\n".join([f"image: {name}", *text.split("\n")[1:]]))
        return load_map(folder / "map.yaml", max_pixels=MAX_PIXELS)

    return read_it


def labels_of(folder: Path) -> object:
    grid = load_map(folder / "map.yaml").grid
    return load_labels(folder / "labels.png", listed_names(folder / "labels.png"), grid=grid)


def resealed(folder: Path) -> None:
    """The manifest with the SHA-256 of the arrays, so that it does not guard what comes next."""
    manifest = json.loads((folder / "manifest.json").read_text())
    data = (folder / "arrays.safetensors").read_bytes()
    manifest["arrays_sha256"] = hashlib.sha256(data).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))


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
    "labels.png": Reader(labels_of, "labels.png", BYTES),
    "labels.yaml": Reader(labels_of, "labels.yaml"),
    "regions.geojson": Reader(
        lambda folder: load_regions(
            folder / "truth.geojson", NAMES, load_map(folder / "map.yaml").grid
        ),
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
    "topology.json": Reader(_of_folder(load_topology), "topology.json", JSON),
    "regions.png": Reader(_of_folder(load_topology), "regions.png", BYTES),
    "place_names.yaml": Reader(_of_folder(read_own_names), "place_names.yaml"),
}
for _kind in sorted(path.name for path in STORED.iterdir() if path.is_dir()):
    READERS[f"{_kind}/manifest.json"] = Reader(
        _of_folder(read, _kind), f"{_kind}/manifest.json", JSON
    )
    READERS[f"{_kind}/arrays"] = Reader(
        _of_folder(read, _kind),
        f"{_kind}/arrays.safetensors",
        BYTES,
        lambda folder, kind=_kind: resealed(folder / kind),  # type: ignore[misc]
    )

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
    (folder / "counts.csv").write_text("t_s,cup,person\n0.5,1,0\n1.5,2,3\n")
    record = {"t_s": 1.5, "counts": {"cup": 2, "person": 1}}
    (folder / "counts.json").write_bytes(json_bytes([record, record]))
    save_topology(folder, gated_floor_map())
    (folder / "place_names.yaml").write_text("1: kitchen\n2: lab\n")
    for model in STORED.iterdir():
        if model.is_dir():
            shutil.copytree(model, folder / model.name)
