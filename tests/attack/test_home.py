"""Nothing calls home: no command opens a connection, nor asks for the address of another machine."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from tests.support import ROOT

#: Commands, parted by //; a connection or a question for an address ends them in a line.
WATCHED = """
import sys
def watch(event, given):
    if event in ("socket.connect", "socket.sendto", "socket.getaddrinfo", "socket.gethostbyname", "urllib.Request"):
        raise SystemExit(f"called: {event} {given[1:]}")
sys.addaudithook(watch)
if "--control" in sys.argv:
    import socket
    socket.create_connection(("127.0.0.1", 9))
from modalscope.interfaces.cli import main
for words in " ".join(sys.argv[1:]).split(" // "):
    if main(words.split()):
        raise SystemExit(f"failed: {words}")
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
    done = watched(
        tmp_path,
        "info a.npz",
        "// identify a.npz -o a.json -o a.html --orders 8:12:2",
        "// compare a.npz --methods era polyreference --orders 8:12:2",
        "// report a.json -o b.html",
        "// methods",
    )
    assert done.returncode == 0, done.stderr
    assert "called" not in done.stderr


def test_the_watch_notices_a_connection(tmp_path: Path) -> None:
    assert "called: socket." in watched(tmp_path, "--control").stderr


#: The page opened, and a document computed on it.
SHOWN = """
import sys
from pathlib import Path
from tests.interfaces.app.server import served
with served(Path(sys.argv[1]), Path(sys.argv[1], "place")) as server:
    print(server.settled(server.open("a.npz"))["stage"]["stage"])
"""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("unshare"), reason="there are no namespaces")
def test_all_works_where_there_is_no_network(tmp_path: Path) -> None:
    """In a namespace that has no network but the machine itself, which the page is served on."""
    alone = ["unshare", "-rn", "sh", "-c", 'ip link set lo up; exec "$@"', "sh"]
    if subprocess.run([*alone, "true"], capture_output=True, check=False).returncode:
        pytest.skip("the system allows no namespaces")
    ms.write(tmp_path / "a.npz", ms.systems.chain5().impulse_response(200, noise=0.01, seed=0))
    away = [sys.executable, "-c", "import socket; socket.create_connection(('192.0.2.1', 80), 5)"]
    assert "unreachable" in subprocess.run([*alone, *away], capture_output=True, text=True, check=False).stderr
    for words, told in (
        (["-m", "modalscope", "identify", str(tmp_path / "a.npz"), "-o", str(tmp_path / "a.html")], "written:"),
        (["-c", SHOWN, str(tmp_path)], "done"),
    ):
        done = subprocess.run([*alone, sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert told in done.stdout
