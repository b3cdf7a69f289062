"""Answer the requests of the page, one function per address."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from starlette.background import BackgroundTask
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Route

from modalscope.data import DataError
from modalscope.data.analysis import VERSION
from modalscope.identification.method_names import methods
from modalscope.identification.suits import route_of
from modalscope.interfaces.app.document import OpenDocument
from modalscope.interfaces.app.documents import DocumentStore
from modalscope.interfaces.app.files import FORMATS, missing_formats, safe_name, too_large
from modalscope.io.analysis import is_deep
from modalscope.io.arrays import plain
from modalscope.io.geometry import geometry_among

#: Bytes of the name of a file that is exported: the system takes 255 with its suffix.
_MAX_STEM = 200

Handler = Callable[[Request], Awaitable[Response]]

#: Words of what was found, and the status of the answer.
_STATUS = {"another window": 409, "no space left": 507, "quota": 507}

#: Seconds between keep-alive messages of an event stream.
_KEEP_ALIVE_SECONDS = 15.0


async def refused(_: Request, error: Exception) -> Response:
    """Return the parts of an error of the data with status 409, 507 or 400; no text for a window that has gone."""
    if not isinstance(error, DataError):
        return Response(status_code=400)
    parts = {"asked": error.asked, "found": error.found, "change": error.change, "text": error.args[0]}
    return _json(parts, next((status for word, status in _STATUS.items() if word in error.found), 400))


#: What is raised instead of an answer -> what answers it.
REFUSALS: dict[Any, Any] = {DataError: refused, ClientDisconnect: refused}


def _json(content: Any, status: int = 200) -> Response:
    """Return an answer in JSON, whatever numbers and halves of characters are in it."""
    return Response(json.dumps(plain(content)), status, media_type="application/json")


def _store(request: Request) -> DocumentStore:
    store: DocumentStore = request.app.state.store
    return store


def _opened(request: Request) -> OpenDocument:
    return _store(request).find(request.path_params["key"])


async def _body(request: Request) -> dict[str, Any]:
    """Return the JSON object of a request."""
    most, parts, size = _store(request).limits.body, [], 0
    async for chunk in request.stream():
        size += len(chunk)
        if size > most:
            raise too_large("a request", most)
        parts.append(chunk)
    try:
        body = json.loads(b"".join(parts) or b"{}")
    except (ValueError, RecursionError):
        body = None
    if not isinstance(body, dict) or is_deep(body):
        raise DataError("a request was sent", "it is no JSON object", "Use the page.")
    return body


async def start(request: Request) -> Response:
    """Return the files, documents, methods and formats."""
    store = _store(request)
    folder = store.files.folder
    rows = [{"name": m.name, "domain": m.domain, "label": m.label, "route": route_of(m)} for m in methods()]
    found = {
        "version": VERSION,
        "folder": None if folder is None else folder.name,
        "files": await asyncio.to_thread(store.files.listing),
        "documents": store.listed(),
    }
    known = {"methods": rows, "formats": FORMATS, "missing": missing_formats(), "upload": store.limits.upload}
    return _json({**found, **known, "first": request.app.state.first})


async def upload(request: Request) -> Response:
    """Store an uploaded file."""
    store = _store(request)
    name, most = request.query_params.get("name", "file"), store.limits.upload
    length = request.headers.get("content-length", "0")
    if length.isascii() and length.isdigit() and int(length) > most:
        raise too_large(name, most)
    stored = await store.files.store_upload(name, request.stream(), most, store.limits)
    return _json({"file": stored})


async def open_files(request: Request) -> Response:
    """Open files as a document, and start its analysis."""
    store, body = _store(request), await _body(request)
    names = body.get("files")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise DataError("the request to open files needs their names as text", "it has other values", "Use the page.")
    opened = await store.open(names)
    opened.start()
    return _json(opened.state())


async def state(request: Request) -> Response:
    """Return the state of a document; start its analysis if it was not started."""
    opened = _opened(request)
    if opened.stage["stage"] == "idle":
        opened.start()
    return _json({**opened.state(), "cuts": opened.cuts})


async def act(request: Request) -> Response:
    """Apply an action to the document."""
    opened, body = _opened(request), await _body(request)
    given, edition = body.get("given", {}), body.get("edition")
    if not isinstance(given, dict) or not isinstance(body.get("action"), str):
        raise DataError("an action needs a name and arguments", "one of them is missing", "Use the page.")
    if body["action"] == "geometry":
        names = given.get("files", ())
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise DataError("a geometry needs the names of its files", f"they are {names!r}", "Use the page.")
        paths = [_store(request).files.resolve(name) for name in names]
        others, geometry = geometry_among(paths)  # points first, in whatever order they were dropped
        given = {"files": [str(path) for path in (*geometry, *others)]}
    opened.act(body["action"], given, edition if isinstance(edition, int) else None)
    _store(request).keep(opened)
    return _json(opened.state())


async def cancel(request: Request) -> Response:
    """Stop the computation."""
    _opened(request).cancel()
    return _json({})


async def close(request: Request) -> Response:
    """Close and delete a document."""
    _store(request).close(request.path_params["key"])
    return _json({})


async def blob(request: Request) -> Response:
    """Return the latest blob of a name."""
    number, data = _opened(request).blobs.get(request.path_params["name"], (0, None))
    if data is None:
        return Response(status_code=404)
    return _blob(data, **{"x-number": str(number)})


async def channel(request: Request) -> Response:
    """Return one channel, measured and rebuilt; without an output the sum of all."""
    one = "output" in request.query_params
    given = {"output": _number(request, "output"), "column": _number(request, "input")} if one else {}
    return await _asked(request, "channel", **given)


async def measured(request: Request) -> Response:
    """Return the names of the pictures of the data."""
    return await _asked(request, "measured")


async def picture(request: Request) -> Response:
    """Return a described picture as a blob."""
    return await _asked(request, "picture", name=request.path_params["name"])


async def _asked(request: Request, what: str, **given: Any) -> Response:
    """Return the answer of the process of a document: a blob, or JSON."""
    answer = await _opened(request).ask(what, **given)
    return _blob(answer) if isinstance(answer, bytes) else _json(answer)


def _blob(data: bytes, **headers: str) -> Response:
    return Response(data, media_type="application/octet-stream", headers=headers)


def _number(request: Request, name: str) -> int:
    text = request.query_params.get(name, "")
    if not (text.isascii() and text.isdigit()) or len(text) > 9:
        raise DataError(f"{name} needs an index from 0", f"it is {text[:20]!r}", "Use the page.")
    return int(text)


async def compare(request: Request) -> Response:
    """Return the comparison of all methods on the data."""
    return await _asked(request, "compare")


async def against(request: Request) -> Response:
    """Return the MAC of the modes with those of a file."""
    name = (await _body(request)).get("file", "")
    return await _asked(request, "against", path=str(_store(request).files.resolve(str(name))))


async def planned(request: Request) -> Response:
    """Return what to measure next for what is asked of the modes."""
    return await _asked(request, "planned", ask=str((await _body(request)).get("ask", "")))


async def export(request: Request) -> Response:
    """Return the result as a file in one format."""
    opened, suffix = _opened(request), f".{request.path_params['suffix']}"
    if suffix not in FORMATS:
        raise DataError(f"{suffix[:20]}:", f"the formats are {', '.join(FORMATS)}", "Choose one of these.")
    stem = next((safe_name(Path(file.path).stem, _MAX_STEM) for file in opened.document.files), "modes")
    mode = _number(request, "mode") if "mode" in request.query_params else 0
    folder = Path(mkdtemp(prefix="modalscope-"))
    target = folder / f"{stem}{suffix}"
    try:
        path = Path(await opened.ask("export", suffix=suffix, target=str(target), mode=mode))
    except BaseException:
        _cleared(target)
        raise
    return FileResponse(path, filename=path.name, background=BackgroundTask(_cleared, path))


def _cleared(path: Path) -> None:
    """Delete a file and its folder."""
    path.unlink(missing_ok=True)
    path.parent.rmdir()


async def events(request: Request) -> Response:
    """Stream the events of a document."""
    opened = _opened(request)
    window = opened.windows.add(opened.limits.listeners)

    async def stream() -> AsyncIterator[str]:
        try:
            yield f"data: {json.dumps(plain(opened.state()))}\n\n"
            while True:
                try:
                    message = await asyncio.wait_for(window.get(), _KEEP_ALIVE_SECONDS)
                except TimeoutError:
                    yield ": keep-alive\n\n"
                    continue
                yield f"data: {json.dumps(plain(message))}\n\n"
                if message["type"] in ("closed", "ended"):
                    return
        finally:
            opened.windows.remove(window)

    return StreamingResponse(stream(), media_type="text/event-stream")


def routes() -> list[Route]:
    """Return the routes below /api: those of a document are named after what answers them."""
    at = "/api/documents/{key}"
    listed: list[tuple[str, Handler, str]] = [
        ("/api/start", start, "GET"),
        ("/api/upload", upload, "POST"),
        ("/api/open", open_files, "POST"),
        (at, state, "GET"),
        (f"{at}/blob/{{name}}", blob, "GET"),
        (f"{at}/picture/{{name}}", picture, "GET"),
        (f"{at}/export/{{suffix}}", export, "GET"),
    ]
    listed += [(f"{at}/{handler.__name__}", handler, "GET") for handler in (events, channel, measured)]
    posted = (act, cancel, close, compare, against, planned)
    listed += [(f"{at}/{handler.__name__}", handler, "POST") for handler in posted]
    return [Route(path, handler, methods=[method]) for path, handler, method in listed]
