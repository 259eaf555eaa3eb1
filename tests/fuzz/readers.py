"""Every reader of files, and how to spoil what it reads."""

import gzip
import hashlib
import json
import random
import shutil
import struct
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from pgm_places.batch.map_task import done_figures, labelled_row
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
from pgm_places.io.places.place_ids_file import read_session
from pgm_places.io.places.place_settings import load_settings
from pgm_places.io.places.result_folder import GATES_FILE, MANIFEST_FILE, SETTINGS_FILE
from pgm_places.io.places.topology_files import load_topology, read_own_names
from pgm_places.io.staging import NEW, UNFINISHED
from pgm_places.io.uai import read_evidence, read_uai, read_uai_result
from pgm_places.labelling.model import LoadedModel
from pgm_places.labelling.options import LabelOptions
from pgm_places.persistence.map_prior import read_labelled_map
from pgm_places.persistence.stored import read
from pgm_places.studio.journal import Journal
from pgm_places.studio.painting import Classes, Painting
from pgm_places.studio.session import MapSession
from pgm_places.teaching.paint import Paint
from tests.fuzz import uses
from tests.fuzz.mutation import json_bytes, mutated_bytes, mutated_json, mutated_text
from tests.fuzz.seeds import JOURNAL_OF, MODELS, NAMES
from tests.studio.conftest import HOST, TOKEN, Client

JSON_TYPE = "application/json"
MAX_PIXELS = 4_000_000
"""The limit of a map in pixels, lowered so that its memory does not hide what leaks."""

FLOATS = (0.0, -1.0, 1e-9, 1e9, 3e38, -3e38, float("inf"), float("-inf"), float("nan"))
"""Numbers that replace one of a message."""

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
    use : callable, optional
        What to do with what was read, in the folder.
    """

    read: Callable[[Path], Any]
    file: str
    mutations: tuple[Mutation, ...] = (mutated_bytes, mutated_text)
    after: Callable[[Path], None] = field(default=lambda _: None)
    use: "Use | None" = None

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


def labels_of(folder: Path) -> object:
    image = folder / "labels.png"
    return load_labels(image, listed_names(image), grid=uses.grid_of(folder))


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
        return Painting(uses.grid_of(folder), Classes.named(NAMES), journal)
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
    desk = MapSession(load_map(folder / "map.yaml"), folder / "studio", None)
    try:
        client = Client(desk, f"{HOST}/{TOKEN}/", {"origin": HOST, "content-type": JSON_TYPE})
        answers = [client.post("edit", content=json_bytes(item)) for item in requests]
    finally:
        desk.close()
    assert {answer.status_code for answer in answers} <= {200, 400}
    return answers


def messages_of(folder: Path) -> list[tuple[str, bytes]]:
    """Messages of a robot as they come; damaged ones are refused by whoever takes them."""
    read = json.loads((folder / "messages.json").read_bytes())
    return [(what, bytes.fromhex(raw)) for what, raw in read]


def of_message(data: bytes, rng: random.Random) -> bytes:
    """One message spoiled: its bytes, or a number of it."""
    messages = json.loads(data)
    at = rng.randrange(len(messages))
    raw = bytearray.fromhex(messages[at][1])
    if rng.random() < 0.5:
        raw = bytearray(mutated_bytes(bytes(raw), rng))
    else:
        kind = rng.choice("fd")
        number = struct.pack(f"<{kind}", rng.choice(FLOATS))
        start = 4 + len(number) * rng.randrange(max((len(raw) - 4) // len(number), 1))
        raw[start : start + len(number)] = number
    messages[at][1] = raw.hex()
    return json_bytes(messages)


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
        lambda folder: load_regions(folder / "truth.geojson", NAMES, uses.grid_of(folder)),
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
    "places.json": Reader(_of_folder(load_topology), "places.json", JSON),
    "regions.png": Reader(_of_folder(load_topology), "regions.png", BYTES),
    "settings.json": Reader(_of_folder(load_settings), SETTINGS_FILE, JSON),
    "gate_places.png": Reader(_of_folder(load_settings), GATES_FILE, BYTES),
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
        lambda folder: Paint.read(folder / "labels.png", uses.grid_of(folder), NAMES),
        "labels.png",
        BYTES,
    ),
    "corrections.geojson": Reader(
        lambda folder: Paint.read(folder / "truth.geojson", uses.grid_of(folder), NAMES),
        "truth.geojson",
        JSON,
    ),
}
READERS |= {
    "network.uai": Reader(_of_folder(read_uai, "network.uai"), "network.uai"),
    "network.evid": Reader(_of_folder(read_evidence, "network.evid", n_nodes=5), "network.evid"),
    "network.MAP": Reader(_of_folder(read_uai_result, "network.MAP"), "network.MAP"),
    "network.MAR": Reader(_of_folder(read_uai_result, "network.MAR"), "network.MAR"),
    "messages of a robot": Reader(messages_of, "messages.json", (of_message,)),
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
        "labelled/details/probability_room.png",
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

MAPS = [name for name in READERS if name.startswith("map.")]
DRIVES = ("drive.", "packed.", "poses.", "metadata.")
TABLES = ("nodes.", "edges.", "graph.", "graphs.")
OF_MODELS = [f"{name}/{file}" for name in MODELS for file in ("manifest.json", "arrays")]
Use = Callable[[Any, Path], object]
USES: dict[str, tuple[Use, str]] = {
    **dict.fromkeys(MAPS, (uses.label, "labelled")),
    **dict.fromkeys([name for name in READERS if name.startswith(DRIVES)], (uses.track, "tracked")),
    **dict.fromkeys([name for name in READERS if name.startswith(TABLES)], (uses.solve, "solved")),
    **dict.fromkeys(OF_MODELS, (uses.label_by, "labels")),
    **dict.fromkeys(["labels.png", "labels.yaml", "regions.geojson"], (uses.divide, "divided")),
    **dict.fromkeys(["corrections.png", "corrections.geojson"], (uses.label_around, "kept")),
    **dict.fromkeys(["counts.csv", "counts.json", "detections.mcap"], (uses.count, "counted")),
    **dict.fromkeys(["places.json", "regions.png"], (uses.write_places, "exported")),
    "maps of a bag": (uses.label_messages, "labelled"),
    "probabilities": (uses.prefer, "believed"),
    "session of a robot": (uses.go_on, "gone on with"),
    "network.uai": (uses.decode, "decoded"),
    "network.evid": (uses.decode_known, "kept"),
    "messages of a robot": (uses.drive, "taken"),
}
"""What is done with a reader's result, and how it is called."""
READERS |= {
    f"{name}, {word}": replace(READERS[name], use=use) for name, (use, word) in USES.items()
}
