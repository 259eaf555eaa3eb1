"""The server: the studio on a port of this computer, until a signal ends it."""

import asyncio
import contextlib
import os
import secrets
import socket
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, cast

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from pgm_places.errors import OutputError
from pgm_places.io.staging import open_own
from pgm_places.studio.app import application
from pgm_places.studio.session_pool import SessionPool

MOST_CONNECTIONS = 64
"""Most connections: enough for several tabs with six each; further ones are refused."""


class BoundedConnection(H11Protocol):
    """A connection that is closed unless the head of each request arrives in time."""

    _ends: asyncio.TimerHandle | None = None

    def __init__(self, *values: Any, request_s: float, **named: Any) -> None:
        super().__init__(*values, **named)
        self._request_s = request_s

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept a connection, or close it if there are too many."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
            return
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Receive data; the time runs until the head of a request is complete."""
        super().data_received(data)
        if self._answers or not self.conn.trailing_data[0]:
            self._wait_no_more()
        elif self._ends is None:
            self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer of an ended connection."""
        self._wait_no_more()
        super().connection_lost(exc)

    @property
    def _answers(self) -> bool:
        """Whether a request is being answered; the guard limits the time of its body."""
        return self.cycle is not None and not self.cycle.response_complete

    def _wait(self) -> None:
        self._ends = self.loop.call_later(self._request_s, self.transport.abort)

    def _wait_no_more(self) -> None:
        if self._ends is not None:
            self._ends.cancel()
            self._ends = None


HOST = "127.0.0.1"
"""Address of the server: reachable from this computer only."""

PORT_FILE = "port"
FIRST_PORT, LAST_PORT = 1024, 65535
_LONGEST_PORT = 8  # characters


def serve(pool: SessionPool, *, port: int = 0, on_address: Callable[[str], None]) -> None:
    """Serve the maps of a pool until SIGINT or SIGTERM.

    Port 0 is the port of the last run in the pool's folder if it is free, or else any free port.
    ``on_address`` gets the address, token included, once browsers may open it.
    """
    with _listening(port) if port else _listening_again(pool.folder / PORT_FILE) as listener:
        number = listener.getsockname()[1]
        token = secrets.token_urlsafe(24)
        app = application(pool, token=token, port=number)
        config = uvicorn.Config(
            app,
            http=cast(Any, partial(BoundedConnection, request_s=pool.request_s)),
            log_level="error",
            access_log=False,  # addresses hold the token
            server_header=False,
            timeout_graceful_shutdown=1,  # waiting requests for news would never end
            timeout_keep_alive=30,
        )
        pool.start()
        on_address(f"http://{HOST}:{number}/{token}/")
        _Server(config, pool).run(sockets=[listener])


def _listening_again(kept: Path) -> socket.socket:
    """A listener on the port in a file if it is free, else on any, whose port is then saved."""
    # With the same port, open pages of the last studio can show the address of the new one.
    try:
        with os.fdopen(open_own(kept, os.O_RDONLY), encoding="ascii") as file:
            port = int(file.read(_LONGEST_PORT))
        listener = _listening(port if FIRST_PORT <= port <= LAST_PORT else 0)
    except (OSError, ValueError, OutputError):
        listener = _listening(0)
    with contextlib.suppress(OSError, OutputError):  # the saved port is only a convenience
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        with os.fdopen(open_own(kept, flags), "w", encoding="ascii") as file:
            file.write(f"{listener.getsockname()[1]}\n")
    return listener


class _Server(uvicorn.Server):
    """A server that ends waiting requests for news before it ends itself."""

    def __init__(self, config: uvicorn.Config, pool: SessionPool) -> None:
        super().__init__(config)
        self._pool = pool

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._pool.end()
        await super().shutdown(sockets)


def _listening(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise OutputError(
            f"cannot listen on port {port}: {error.strerror or error}; choose another with --port, "
            "or leave it out for any that is free"
        ) from None
    return listener
