"""The request guard: checks of each request, and security headers of each reply.

A foreign page in the same browser must not reach the studio. It does not have the token of the
address, and its own name as ``Host`` or ``Origin`` is refused.
"""

import asyncio
import hmac
from dataclasses import dataclass

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST_BYTES = 4 << 20
"""Bytes of the largest body of a request; an outline with 100 000 points is smaller."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content-Security-Policy: everything comes from the studio itself, and nothing is inline."""

HEADERS = {
    "content-security-policy": POLICY,
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}

_SINGLE = ("host", "origin", "content-type", "content-length", "sec-fetch-site")
_TOO_LARGE = (413, f"the request is larger than {MOST_BYTES} bytes")


@dataclass(frozen=True)
class Guard:
    """An ASGI application that passes valid requests on to another one, without the token.

    The body of a request must arrive within ``body_s`` seconds.
    """

    inner: ASGIApp
    token: str
    port: int
    body_s: float

    @property
    def hosts(self) -> tuple[str, str]:
        """The names under which a browser on this computer may call the studio."""
        return (f"127.0.0.1:{self.port}", f"localhost:{self.port}")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one connection."""
        if scope["type"] == "lifespan":
            await self.inner(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        send, body = _with_headers(send), b""
        problem = self._problem(scope)
        if problem is None:
            try:
                async with asyncio.timeout(self.body_s):
                    body = await _whole_body(receive)
            except TimeoutError:
                problem = 408, f"the request did not arrive within {self.body_s:.0f} seconds"
            if len(body) > MOST_BYTES:
                problem = _TOO_LARGE
        if problem is not None:
            status, reason = problem
            refusal = PlainTextResponse(reason, status, {"connection": "close"})
            await refusal(scope, receive, send)
            return
        path = scope["path"].removeprefix(f"/{self.token}")
        inner = {**scope, "path": path, "raw_path": path.encode()}
        await self.inner(inner, _given(body, receive), send)

    def _problem(self, scope: Scope) -> tuple[int, str] | None:
        """The status and the reason to refuse a request; None for a valid request."""
        headers = Headers(scope=scope)
        if any(len(headers.getlist(name)) > 1 for name in _SINGLE):
            return 400, "a header that may occur only once occurs twice"
        if headers.get("host") not in self.hosts:
            return 403, f"the studio answers only as {self.hosts[0]}; open the address it printed"
        token = scope["path"].partition("/")[2].partition("/")[0]
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return 403, "the address lacks the token; open the complete address that was printed"
        if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            return 403, "the studio answers no other page"
        origins = [f"http://{host}" for host in self.hosts]
        writes = scope["method"] not in ("GET", "HEAD")
        if headers.get("origin", "" if writes else origins[0]) not in origins:
            return 403, "the studio answers no other page"
        if not writes:
            return None
        if scope["method"] != "POST":
            return 405, "only GET and POST are understood"
        if headers.get("content-type", "").partition(";")[0] != "application/json":
            return 415, "a request must be JSON; files cannot be uploaded"
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > MOST_BYTES:
            return _TOO_LARGE
        return None


async def _whole_body(receive: Receive) -> bytes:
    """The body; reading stops beyond the limit, even if the declared length was smaller."""
    body, more = b"", True
    while more and len(body) <= MOST_BYTES:
        message = await receive()
        if message["type"] == "http.disconnect":
            return b""
        body += message.get("body", b"")
        more = message.get("more_body", False)
    return body


def _given(body: bytes, receive: Receive) -> Receive:
    """A receiver that returns a body that has been read, then all later messages."""
    pending = [{"type": "http.request", "body": body, "more_body": False}]

    async def received() -> Message:
        return pending.pop() if pending else await receive()

    return received


def _with_headers(send: Send) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(HEADERS)
        await send(message)

    return sent
