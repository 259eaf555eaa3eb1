"""Connections that ask for nothing, or for half of something, end by themselves."""

import socket
import threading
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from pgm_places.studio.server import MOST_CONNECTIONS, _Server, serve
from pgm_places.studio.session import MapSession
from pgm_places.studio.session_pool import SessionPool

PATIENCE_S = 60.0


@pytest.fixture
def address(
    session: MapSession, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[str]:
    """The address of a studio that waits a fifth of a second, or the parameter, for a request."""
    pool = SessionPool.of(session)
    pool.request_s = getattr(request, "param", 0.2)
    monkeypatch.setattr("uvicorn.Server.install_signal_handlers", lambda _: None, raising=False)
    servers: list[_Server] = []
    made = _Server.__init__

    def noted(self: _Server, *values: object) -> None:
        made(self, *values)  # type: ignore[arg-type]
        servers.append(self)

    monkeypatch.setattr(_Server, "__init__", noted)
    told: list[str] = []
    thread = threading.Thread(target=serve, args=(pool,), kwargs={"on_address": told.append})
    thread.start()
    deadline = time.monotonic() + PATIENCE_S
    while not (servers and servers[0].started):
        assert time.monotonic() < deadline and thread.is_alive()
        time.sleep(0.01)
    yield told[0]
    servers[0].should_exit = True
    thread.join(PATIENCE_S)


def connected(address: str) -> socket.socket:
    found = socket.create_connection(("127.0.0.1", urlsplit(address).port or 0))
    found.settimeout(PATIENCE_S)
    return found


def answer(sent: socket.socket) -> bytes:
    """All that comes until the other side ends the connection."""
    found = b""
    try:
        while part := sent.recv(4096):
            found += part
    except ConnectionResetError:
        pass
    return found


def head(address: str, method: str, path: str, *lines: str) -> bytes:
    parts = urlsplit(address)
    first = f"{method} {parts.path}{path} HTTP/1.1\r\nHost: {parts.netloc}\r\n"
    return (first + "".join(f"{line}\r\n" for line in lines)).encode()


def test_half_a_request_ends_after_its_time(address: str) -> None:
    with connected(address) as silent, connected(address) as half, connected(address) as second:
        half.sendall(head(address, "GET", "state"))  # without the empty line at its end
        second.sendall(head(address, "GET", "static/icon.svg") + b"\r\n")
        second.sendall(b"GET /")  # a whole request, then half a one
        assert answer(silent) == b""
        assert answer(half) == b""
        assert b"200 OK" in answer(second)


def test_half_a_body_is_refused_after_its_time(address: str) -> None:
    origin = "Origin: http://" + urlsplit(address).netloc
    lines = (origin, "Content-Type: application/json", "Content-Length: 100")
    with connected(address) as sent:
        sent.sendall(head(address, "POST", "edit", *lines) + b'\r\n{"kind"')
        assert answer(sent).startswith(b"HTTP/1.1 408")


@pytest.mark.parametrize("address", [3600.0], indirect=True)
def test_connections_beyond_the_bound_are_turned_away(address: str) -> None:
    first = [connected(address) for _ in range(MOST_CONNECTIONS)]
    more = [connected(address) for _ in range(5)]
    assert [answer(each) for each in more] == [b""] * 5
    first[0].sendall(head(address, "GET", "static/icon.svg", "Connection: close") + b"\r\n")
    assert b"200 OK" in answer(first[0])
    for each in (*first, *more):
        each.close()
