"""Several maps in one studio: what is open, how far each is, and one configuration for all."""

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pgm_places.errors import InputError
from pgm_places.experiment.config import load_config
from pgm_places.io.maps.label_image import load_labels
from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.studio.session import MapSession
from pgm_places.studio.session_pool import MOST_OPEN, MapEntry, SessionPool
from tests.refusals import refused
from tests.studio.conftest import HOST, Client, rectangle, two_rooms


def book(folder: Path, title: str) -> MapEntry:
    save_map(two_rooms(), folder / title)
    kept = folder / "kept" / title
    return MapEntry(title, kept, lambda: MapSession(load_map(folder / f"{title}.yaml"), kept, None))


@pytest.fixture
def pool(tmp_path: Path) -> Iterator[SessionPool]:
    found = SessionPool([book(tmp_path, f"floor {k}") for k in range(6)], tmp_path / "kept")
    yield found
    found.close()


def test_maps_open_when_they_are_looked_at_and_few_stay_open(pool: SessionPool) -> None:
    assert [record["painted_before"] for record in pool.records()] == [False] * 6
    first = pool.session(0)
    first.edit(rectangle(0, [6, 6], [24, 24]))
    assert pool.session(0) is first
    for number in range(1, 1 + MOST_OPEN):
        pool.session(number)
    assert first.closing  # it has waited longest
    record = pool.records()[0]
    assert record["painted_m2"] == pytest.approx(18 * 18 * 0.04) and record["painted_before"]
    again = pool.session(0)
    assert again is not first and again.painting.n_painted == 18 * 18
    refused(InputError, "there is no map 6; there are 6", pool.session, 6)


def test_maps_with_a_live_tab_stay_open(pool: SessionPool) -> None:
    sessions = []
    for number in range(6):
        pool.tabs[number].polled(f"tab{number}")
        sessions.append(pool.session(number))
    assert [pool.session(number) for number in range(6)] == sessions
    assert not any(session.closing for session in sessions)
    pool.tabs[2].left("tab2")
    pool.tabs[2].polled("not a tab")
    assert [len(tabs) for tabs in pool.tabs] == [1, 1, 0, 1, 1, 1]


def test_polls_of_more_tabs_than_maps_stay_open_open_each_map_once(pool: SessionPool) -> None:
    opened: list[str] = []

    def counted(book: MapEntry) -> MapEntry:
        def make() -> MapSession:
            opened.append(book.title)
            return book.open()

        return replace(book, open=make)

    pool.books = tuple(counted(book) for book in pool.books)
    client = Client(pool, f"{HOST}/{'t' * 32}/", {"origin": HOST})
    for _ in range(3):
        for number in range(6):
            answer = client.get(f"maps/{number}/state?after=-1&tab=tab{number}")
            assert answer.status_code == 200
    assert opened == [book.title for book in pool.books]


def test_a_map_that_cannot_be_read_says_so_in_the_list(tmp_path: Path) -> None:
    broken = MapEntry(
        "gone", tmp_path / "gone", lambda: MapSession(load_map(tmp_path / "x.yaml"), tmp_path, None)
    )
    pool = SessionPool([broken, book(tmp_path, "here")], tmp_path)
    refused(InputError, r"x\.yaml", pool.session, 0)
    assert "x.yaml" in pool.records()[0]["problem"]


def test_one_configuration_teaches_the_paint_of_all_maps(pool: SessionPool, tmp_path: Path) -> None:
    refused(InputError, "nothing is painted on any of the maps yet", pool.write_training)
    pool.session(0).edit(rectangle(0, [6, 6], [24, 24]))
    pool.session(3).edit({"kind": "class", "index": 3, "name": "lab", "colour": "#112233"})
    pool.session(3).edit(rectangle(3, [6, 6], [24, 24]))
    for number in (1, 2, 4, 5):
        pool.session(number)  # both are closed by now
    written = pool.write_training()
    assert written[0] == tmp_path / "kept" / "train.toml" and all(p.exists() for p in written)
    config = load_config(written[0])
    assert config.labels.names == ("corridor", "room", "doorway", "lab")
    assert [Path(str(item.map)) for item in config.train] == [
        tmp_path / f"floor {number}.yaml" for number in (0, 3)
    ]
    for item, name in zip(config.train, ("corridor", "lab"), strict=True):
        assert item.corrections is not None
        kept = load_labels(
            written[0].parent / item.corrections, config.labels.names, grid=two_rooms()
        )
        assert np.unique(kept).tolist() == [-1, config.labels.names.index(name)]


def test_the_list_and_each_map_have_addresses_of_their_own(pool: SessionPool) -> None:
    client = Client(pool, f"{HOST}/{'t' * 32}/", {"origin": HOST})
    assert b"maps.js" in client.get("").content
    assert b"main.js" in client.get("maps/2/").content
    assert client.get("maps/2/static/main.js").status_code == 200
    state = client.get("maps/2/state").json()
    assert state["map"]["name"] == "floor 2" and state["pool"] == {"number": 2, "of": 6}
    client.post("maps/2/edit", json=rectangle(1, [6, 6], [9, 9])).raise_for_status()
    client.post("maps/2/edit", json=rectangle(0, [30, 6], [33, 9])).raise_for_status()
    deadline = time.monotonic() + 300
    while not (records := client.get("maps").json()["maps"])[2].get("doubtful_m2"):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert [record["title"] for record in records] == [f"floor {k}" for k in range(6)]
    files = client.post("training", json={}).json()["files"]
    assert files[0].endswith("train.toml")
    assert client.get("maps/7/state").status_code == 404
