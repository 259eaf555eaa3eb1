"""A robot of another process, over the loopback interface: what it sends is labelled and sent back.

These tests speak DDS for real; they are skipped where Cyclone DDS is not installed.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pgm_places.live.dds_node import LONELY_AFTER_S
from pgm_places.live.live_options import NodeOptions
from pgm_places.live.ros_codec import RosCodec
from pgm_places.persistence.stored import save
from tests.cli.conftest import Run, run
from tests.drives import building, drive
from tests.io.logs.bag_files import BagFile
from tests.live.dds_domains import dds_domain
from tests.live.robot import raw_map, raw_messages, text_of
from tests.quick_labeler import places

__all__ = ["run"]

pytest.importorskip("cyclonedds", reason="the extra dds is not installed")

from pgm_places.live.dds_bus import DdsBus, DdsNetwork

PATIENCE_S = 120.0
"""What a machine that is busy with other things may take."""


@pytest.fixture(scope="module")
def domain() -> int:
    return dds_domain("drive")


@pytest.fixture
def node(tmp_path: Path, domain: int) -> Iterator["subprocess.Popen[str]"]:
    """The command in a process of its own."""
    save(places(), tmp_path / "model")
    words = ["live", "--dds", "--local", "--domain", str(domain), "--base-frame", "laser"]
    words += ["--model", str(tmp_path / "model"), "--stale-after", "1000", "--jsonl"]
    words += ["--relabel-min-period", "0.1", "--tf-tolerance", "2"]
    process = subprocess.Popen(
        [sys.executable, "-m", "pgm_places", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    yield process
    if process.poll() is None:
        process.kill()
    process.communicate()


def test_a_drive_over_the_wire(node: "subprocess.Popen[str]", domain: int) -> None:
    grid, path = building()[0].grid, drive(1)[:40]
    half = grid.cells.copy()
    half[:, grid.shape[1] // 2 :] = -1
    bus, came = DdsBus(domain, DdsNetwork(local_only=True)), dict[str, list[bytes]]()
    bus.read("place", "/pgm_places/place", reliable=True)
    for what in ("label_map", "markers", "topology"):
        bus.read(what, f"/pgm_places/{what}", reliable=True, transient_local=True, depth=1)
    out = {
        "map": bus.writer("map", "/map", transient_local=True, depth=1),
        "scan": bus.writer("scan", "/scan"),
        "tf": bus.writer("tf", "/tf", depth=100),
    }

    def listen(seconds: float) -> None:
        bus.wait(seconds)
        bus.take(lambda what, raw: came.setdefault(what, []).append(raw))

    def until(done: Any, what: str) -> None:
        end = time.monotonic() + PATIENCE_S
        while not done():
            assert node.poll() is None, node.communicate()[1]
            assert time.monotonic() < end, f"no {what} came"
            listen(0.1)

    # The first map is sent before anybody listens: it is kept for those who come late.
    out["map"].write(raw_map(grid.with_cells(half)))
    until(lambda: came.get("topology"), "labelled map")
    until(lambda: out["scan"].n_readers and out["tf"].n_readers, "subscriber")
    bag = BagFile()
    bag.drive(replace(path, times_s=time.time() + path.times_s))
    for step, (what, raw) in enumerate(raw_messages(bag)):
        if step == len(path):
            out["map"].write(raw_map(grid))
        out[what].write(raw)
        listen(0.02)
    until(lambda: len(came.get("topology", [])) == 2, "second map")
    until(lambda: len(came.get("place", [])) == len(path), "places")
    codec = RosCodec()
    first, second = (text_of(raw) for raw in came["topology"])
    assert (first["map_seq"], second["map_seq"]) == (1, 2)
    assert len(second["places"]) > len(first["places"])
    labels = codec.read(came["label_map"][-1], "label_map")
    assert (labels.info.height, labels.info.width) == grid.shape
    assert ((labels.data != -1).reshape(grid.shape) <= grid.free).all()
    assert codec.read(came["markers"][-1], "markers").markers[0].action == 3
    found = [text_of(raw) for raw in came["place"]]
    assert {row["label"] for row in found} <= set(places().label_names_)
    assert any(row["name"] for row in found)
    node.send_signal(signal.SIGINT)
    text, _ = node.communicate(timeout=PATIENCE_S)
    assert node.returncode == 0
    changes = [json.loads(line) for line in text.splitlines()]
    assert changes[0]["label"] == found[0]["label"]
    assert len(changes) == sum(row["changed"] for row in found)


def test_topics_that_nobody_publishes_are_named(tmp_path: Path, run: Run) -> None:
    domain = dds_domain("lonely")
    save(places(), tmp_path / "model")
    code, _, error = run(
        "live", "--dds", "--local", "--domain", domain, "--model", tmp_path / "model",
        "--seconds", LONELY_AFTER_S + 1,
    )  # fmt: skip
    assert code == 0
    assert "no publisher of /tf_static, /tf, /map, /scan: are the topics" in error
    assert f"(ROS_DOMAIN_ID) {domain}" in error


def test_the_domain_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    from pgm_places.errors import ConfigError
    from pgm_places.live.dds_node import _domain

    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert _domain(NodeOptions()) == 0
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert _domain(NodeOptions()) == 42
    assert _domain(NodeOptions(domain=7)) == 7
    monkeypatch.setenv("ROS_DOMAIN_ID", "x")
    with pytest.raises(ConfigError, match="ROS_DOMAIN_ID must be a number from 0 to 232, got 'x'"):
        _domain(NodeOptions())
