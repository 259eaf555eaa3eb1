"""The studio's server: what each address answers, and the connections of browsers."""

import asyncio
import contextlib
import json
import os
import secrets
import socket
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path, PurePath
from typing import Any, cast

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from uvicorn.protocols.http.h11_impl import H11Protocol

from pgm_places.errors import InputError, OutputError, PgmPlacesError
from pgm_places.io.input_file import parsed_json
from pgm_places.io.staging import open_own
from pgm_places.progress import warnings_noted
from pgm_places.studio import records
from pgm_places.studio.exports import edit_with_exports, exports_record, write_export
from pgm_places.studio.layers import Theme
from pgm_places.studio.request_guard import Guard
from pgm_places.studio.session import MapSession
from pgm_places.studio.session_pool import SessionPool

KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
LOOK_S = 0.04
"""How often a request for news looks for them (s)."""


def static_files() -> dict[str, bytes]:
    """The page's own files by name: nothing else on the disk is ever sent."""
    folder = Path(__file__).parent / "static"
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in KINDS}


class _Files:
    """The page's own files, of which one is the page."""

    def __init__(self, page: str) -> None:
        self.static, self._page = static_files(), page

    def file(self, request: Request) -> Response:
        name = request.path_params.get("name", self._page)
        if name not in self.static:
            return PlainTextResponse("no such file", 404)
        headers = {"content-type": KINDS[PurePath(name).suffix], "cache-control": "no-cache"}
        return Response(self.static[name], headers=headers)

    @property
    def routes(self) -> list[Route]:
        return [Route("/", self.file), Route("/static/{name}", self.file)]


class _Overview(_Files):
    """Routes about all maps of a pool."""

    def __init__(self, pool: SessionPool) -> None:
        super().__init__("maps.html")
        self.pool = pool

    def maps(self, _: Request) -> Response:
        return _json({"maps": self.pool.records()})

    async def training(self, _: Request) -> Response:
        written = await run_in_threadpool(self.pool.write_training)
        return _json({"files": [str(path) for path in written]})

    @property
    def routes(self) -> list[Route]:
        more = [Route("/maps", self.maps), Route("/training", self.training, methods=["POST"])]
        return [*super().routes, *more]


class _Answers(_Files):
    """Routes about one session of a pool."""

    def __init__(self, pool: SessionPool, number: int) -> None:
        super().__init__("index.html")
        self.pool, self.number = pool, number
        self.tabs = pool.tabs[number]

    @property
    def session(self) -> MapSession:
        return self.pool.session(self.number)

    async def state(self, request: Request) -> Response:
        """The state once it is newer than ``after``, or the old state after a time without news."""
        after = int(request.query_params.get("after", "-1"))
        tab = request.query_params.get("tab", "")
        self.tabs.polled(tab)  # first: the map of a tab stays open
        session = await run_in_threadpool(lambda: self.session)
        tabs, deadline = len(self.tabs), time.monotonic() + self.pool.news_s
        while session.tick == after and len(self.tabs) == tabs and time.monotonic() < deadline:
            await asyncio.sleep(LOOK_S)
            if session.closing:
                break
            if await request.is_disconnected():
                self.tabs.left(tab)
                return _json({})
        self.tabs.polled(tab)
        record = await run_in_threadpool(records.state_record, session)
        position = {"number": self.number, "of": len(self.pool)}
        return _json({**record, "tabs": len(self.tabs), "pool": position})

    def places(self, _: Request) -> Response:
        taught = self.session.taught
        return _json({} if taught is None else records.places_record(taught))

    def cell(self, request: Request) -> Response:
        return _json(records.cell_record(self.session, *_numbers(request, "x", "y")))

    async def parts(self, request: Request) -> Response:
        """The number of rooms that a place looks like."""
        number = int(request.query_params["id"])
        return _json({"parts": await run_in_threadpool(self.session.n_parts, number)})

    def door_line(self, request: Request) -> Response:
        """Both ends of a doorway drawn along two points."""
        x1, y1, x2, y2 = _numbers(request, "x1", "y1", "x2", "y2")
        return _json({"ends": self.session.door_line([(x1, y1), (x2, y2)])})

    def reasons(self, request: Request) -> Response:
        return _json(records.reasons_record(self.session.answer, *_numbers(request, "x_m", "y_m")))

    def drive(self, _: Request) -> Response:
        return _json(records.drive_record(self.session))

    def tile(self, request: Request) -> Response:
        theme: Theme = "dark" if request.query_params.get("theme") == "dark" else "light"
        classes = self.session.painting.classes
        content = self.session.layers.tile(**request.path_params, classes=classes, theme=theme)
        headers = {"cache-control": "private, max-age=3600, immutable"}  # addresses have a version
        return Response(content, media_type="image/png", headers=headers)

    async def edit(self, request: Request) -> Response:
        body = await _body(request)
        session = await run_in_threadpool(lambda: self.session)
        remark = await run_in_threadpool(edit_with_exports, session, body)
        revision = session.painting.revision
        return _json({"tick": session.tick, "revision": revision, "remark": remark})

    def exports(self, request: Request) -> Response:
        """The exports of a folder, and which of them are outdated."""
        chosen = request.query_params.get("folder", "")
        return _json(exports_record(self.session, self.pool.export_folders, chosen))

    async def export(self, request: Request) -> Response:
        body = await _body(request)
        what, chosen = str(body.get("what")), str(body.get("folder", ""))
        replaced = body.get("replaced", [])
        if not isinstance(replaced, list):
            raise InputError("'replaced' must be a list of names")
        folders = self.pool.export_folders

        def write() -> Response:
            with warnings_noted() as remarks:
                written = write_export(
                    self.session, what, folders, chosen=chosen, replaced=replaced
                )
            return _json({"files": [str(path) for path in written], "remarks": remarks})

        return await run_in_threadpool(write)

    @property
    def routes(self) -> list[Route]:
        return [
            *super().routes,
            Route("/state", self.state),
            Route("/places", self.places),
            Route("/cell", self.cell),
            Route("/parts", self.parts),
            Route("/door-line", self.door_line),
            Route("/reasons", self.reasons),
            Route("/drive", self.drive),
            Route("/tile/{layer}/{level:int}/{row:int}/{column:int}.png", self.tile),
            Route("/edit", self.edit, methods=["POST"]),
            Route("/exports", self.exports),
            Route("/export", self.export, methods=["POST"]),
        ]


def _numbers(request: Request, *names: str) -> list[float]:
    """Numbers in the query of a request."""
    values = [float(request.query_params[name]) for name in names]
    if not all(abs(value) < 1e9 for value in values):
        raise InputError(f"{', '.join(names)} must be finite numbers")
    return values


async def _body(request: Request) -> Mapping[str, object]:
    try:
        text = (await request.body()).decode()
        body = parsed_json(text, Path("the request"), InputError)
    except (UnicodeDecodeError, InputError):
        body = None
    if not isinstance(body, dict):
        raise InputError("a request must be a JSON object")
    return body


def _json(value: object) -> Response:
    headers = {"cache-control": "no-store"}
    content = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return Response(content, media_type="application/json", headers=headers)


def _refused(_: Request, error: Exception) -> Response:
    return JSONResponse({"problem": str(error) or "the request is not understood"}, 400)


def application(pool: SessionPool, *, token: str, port: int) -> Guard:
    """The application of a pool, behind its guard: the page of its map, or a list of its maps."""
    sessions = [_Answers(pool, number) for number in range(len(pool))]
    routes: list[BaseRoute] = [*sessions[0].routes]
    if len(pool) > 1:
        mounts = (Mount(f"/maps/{k}", routes=each.routes) for k, each in enumerate(sessions))
        routes = [*_Overview(pool).routes, *mounts]
    refused = dict.fromkeys((PgmPlacesError, ValueError, KeyError), _refused)
    inner: Any = Starlette(routes=routes, exception_handlers=refused)
    return Guard(inner, token, port, pool.request_s)


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


def _listening_again(port_file: Path) -> socket.socket:
    """A listener on the port in a file if it is free, else on any, whose port is then saved."""
    # With the same port, open pages of the last studio can show the address of the new one.
    try:
        with os.fdopen(open_own(port_file, os.O_RDONLY), encoding="ascii") as file:
            port = int(file.read(_LONGEST_PORT))
        listener = _listening(port if FIRST_PORT <= port <= LAST_PORT else 0)
    except (OSError, ValueError, OutputError):
        listener = _listening(0)
    with contextlib.suppress(OSError, OutputError):  # the saved port is only a convenience
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        with os.fdopen(open_own(port_file, flags), "w", encoding="ascii") as file:
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
