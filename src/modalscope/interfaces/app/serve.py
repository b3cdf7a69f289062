"""Serve the page on this machine, for the user who started it."""

from __future__ import annotations

import asyncio
import os
import secrets
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from modalscope.data import DataError
from modalscope.interfaces.app.documents import DocumentStore
from modalscope.interfaces.app.files import FileStore
from modalscope.interfaces.app.guard import Guard, Limits
from modalscope.interfaces.app.routes import REFUSALS, routes

#: The front end, bundled when the package was built.
STATIC = Path(__file__).parent / "static"

#: Seconds within which the head of a request has to come, and the next part of its body.
_PATIENCE = 10.0

#: What a report may do: it carries all that it shows, and asks nobody.
_OF_REPORTS = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; frame-ancestors 'none'"


@dataclass(frozen=True, slots=True)
class Page:
    """A server that is ready to run.

    `socket`: bound to the port. `address`: with the token. `store`: its documents; none of a report alone.
    """

    app: Guard
    socket: socket.socket
    address: str
    store: DocumentStore | None = None

    def address_once(self) -> str:
        """Return an address that admits once, for the command line of a browser, which other users can list."""
        return f"{self.address.partition('=')[0]}={self.app.once()}"


def check_front_end() -> None:
    """Raise `DataError` in a checkout without a built front end."""
    if not (STATIC / "index.html").is_file():
        remedy = "Run: make page (needs Node 20 and npm), or: pip install 'modalscope[app]'."
        raise DataError("the page needs its built front end", "there is none here", remedy)


def state_folder() -> Path:
    """Return the folder of uploads and documents: MODALSCOPE_PAGE, or that of the system's application state."""
    if folder := os.environ.get("MODALSCOPE_PAGE"):
        return Path(folder)
    base = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(base) / "modalscope" / "page"


def page(
    first: list[str] | None = None,
    *,
    folder: Path | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    place: Path | None = None,
    limits: Limits | None = None,
) -> Page:
    """Return the server, bound to its port.

    `first`: files in the folder to open at once. `folder`: the only folder that files are read from. `host`, `port`: by default loopback
    and any free port. `place`: folder of uploads and documents.
    """
    bound = _bound(host, port)
    store = DocumentStore(FileStore(folder, place or state_folder()), limits or Limits())
    store.age()

    @asynccontextmanager
    async def life(_: Starlette) -> AsyncIterator[None]:
        store.pool.warm_up()
        yield

    async def index(_: Request) -> Response:
        return FileResponse(STATIC / "index.html", media_type="text/html")

    served = [Route("/", index), *routes(), Mount("/static", StaticFiles(directory=STATIC, check_dir=False))]
    app = Starlette(routes=served, lifespan=life, exception_handlers=REFUSALS)
    app.state.store, app.state.first = store, first or []
    return _guarded(app, bound, host, store)


def alone(answer: Callable[[], str], *, host: str = "127.0.0.1", port: int = 0) -> Page:
    """Return a server of one report, bound to its port, behind the same guard.

    `answer`: what gives its HTML, which carries its own scripts and styles.
    """

    async def index(_: Request) -> Response:
        text = await asyncio.to_thread(answer)
        return Response(text, media_type="text/html", headers={"content-security-policy": _OF_REPORTS})

    return _guarded(Starlette(routes=[Route("/", index)]), _bound(host, port), host)


def _guarded(app: Starlette, bound: socket.socket, host: str, store: DocumentStore | None = None) -> Page:
    """Return a server that admits who has its token."""
    port, token = bound.getsockname()[1], secrets.token_urlsafe(24)
    loopback = host == "localhost" or host.startswith("127.")
    names = {f"{name}:{port}" for name in (host, *(("127.0.0.1", "localhost") if loopback else ()))}
    guard = Guard(app, token, {name.lower() for name in names}, f"modalscope-{port}")
    return Page(guard, bound, f"http://{host}:{port}/?token={token}", store)


def _bound(host: str, port: int) -> socket.socket:
    made = socket.socket()
    try:
        if os.name == "posix":  # on Windows it would let two programs share a port
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((host, port))
        made.listen()  # a browser that connects before the server is up waits
    except (OSError, OverflowError) as error:
        made.close()
        reason = f"the system refuses: {(getattr(error, 'strerror', None) or str(error)).lower()}"
        raise DataError(f"port {port} of {host}:", reason, "Choose another with --port.") from None
    return made


def server_of(made: Page) -> Any:
    """Return the server of a page: `run([made.socket])` serves until `should_exit` is set."""
    import h11
    import uvicorn
    from uvicorn.protocols.http.h11_impl import H11Protocol

    class Prompt(H11Protocol):
        """A connection that ends where a request does not come on."""

        late: asyncio.TimerHandle | None = None

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._wait(h11.IDLE)

        def data_received(self, data: bytes) -> None:
            before = self.conn.their_state
            super().data_received(data)
            if before is not h11.IDLE or self.conn.their_state is not h11.IDLE:  # a head has all of its time together
                self._wait(self.conn.their_state)

        def _wait(self, state: Any) -> None:
            if self.late is not None:
                self.late.cancel()
            waits = state in (h11.IDLE, h11.SEND_BODY)
            self.late = self.loop.call_later(_PATIENCE, self._end) if waits else None

        def _end(self) -> None:
            if self.flow.read_paused:  # it is this side that is slow
                self._wait(self.conn.their_state)
            else:
                self.transport.close()

    class Server(uvicorn.Server):
        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            if made.store is not None:
                made.store.end()  # closes the event streams, which would delay the shutdown
            await super().shutdown(sockets)

    quiet: Any = {"log_level": "warning", "access_log": False}
    return Server(uvicorn.Config(made.app, http=Prompt, timeout_graceful_shutdown=2, ws="none", **quiet))


def serve(made: Page) -> None:
    """Run a server until it is interrupted."""
    server_of(made).run(sockets=[made.socket])
