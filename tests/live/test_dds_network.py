"""Cyclone gets the interface and the peers that were named, or the user's own configuration."""

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from pgm_places.errors import ConfigError
from pgm_places.live.dds_bus import DdsNetwork
from tests.live.dds_domains import dds_domain
from tests.real_data import ROOT

SPACE = "{https://cdds.io/config}"


def found(network: DdsNetwork, path: str) -> list[ElementTree.Element]:
    root = ElementTree.fromstring(network.config({}))
    return root.findall("/".join(SPACE + part for part in ("Domain", *path.split("/"))))


def test_an_interface_is_named_or_given_by_its_address() -> None:
    [chosen] = found(DdsNetwork(interface="wlan0"), "General/Interfaces/NetworkInterface")
    assert chosen.attrib == {"name": "wlan0"}
    for address in ("10.0.0.7", "fe80::1"):
        [chosen] = found(DdsNetwork(interface=address), "General/Interfaces/NetworkInterface")
        assert chosen.attrib == {"address": address}
    [chosen] = found(DdsNetwork(interface='a"<b'), "General/Interfaces/NetworkInterface")
    assert chosen.attrib == {"name": 'a"<b'}
    assert not found(DdsNetwork(), "General")


def test_peers_are_listed() -> None:
    network = DdsNetwork(peers=("10.0.0.7", "robot.local"))
    peers = [item.get("address") for item in found(network, "Discovery/Peers/Peer")]
    assert peers == ["10.0.0.7", "robot.local"]
    assert not found(network, "General/AllowMulticast")  # others may still be found by it
    assert found(DdsNetwork(local_only=True), "General/AllowMulticast")[0].text == "false"


def test_what_the_user_s_variable_says_comes_last_and_wins() -> None:
    own = DdsNetwork().config({})
    users = {"CYCLONEDDS_URI": " file:///etc/cyclone.xml "}
    assert DdsNetwork().config(users) == f"{own},file:///etc/cyclone.xml"
    assert "etc" not in DdsNetwork(local_only=True).config(users)


@pytest.mark.parametrize(
    ("network", "environment", "words"),
    [
        (DdsNetwork(interface="lo"), {"CYCLONEDDS_URI": "x"}, "says what --interface would say"),
        (DdsNetwork(peers=("a",)), {"CYCLONEDDS_URI": "x"}, "says what --peer would say"),
        (DdsNetwork(True, "lo"), {}, "--local and --interface exclude each other"),
        (DdsNetwork(True, peers=("a",)), {}, "--local and --peer exclude each other"),
        (DdsNetwork(peers=("a", " ")), {}, "needs the address or the name of a machine"),
    ],
)
def test_contradictions_are_refused(
    network: DdsNetwork, environment: dict[str, str], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        network.config(environment)


TALK = """
import sys, time
from pgm_places.errors import ConfigError
from pgm_places.live.dds_bus import DdsBus
from pgm_places.live.dds_bus import DdsNetwork

domain, interface, seconds = int(sys.argv[1]), sys.argv[2], float(sys.argv[3])
peers = ("127.0.0.1",) if interface else ()
try:
    bus = DdsBus(domain, DdsNetwork(interface=interface, peers=peers))
except ConfigError as error:
    sys.exit(str(error))
bus.read("place", "/place", reliable=True)
writer = bus.writer("place", "/place")
print("ready", flush=True)
end = time.monotonic() + seconds
while time.monotonic() < end and writer.n_readers < 2:
    time.sleep(0.05)
print(writer.n_readers, flush=True)
sys.stdin.readline()
"""


def pair(domain: int, configs: list[str], interface: str, seconds: float) -> list[int]:
    """How many readers each of two processes has found, its own among them."""
    talkers = []
    for config in configs:
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "CYCLONEDDS_URI": config}
        command = [sys.executable, "-c", TALK, str(domain), interface, str(seconds)]
        talkers.append(
            subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env=environment,
            )
        )
    try:
        found = []
        for talker in talkers:
            assert talker.stdout is not None
            assert talker.stdout.readline() == "ready\n", talker.communicate()[1]
            found.append(int(talker.stdout.readline()))
    finally:
        for talker in talkers:
            talker.communicate("\n")
    return found


def test_two_processes_find_each_other_over_an_interface_that_is_named() -> None:
    pytest.importorskip("cyclonedds", reason="the extra dds is not installed")
    assert pair(dds_domain("interface"), ["", ""], "lo", 60.0) == [2, 2]


def tagged(tag: str) -> str:
    """A configuration as users write it: only those of the same tag see each other."""
    return (
        '<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>'
        "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
        f'</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers><Tag>{tag}</Tag></Discovery>'
    )


def test_the_user_s_configuration_is_respected() -> None:
    pytest.importorskip("cyclonedds", reason="the extra dds is not installed")
    domain = dds_domain("tags")
    assert pair(domain, [tagged("a"), tagged("a")], "", 60.0) == [2, 2]
    assert pair(domain, [tagged("a"), tagged("b")], "", 4.0) == [1, 1]


def test_an_interface_that_is_not_there_is_said_in_one_line(tmp_path: Path) -> None:
    pytest.importorskip("cyclonedds", reason="the extra dds is not installed")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "CYCLONEDDS_URI": ""}
    found = subprocess.run(
        [sys.executable, "-c", TALK, "220", "nowhere7", "1"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 1
    last = found.stderr.strip().splitlines()[-1]
    assert last.startswith("DDS cannot be spoken over the interface 'nowhere7'")
    assert "interfaces of this machine: lo" in last
