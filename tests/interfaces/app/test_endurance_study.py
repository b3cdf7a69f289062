"""Fifty windows and two gigabytes: the limits of the page as they are, not lowered."""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from modalscope.interfaces.app.guard import Limits
from tests.interfaces.app.server import Served, served, test_files, until
from tests.studies import Study

WINDOWS = 50

#: What a server may need for a file that it passes on piece by piece, bytes: a part of a percent of it.
LITTLE = 50_000_000

pytestmark = pytest.mark.study("resources")


@pytest.fixture(scope="module")
def wide(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = test_files(tmp_path_factory.mktemp("wide"))
    with served(folder, tmp_path_factory.mktemp("place"), Limits()) as made:
        yield made


@contextmanager
def looking(server: Served, key: str) -> Iterator[Any]:
    """Give the lines that a window on a document is told."""
    parts = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(parts.hostname), parts.port, timeout=60)
    headers = {"Origin": server.base, "Cookie": server.cookie}
    connection.request("GET", f"/api/documents/{key}/events", headers=headers)
    answer = connection.getresponse()
    assert answer.status == 200
    try:
        yield answer
    finally:
        connection.close()


def told(answer: Any, edition: int) -> Any:
    """Return the document of an edition as soon as a window is told of it."""
    while line := answer.readline():
        message = json.loads(line[6:]) if line.startswith(b"data: ") else {}
        if message.get("type") == "document" and message["edition"] >= edition:
            return message["document"]
    raise AssertionError("the window was told nothing more")


def test_fifty_windows_are_told_of_every_change(wide: Served, study: Callable[[str, str], Study]) -> None:
    key = wide.open("plain.analysis.json")
    wide.settled(key)
    table, seconds = study(f"page, {WINDOWS} windows on one document", "5 changes"), []
    with ExitStack() as open_windows:
        windows = [open_windows.enter_context(looking(wide, key)) for _ in range(WINDOWS)]
        until(lambda: len(wide.store.find(key).windows) == WINDOWS)
        for number in range(5):
            begun = time.monotonic()
            state = wide.act(key, "name", frequency=1.0, name=f"name {number}")
            assert all(told(window, state["edition"]) == state["document"] for window in windows)
            seconds.append(time.monotonic() - begun)
        wide.settled(key)
    table.row("until all windows have a change, s", seconds, most=5, form=".2g")
    assert not table.missed
    until(lambda: len(wide.store.find(key).windows) == 0)
    assert wide.settled(key)["document"]["names"]


def test_fifty_documents_are_open_at_once_and_each_is_computed(wide: Served) -> None:
    keys = [wide.open("plain.analysis.json") for _ in range(WINDOWS)]
    assert len(set(keys)) == WINDOWS
    for key in keys:
        assert wide.settled(key, 300)["stage"]["stage"] == "done", key
        assert len(wide.store.pool._owners) <= Limits().workers
    first = wide.modes(keys[0])["modes"]
    for key in keys[-3:]:
        assert [mode["frequency"] for mode in wide.modes(key)["modes"]] == [mode["frequency"] for mode in first]


def resident() -> int:
    """Return the bytes of this process, which the server is a thread of."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def sent(server: Served, name: str, path: Path, size: int) -> tuple[int, Any]:
    """Upload so many bytes of a file piece by piece, and more than it has as zeros."""
    parts = urlsplit(server.address)
    connection = http.client.HTTPConnection(str(parts.hostname), parts.port, timeout=600)
    headers = {"Origin": server.base, "Cookie": server.cookie, "Transfer-Encoding": "chunked"}

    def pieces() -> Iterator[bytes]:
        left = size
        with path.open("rb") as file:
            while left > 0:
                piece = file.read(min(1 << 20, left)) or bytes(min(1 << 20, left))
                left -= len(piece)
                yield piece

    try:
        connection.request("POST", f"/api/upload?name={name}", pieces(), headers, encode_chunked=True)
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read())
    finally:
        connection.close()


@pytest.mark.skipif(
    not Path("/proc/self/statm").is_file(), reason="the system does not tell the memory of a process so"
)
def test_two_gigabytes_are_taken_and_one_byte_more_is_not(
    wide: Served, tmp_path: Path, study: Callable[[str, str], Study]
) -> None:
    limit = Limits().upload
    record = tmp_path / "record.npy"
    head = np.lib.format.open_memmap(record, mode="w+", dtype="<f4", shape=((limit - 128) // 8, 2))
    del head
    assert record.stat().st_size == limit
    before = resident()
    status, answer = sent(wide, "record.npy", record, limit)
    assert status == 200, answer
    table = study("page, upload of the largest file allowed", f"1 file of {limit / 1e9:.2f} GB")
    table.row("memory of the server, MB", (resident() - before) / 1e6, most=LITTLE / 1e6, form=".0f")
    assert not table.missed
    uploads = Path(wide.store.files.place)
    kept = sum(path.stat().st_size for path in uploads.rglob("record.npy"))
    assert kept == limit

    try:
        status, refused = sent(wide, "more.npy", record, limit + 1)
        assert (status, "more than" in refused["found"]) == (400, True)
    except (BrokenPipeError, ConnectionResetError):
        pass  # it hung up before all of it was sent
    assert not [*uploads.rglob("more.npy")]

    # what cannot be computed in time is stopped when that is asked, and the server answers all the while
    key = wide.open(answer["file"])
    until(lambda: wide.state(key)["stage"]["stage"] not in ("idle", "waiting"))
    begun = time.monotonic()
    wide.ask("GET", "/api/start")
    assert time.monotonic() - begun < 2
    wide.request("POST", f"/api/documents/{key}/cancel", {})
    assert wide.settled(key, 10)["stage"]["stage"] in ("stopped", "failed")
    assert wide.state(key)["document"]["files"]
