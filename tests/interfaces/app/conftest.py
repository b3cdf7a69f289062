"""A server of the page in a thread, and a browser to look at it: skipped in words where one of them is missing."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.interfaces.app.server import Served, served, test_files


@pytest.fixture(scope="session", autouse=True)
def one_thread() -> None:
    """Processes that compute use one thread each, as in `make test`."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return test_files(tmp_path_factory.mktemp("data"))


@pytest.fixture(scope="session")
def server(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(folder, tmp_path_factory.mktemp("place")) as made:
        yield made


@pytest.fixture(scope="session")
def key(server: Served) -> str:
    """Return a document that is done."""
    key = server.open("plain.analysis.json")
    server.settled(key)
    return key
