"""A node over DDS whose processes are killed: it goes on with the same places, and leaves nothing.

This speaks DDS for real; it is skipped where Cyclone DDS is not installed.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pgm_places.io.places.place_ids_file import read_session
from pgm_places.persistence.stored import save
from tests.drives import building
from tests.live.dds_domains import dds_domain
from tests.live.robot import raw_map, text_of
from tests.quick_labeler import places
from tests.real_data import ROOT

pytest.importorskip("cyclonedds", reason="the extra dds is not installed")
if not Path("/proc/self/task").is_dir():
    pytest.skip("processes are looked up in /proc", allow_module_level=True)

from pgm_places.live.dds_bus import DdsBus, DdsNetwork

PATIENCE_S = 240.0


class Robot:
    """Sends maps, and keeps what comes back."""

    def __init__(self, domain: int) -> None:
        self.bus = DdsBus(domain, DdsNetwork(local_only=True))
        self.found: list[dict[str, Any]] = []
        self.bus.read("topology", "/pgm_places/topology", reliable=True)
        self.maps = self.bus.writer("map", "/map", transient_local=True, depth=1)

    def until(self, done: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + PATIENCE_S
        while not done():
            assert time.monotonic() < end, f"{what}: not seen"
            self.bus.wait(0.1)
            self.bus.take(lambda _, raw: self.found.append(text_of(raw)))

    def labelled(self, number: int) -> set[int]:
        """The ids of the places of a map, once it has been labelled."""
        self.until(lambda: any(item["map_seq"] == number for item in self.found), f"map {number}")
        [item] = [item for item in self.found if item["map_seq"] == number]
        return {place["id"] for place in item["places"]}


def children_of(pid: int) -> list[int]:
    """The processes that a process has started."""
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in text.split()]


def test_killed_processes_cost_no_ids_and_leave_nothing(tmp_path: Path) -> None:
    domain = dds_domain("kills")
    grid, session, folder = building()[0].grid, tmp_path / "office.session", tmp_path / "tmp"
    folder.mkdir()
    save(places(), tmp_path / "model")
    half = grid.cells.copy()
    half[:, grid.shape[1] // 2 :] = -1
    words = ["live", "--dds", "--local", "--domain", str(domain), "--session", str(session)]
    words += ["--model", str(tmp_path / "model"), "--relabel-min-period", "0.1"]
    environment = {**os.environ, "TMPDIR": str(folder), "PYTHONPATH": str(ROOT)}

    def started() -> "subprocess.Popen[str]":
        return subprocess.Popen(
            [sys.executable, "-m", "pgm_places", *words],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )

    robot, node = Robot(domain), started()
    try:
        robot.maps.write(raw_map(grid.with_cells(half)))
        first = robot.labelled(1)
        [labels_maps] = children_of(node.pid)
        os.kill(labels_maps, signal.SIGKILL)
        robot.maps.write(raw_map(grid))
        second = robot.labelled(2)
        assert len(first & second) >= len(first) - 1  # a room may be joined with its other half
        node.kill()
        said = node.communicate()[1]
        assert "it is started again, and places keep their ids" in said
        robot.until(lambda: not any(folder.iterdir()), "an empty folder")
        assert read_session(session).last == second
        node = started()  # which gets the last map again, as it is kept for those who come later
        assert robot.labelled(3) == second
        node.send_signal(signal.SIGINT)
        node.communicate(timeout=PATIENCE_S)
        assert node.returncode == 0
        assert not any(folder.iterdir())
    finally:
        if node.poll() is None:
            node.kill()
            node.communicate()
