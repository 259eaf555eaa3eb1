"""The studio's web application: what each address answers."""

import asyncio
import json
import time
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from pgm_places.errors import InputError, PgmPlacesError
from pgm_places.studio.desk import Desk
from pgm_places.studio.exports import write_export
from pgm_places.studio.guard import Guard
from pgm_places.studio.reasons import reasons_record
from pgm_places.studio.records import cell_record, drive_record, places_record, state_record

__all__ = ["application", "static_files"]

KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
WAIT_S, LOOK_S = 20.0, 0.04
"""How long a question for news waits for some, and how often it looks."""


def static_files() -> dict[str, bytes]:
    """The page's own files by name: nothing else on the disk is ever sent."""
    folder = files("pgm_places.studio") / "static"
    return {
        item.name: item.read_bytes()
        for item in folder.iterdir()
        if item.is_file() and "." + item.name.rpartition(".")[2] in KINDS
    }


class _Answers:
    """The routes and what they answer about one desk."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self.static = static_files()
        self.tabs: dict[str, float] = {}

    def page(self, _: Request) -> Response:
        return self._static("index.html")

    def file(self, request: Request) -> Response:
        return self._static(request.path_params["name"])

    def _static(self, name: str) -> Response:
        content = self.static.get(name)
        if content is None:
            return PlainTextResponse("no such file", 404)
        kind = KINDS["." + name.rpartition(".")[2]]
        return Response(content, headers={"content-type": kind, "cache-control": "no-cache"})

    async def state(self, request: Request) -> Response:
        """The state as soon as it is newer than ``after``; the old one when nothing happens."""
        after = int(request.query_params.get("after", "-1"))
        tab = request.query_params.get("tab", "")
        self._seen(tab)
        tabs, deadline = self._n_tabs(), time.monotonic() + WAIT_S
        while self.desk.tick == after and self._n_tabs() == tabs and time.monotonic() < deadline:
            await asyncio.sleep(LOOK_S)
            if self.desk.closing:
                break
            if await request.is_disconnected():
                self.tabs.pop(tab, None)
                return _json({})
        self._seen(tab)
        record = await run_in_threadpool(state_record, self.desk)
        return _json({**record, "tabs": self._n_tabs()})

    def _seen(self, tab: str) -> None:
        if tab.isalnum() and len(tab) <= 40:
            self.tabs[tab] = time.monotonic()

    def _n_tabs(self) -> int:
        oldest = time.monotonic() - WAIT_S - 5
        for tab in [tab for tab, seen in list(self.tabs.items()) if seen < oldest]:
            self.tabs.pop(tab, None)
        return len(self.tabs)

    def places(self, _: Request) -> Response:
        taught = self.desk.taught
        return _json({} if taught is None else places_record(taught))

    def cell(self, request: Request) -> Response:
        point = [float(request.query_params[name]) for name in ("x", "y")]
        if not all(abs(value) < 1e9 for value in point):
            raise InputError("x and y must be finite numbers of cells")
        return _json(cell_record(self.desk, *point))

    def door_line(self, request: Request) -> Response:
        """Where a doorway would end that is drawn along two points."""
        x1, y1, x2, y2 = (float(request.query_params[name]) for name in ("x1", "y1", "x2", "y2"))
        if not all(abs(value) < 1e9 for value in (x1, y1, x2, y2)):
            raise InputError("x1, y1, x2 and y2 must be finite numbers of cells")
        return _json({"ends": self.desk.door_line([(x1, y1), (x2, y2)])})

    def reasons(self, request: Request) -> Response:
        taught = self.desk.taught
        if taught is None:
            raise InputError("there are no labels yet; wait until the map has been labelled")
        x_m, y_m = (float(request.query_params[name]) for name in ("x_m", "y_m"))
        return _json(reasons_record(taught, x_m, y_m))

    def drive(self, _: Request) -> Response:
        return _json(drive_record(self.desk))

    def tile(self, request: Request) -> Response:
        where = request.path_params
        theme = request.query_params.get("theme")
        content = self.desk.layers.tile(
            where["layer"],
            where["level"],
            where["row"],
            where["column"],
            classes=self.desk.painting.classes,
            theme="dark" if theme == "dark" else "light",
        )
        headers = {"cache-control": "private, max-age=3600, immutable"}  # addresses have a version
        return Response(content, media_type="image/png", headers=headers)

    async def edit(self, request: Request) -> Response:
        body = await _body(request)
        remark = await run_in_threadpool(self.desk.edit, body)
        answer = {"tick": self.desk.tick, "revision": self.desk.painting.revision}
        return _json({**answer, "remark": remark})

    async def export(self, request: Request) -> Response:
        body = await _body(request)
        written = await run_in_threadpool(write_export, self.desk, str(body.get("what")))
        return _json({"files": [str(path) for path in written]})


async def _body(request: Request) -> Mapping[str, Any]:
    try:
        body = await request.json()
    except (ValueError, RecursionError):
        body = None
    if not isinstance(body, dict):
        raise InputError("a request must be a JSON object")
    return body


def _json(value: Any) -> Response:
    headers = {"cache-control": "no-store"}
    content = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return Response(content, media_type="application/json", headers=headers)


def _refused(_: Request, error: Exception) -> Response:
    return JSONResponse({"problem": str(error) or "the request is not understood"}, 400)


def application(desk: Desk, *, token: str, port: int) -> Guard:
    """The application of a desk, behind its guard."""
    answers = _Answers(desk)
    routes = [
        Route("/", answers.page),
        Route("/static/{name}", answers.file),
        Route("/state", answers.state),
        Route("/places", answers.places),
        Route("/cell", answers.cell),
        Route("/door-line", answers.door_line),
        Route("/reasons", answers.reasons),
        Route("/drive", answers.drive),
        Route("/tile/{layer}/{level:int}/{row:int}/{column:int}.png", answers.tile),
        Route("/edit", answers.edit, methods=["POST"]),
        Route("/export", answers.export, methods=["POST"]),
    ]
    refused = dict.fromkeys((PgmPlacesError, ValueError, KeyError), _refused)
    inner: Any = Starlette(routes=routes, exception_handlers=refused)
    return Guard(inner, token, port)
