"""Connections to the studio: so many at once, and none that keeps its place without asking."""

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 64
"""Several tabs with six connections each fit; a program that opens more is turned away."""

REQUEST_S = 10.0
"""So long the head of a request may take to arrive; the guard bounds its body."""


class BoundedConnection(H11Protocol):
    """A connection that ends unless each request arrives within seconds."""

    _ends: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, or end it where there are too many."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
            return
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Take what came; the time runs until the head of a request is whole."""
        super().data_received(data)
        if self._answers or not self.conn.trailing_data[0]:
            self._wait_no_more()
        elif self._ends is None:
            self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """The connection has ended."""
        self._wait_no_more()
        super().connection_lost(exc)

    @property
    def _answers(self) -> bool:
        """Whether a request is being answered; the guard bounds how long its body may take."""
        return self.cycle is not None and not self.cycle.response_complete

    def _wait(self) -> None:
        self._ends = self.loop.call_later(REQUEST_S, self.transport.abort)

    def _wait_no_more(self) -> None:
        if self._ends is not None:
            self._ends.cancel()
            self._ends = None
