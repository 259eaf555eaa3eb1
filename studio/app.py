"""The studio's web application: what each address answers."""

import asyncio
import json
import time
from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route

from pgm_places.errors import InputError, PgmPlacesError
from pgm_places.io.input_file import parsed_json
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
        self.tabs.seen(tab)  # first: the map of a tab stays open
        session = await run_in_threadpool(lambda: self.session)
        tabs, deadline = len(self.tabs), time.monotonic() + self.pool.news_s
        while session.tick == after and len(self.tabs) == tabs and time.monotonic() < deadline:
            await asyncio.sleep(LOOK_S)
            if session.closing:
                break
            if await request.is_disconnected():
                self.tabs.left(tab)
                return _json({})
        self.tabs.seen(tab)
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
