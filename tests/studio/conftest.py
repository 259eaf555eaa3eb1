"""A small map on a session without a model, and a client that speaks to it as a browser would."""

import asyncio
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from pgm_places.io.maps.map_server import load_map, save_map
from pgm_places.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from pgm_places.studio.server import application
from pgm_places.studio.session import MapSession
from pgm_places.studio.session_pool import SessionPool

TOKEN, PORT, HOST = "t" * 32, 8123, "http://127.0.0.1:8123"


def two_rooms() -> OccupancyGrid:
    """Two rooms of 20 x 20 cells beside each other, with a door of 4 cells in the wall between."""
    cells = np.full((30, 50), UNKNOWN, np.int8)
    cells[4:26, 4:47] = OCCUPIED
    cells[5:25, 5:25] = cells[5:25, 26:46] = FREE
    cells[13:17, 25] = FREE
    return OccupancyGrid(cells, 0.2, (1.0, -2.0))


def rectangle(label: int, *corners: Sequence[float]) -> dict[str, Any]:
    """The edit that paints a rectangle in a class."""
    stroke = {"tool": "rectangle", "points": [list(corner) for corner in corners], "radius": 1}
    return {"kind": "stroke", "label": label, "stroke": stroke}


def wait(session: MapSession, revision: int | None = None) -> None:
    """Wait until the labels follow the painting, or have come to a revision of it."""
    deadline = time.monotonic() + 300
    while (
        session.relabelling is None
        or session.relabelling.revision < (revision or 0)
        or session.learner.state.working
        or (revision is None and session.learner._waiting)
    ):
        assert not session.learner.state.problem and time.monotonic() < deadline
        time.sleep(0.02)


@pytest.fixture
def map_yaml(tmp_path: Path) -> Path:
    """The two rooms as a file."""
    save_map(two_rooms(), tmp_path / "rooms")
    return tmp_path / "rooms.yaml"


@pytest.fixture
def open_session(map_yaml: Path) -> Iterator[Callable[[], MapSession]]:
    """Makes sessions for the map, without a model; all use the same folder."""
    made: list[MapSession] = []

    def make() -> MapSession:
        made.append(MapSession(load_map(map_yaml), map_yaml.parent / "kept", None))
        return made[-1]

    yield make
    for session in made:
        session.close()


@pytest.fixture
def session(open_session: Callable[[], MapSession]) -> MapSession:
    """A session of which nothing has been asked."""
    return open_session()


class Client:
    """Requests to the application of a session or a pool, without a network."""

    def __init__(
        self, session: MapSession | SessionPool, base_url: str, headers: dict[str, str]
    ) -> None:
        pool = SessionPool.of(session) if isinstance(session, MapSession) else session
        self.pool, self.app = pool, application(pool, token=TOKEN, port=PORT)
        self.base_url, self.headers = base_url, headers

    def request(self, method: str, path: str, **values: Any) -> httpx.Response:
        async def answer() -> httpx.Response:
            transport = httpx.ASGITransport(self.app)
            async with httpx.AsyncClient(
                transport=transport, base_url=self.base_url, headers=self.headers
            ) as client:
                return await client.request(method, path, **values)

        return asyncio.run(answer())

    def get(self, path: str, **values: Any) -> httpx.Response:
        return self.request("GET", path, **values)

    def post(self, path: str, **values: Any) -> httpx.Response:
        return self.request("POST", path, **values)


@pytest.fixture
def client(session: MapSession) -> Client:
    """Requests as the studio's own page makes them."""
    return Client(session, f"{HOST}/{TOKEN}/", {"origin": HOST})


@pytest.fixture
def stranger(session: MapSession) -> Client:
    """Requests without anything that the studio's page would add."""
    return Client(session, HOST, {})
