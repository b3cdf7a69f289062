"""Nothing calls home: no command opens a connection, nor asks for the address of another machine."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms

#: The command line; a connection or a question for an address ends it in a line.
WATCHED = """
import sys
def watch(event, given):
    if event in ("socket.connect", "socket.sendto", "socket.getaddrinfo", "socket.gethostbyname", "urllib.Request"):
        raise SystemExit(f"called: {event} {given[1:]}")
sys.addaudithook(watch)
if "--control" in sys.argv:
    import socket
    socket.create_connection(("127.0.0.1", 9))
from modalscope.cli import main
sys.exit(main())
"""


def watched(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", WATCHED, *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_no_command_opens_a_connection(tmp_path: Path) -> None:
    lines = ms.systems.chain5().frequency_response(
        np.linspace(0.2, 8, 120), quantity="acceleration", noise=0.02, seed=1
    )
    ms.write(tmp_path / "a.npz", lines)
    for words in (
        ["info", "a.npz"],
        ["identify", "a.npz", "-o", "a.json", "-o", "a.html", "--orders", "8:12:2"],
        ["compare", "a.npz", "--methods", "era", "polyreference", "--orders", "8:12:2"],
        ["report", "a.json", "-o", "b.html"],
        ["methods"],
    ):
        done = watched(tmp_path, *words)
        assert done.returncode == 0, done.stderr
        assert "called" not in done.stderr


def test_the_watch_notices_a_connection(tmp_path: Path) -> None:
    assert "called: socket." in watched(tmp_path, "--control").stderr
