"""Serve the report of a store of months of records: made anew when the store has grown."""

from __future__ import annotations

from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from secrets import token_urlsafe
from threading import Lock

from modalscope.data.analysis import VERSION
from modalscope.monitoring.store import Store
from modalscope.reporting.html import page
from modalscope.reporting.months import months_sections


class MonthsServer(ThreadingHTTPServer):
    """The report of a store at one address that nobody can guess.

    `address`: what to open. Raises `DataError`: no store, or one without tracks.
    """

    def __init__(self, store: Path, host: str, port: int) -> None:
        self.store, self.key, self.lock = store, token_urlsafe(16), Lock()
        self.seen, self.text = -1, b""
        self.written()
        super().__init__((host, port), _Handler)
        self.address = f"http://{host}:{self.server_port}/{self.key}"

    def written(self) -> bytes:
        """Return the report, of all records that the store has now."""
        with self.lock, Store(self.store) as store:
            if (count := len(store.records)) != self.seen:
                parts = list(months_sections(store))
                self.text = page(store.path.name, "Months of records", parts, f"modalscope {VERSION}").encode()
                self.seen = count
            return self.text


class _Handler(BaseHTTPRequestHandler):
    server: MonthsServer

    def do_GET(self) -> None:
        """Answer with the report at its address, and with nothing elsewhere."""
        if self.path != f"/{self.server.key}":
            self.send_error(404)
            return
        text = self.server.written()
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing of requests."""
