"""Admit requests to the page: cookie, host name, origin, and limits of size."""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qs


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of one server.

    `upload`: bytes of an uploaded file. `uploads`, `files`: bytes and number of all uploads. `days`: how long uploads are kept after the
    last change of their document. `body`: bytes of any other request. `documents`: open documents. `workers`: processes; the one idle
    longest is ended for another. `spare`: whether a started process waits for the next document. `history`: steps that can be undone.
    `kept`: bytes of finished stages that a document caches. `patience`: seconds from a cancellation to the end of the process. `seconds`:
    the longest job. `listeners`: windows of one document.
    """

    upload: int = 2 << 30
    uploads: int = 10_000_000_000
    files: int = 1000
    days: float = 30.0
    body: int = 1 << 20
    documents: int = 100
    workers: int = 8
    spare: bool = True
    history: int = 500
    kept: int = 256 << 20
    patience: float = 0.3
    seconds: float = 3600.0
    listeners: int = 64


Scope = dict[str, Any]
Receive = Callable[[], Awaitable[Any]]
Send = Callable[[Any], Awaitable[None]]
App = Callable[[Any, Any, Any], Awaitable[None]]

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

#: Headers of every response: no foreign resource, no type sniffing, no caching, no referrer.
HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "cache-control": "no-store",
}


class Guard:
    """Reject every request that does not come from the page of the user who started the server.

    The printed address contains a token; it is exchanged for a cookie that the browser sends to this server only (SameSite). Host must
    be a name of the server, against DNS rebinding. A request that changes something must state the page as its Origin.

    `names`: accepted values of Host, in lower case. `cookie`: name of the cookie.
    """

    def __init__(self, app: App, token: str, names: Iterable[str], cookie: str) -> None:
        self._app, self._token, self._cookie = app, token, cookie
        self._names = frozenset(names)
        self._secret = secrets.token_urlsafe(32)
        self._once = ""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        reason = self._reason_to_reject(scope, headers)
        if reason:
            await _reject(send, 403, reason)
            return
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        shown = query.get("token", [""])[0]
        enters = scope["path"] == "/" and self._admits(shown)
        if not enters and not self._known(headers.get("cookie", "")):
            await _reject(send, 401, "Open the address printed by `modalscope app`: it contains the token.")
            return
        await self._app(scope, receive, self._sending(send, enters))

    def once(self) -> str:
        """Return a token that admits once: other users of the machine see the address that a browser is started with."""
        self._once = secrets.token_urlsafe(24)
        return self._once

    def _admits(self, shown: str) -> bool:
        if self._once and secrets.compare_digest(shown.encode(), self._once.encode()):
            self._once = ""
            return True
        return secrets.compare_digest(shown.encode(), self._token.encode())

    def _reason_to_reject(self, scope: Scope, headers: dict[str, str]) -> str:
        """Return the reason to reject a request, or an empty text."""
        if headers.get("host", "").lower() not in self._names:
            return "The host name is not that of this server."
        origin = headers.get("origin")
        if origin is not None and origin.lower() not in {f"http://{name}" for name in self._names}:
            return "The request comes from another page."
        if scope["method"] not in ("GET", "HEAD") and origin is None:
            return "The request does not state its origin."
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none") and scope["path"] != "/":
            return "The request comes from another page."
        return ""

    def _known(self, cookies: str) -> bool:
        """Whether the cookie is among those of a request; others may be written as their programs like."""
        pairs = (part.partition("=") for part in cookies.split(";"))
        values = [value.strip() for name, _, value in pairs if name.strip() == self._cookie]
        return any(secrets.compare_digest(value.encode(), self._secret.encode()) for value in values)

    def _sending(self, send: Send, enters: bool) -> Send:
        """Return a send that adds the headers, and the cookie if the request showed the token."""

        async def sending(message: Any) -> None:
            if message["type"] == "http.response.start":
                present = {name.lower() for name, _ in message["headers"]}
                ours = [(n.encode(), v.encode()) for n, v in HEADERS.items() if n.encode() not in present]
                if enters:
                    cookie = f"{self._cookie}={self._secret}; HttpOnly; SameSite=Strict; Path=/"
                    ours.append((b"set-cookie", cookie.encode()))
                message = {**message, "headers": [*message["headers"], *ours]}
            await send(message)

        return sending


async def _reject(send: Send, status: int, reason: str) -> None:
    body = f"{reason}\n".encode()
    headers = {**HEADERS, "content-type": "text/plain; charset=utf-8", "content-length": str(len(body))}
    listed = [(name.encode(), value.encode()) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": status, "headers": listed})
    await send({"type": "http.response.body", "body": body})
