"""A server of the page for tests: in a thread of its own, with a client that speaks as the page does."""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.sources import source_of_file
from modalscope.data.analysis import Analysis
from modalscope.interfaces.app.guard import Limits
from modalscope.io.analysis import write_analysis

__all__ = ["HOSTILE", "Served", "built", "served", "test_files", "until"]

#: A label that would run something where it were taken for more than text.
HOSTILE = "<img src=x onerror=\"document.title='run'\"><script>document.title='run'</script>"

#: Of one upload, bytes.
SMALL = 10_000_000

STATIC = Path(ms.__file__).parent / "interfaces" / "app" / "static"


def built() -> bool:
    return (STATIC / "page.js").is_file()


def test_files(folder: Path) -> Path:
    """Write what the tests open: five masses on a line with their geometry, the same with hostile labels, and what is no data."""
    chain = ms.systems.chain5()
    lines = chain.frequency_response(np.linspace(0.2, 8, 300), quantity="acceleration", noise=0.03, seed=1)
    nodes = [label.split(":")[0] for label in lines.output_dofs]
    geometry = ms.Geometry(
        nodes=nodes,
        coordinates=[[k, 0.0, 0.0] for k in range(len(nodes))],
        lines=list(pairwise(nodes)),
        motions={label: [(node, (0.0, 0.0, 1.0))] for label, node in zip(lines.output_dofs, nodes, strict=True)},
    )
    ms.write(folder / "chain.uff", replace(lines, geometry=geometry))
    ms.write(folder / "plain.npz", lines)
    ms.write(folder / "hostile.npz", replace(lines, output_dofs=(HOSTILE, *lines.output_dofs[1:])))
    for name in ("plain", "hostile"):  # orders that a job is done with in a moment
        chosen = Analysis(files=(source_of_file(folder / f"{name}.npz", {}),), orders=tuple(range(2, 21, 2)))
        write_analysis(folder / f"{name}.analysis.json", chosen)
    (folder / "broken.uff").write_bytes((folder / "chain.uff").read_bytes()[:3000])
    (folder / "nothing.csv").write_text("a,b\n")
    return folder


test_files.__test__ = False  # type: ignore[attr-defined]


def until(question: Callable[[], Any], seconds: float = 60.0) -> Any:
    """Return what a question answers as soon as that is true."""
    end = time.monotonic() + seconds
    while not (found := question()):
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.03)
    return found


@dataclass
class Served:
    """A running server, and one who may enter."""

    address: str
    store: Any
    guard: Any = None
    cookie: str = ""
    headers: dict[str, str] = field(default_factory=dict)

    @property
    def base(self) -> str:
        parts = urlsplit(self.address)
        return f"{parts.scheme}://{parts.netloc}"

    def request(self, method: str, path: str, body: Any = None, **headers: str) -> tuple[int, dict[str, str], bytes]:
        """Return status, headers and body of an answer; header names are given with _ for -."""
        parts = urlsplit(self.address)
        assert parts.hostname
        connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=60)
        given = {"Origin": self.base, "Cookie": self.cookie, **{k.replace("_", "-"): v for k, v in headers.items()}}
        data = body if isinstance(body, bytes) else None if body is None else json.dumps(body).encode()
        try:
            connection.request(method, path, data, {k: v for k, v in given.items() if v})
            answer = connection.getresponse()
            return answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read()
        finally:
            connection.close()

    def ask(self, method: str, path: str, body: Any = None, status: int = 200) -> Any:
        """Return the JSON of an answer of the status that is expected."""
        code, _, answer = self.request(method, path, body)
        assert code == status, answer
        return json.loads(answer)

    def open(self, *names: str) -> str:
        """Open files, and return the key of their document."""
        return str(self.ask("POST", "/api/open", {"files": list(names)})["key"])

    def act(self, key: str, action: str, edition: int | None = None, status: int = 200, **given: Any) -> Any:
        body = {"action": action, "given": given, "edition": edition}
        return self.ask("POST", f"/api/documents/{key}/act", body, status)

    def state(self, key: str) -> Any:
        return self.ask("GET", f"/api/documents/{key}")

    def settled(self, key: str, seconds: float = 60.0) -> Any:
        """Return the state when nothing is computed any more."""
        ends = ("done", "failed", "stopped")
        return until(lambda: (s := self.state(key))["stage"]["stage"] in ends and s, seconds)

    def modes(self, key: str) -> Any:
        """Return the head of the modes' blob."""
        code, _, blob = self.request("GET", f"/api/documents/{key}/blob/modes")
        assert code == 200
        return json.loads(blob[4 : 4 + int.from_bytes(blob[:4], "little")])


@contextmanager
def served(folder: Path, place: Path, limits: Limits | None = None) -> Iterator[Served]:
    """Run a server while the block runs; without the extra, skip in words."""
    pytest.importorskip("uvicorn", reason="the extra `app` is not installed")
    from modalscope.interfaces.app import serve

    made = serve.page(folder=folder, place=place, limits=limits or Limits(upload=SMALL, spare=False))
    server = serve.server_of(made)
    thread = Thread(target=server.run, args=([made.socket],), daemon=True)
    thread.start()
    until(lambda: server.started)
    found = Served(made.address, made.store, made.app)
    found.cookie = f"{made.app._cookie}={made.app._secret}"
    try:
        yield found
    finally:
        server.should_exit = True
        thread.join(20)
