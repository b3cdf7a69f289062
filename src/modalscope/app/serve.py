"""Serve the page on this machine, for the user who started it."""

from __future__ import annotations

import os
import secrets
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from modalscope.app.documents import DocumentStore
from modalscope.app.files import Shelf
from modalscope.app.guard import Guard, Limits
from modalscope.app.routes import routes
from modalscope.data import DataError

#: The front end, bundled when the package was built.
STATIC = Path(__file__).parent / "static"


@dataclass(frozen=True, slots=True)
class Page:
    """A server that is ready to run.

    `socket`: bound already: nobody else can take the port. `address`: with the token. `store`: its documents.
    """

    app: Any
    socket: socket.socket
    address: str
    store: DocumentStore


def built() -> None:
    """Raise where the front end is not there.

    Raises `DataError`: A checkout in which nobody has built it.
    """
    if not (STATIC / "index.html").is_file():
        raise DataError(
            "the page was asked",
            "its front end is not built: this is a checkout, not an installed package",
            "Say: make page (it needs Node 20 and npm), or: pip install 'modalscope[app]'.",
        )


def place_of_ours() -> Path:
    """Return where uploads and documents are kept: MODALSCOPE_PAGE, or the system's place for such things."""
    given = os.environ.get("MODALSCOPE_PAGE")
    if given:
        return Path(given)
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

    `first`: files in the folder to open at once. `folder`: the only place that files are read from. `host`, `port`: loopback by default,
    and any port that is free. `place`: where uploads and documents are kept.
    """
    bound = _bound(host, port)
    port = bound.getsockname()[1]
    store = DocumentStore(Shelf(folder, place or place_of_ours()), limits or Limits())

    @asynccontextmanager
    async def life(_: Starlette) -> AsyncIterator[None]:
        store.pool.warm_up()
        yield

    served = [Route("/", _index), *routes(), Mount("/static", StaticFiles(directory=STATIC, check_dir=False))]
    app = Starlette(routes=served, lifespan=life)
    app.state.store, app.state.first = store, first or []
    token = secrets.token_urlsafe(24)
    names = {f"{name}:{port}" for name in (host, *(("127.0.0.1", "localhost") if _is_loopback(host) else ()))}
    guard = Guard(app, token, {name.lower() for name in names}, f"modalscope-{port}")
    return Page(guard, bound, f"http://{host}:{port}/?token={token}", store)


async def _index(_: Request) -> Response:
    return FileResponse(STATIC / "index.html", media_type="text/html")


def _is_loopback(host: str) -> bool:
    return host == "localhost" or host.startswith("127.")


def _bound(host: str, port: int) -> socket.socket:
    made = socket.socket()
    try:
        if os.name == "posix":  # elsewhere it would let two programs share a port
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((host, port))
        made.listen()  # a browser that is faster than the server waits, and is not refused
    except (OSError, OverflowError) as error:
        made.close()
        what = getattr(error, "strerror", None) or str(error)
        raise DataError(
            f"port {port} of {host} was asked", f"the system refuses: {what.lower()}", "Choose another with --port."
        ) from None
    return made


def server_of(made: Page) -> Any:
    """Return what runs a page: `run([made.socket])` serves until `should_exit` is set."""
    import uvicorn

    class Server(uvicorn.Server):
        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            made.store.end()  # the windows let go, and nothing waits for them
            await super().shutdown(sockets)

    settings = uvicorn.Config(made.app, log_level="warning", access_log=False, timeout_graceful_shutdown=2, ws="none")
    return Server(settings)


def serve(made: Page) -> None:
    """Run a server until it is interrupted."""
    server_of(made).run(sockets=[made.socket])
