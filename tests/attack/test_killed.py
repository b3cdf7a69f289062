"""A program that is killed while it writes leaves the old file whole or the new one whole, in every format."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.analysis import Analysis

#: Suffixes of data, and of results.
FORMATS = (".npz", ".uff", ".csv", ".mat", ".h5", ".json", ".analysis.json", ".html")

KILLS = 20

#: Writes two contents in turn until it is killed; a line says that both were written once.
WRITER = """
import sys
from pathlib import Path
import modalscope as ms
from tests.attack.test_killed import put
path = Path(sys.argv[1])
put(path, 0); put(path, 1)
print("ready", flush=True)
k = 0
while True:
    put(path, k % 2); k += 1
"""


def put(path: Path, which: int) -> None:
    """Write one of two contents."""
    chain = ms.systems.chain5()
    if path.name.endswith(".analysis.json"):
        ms.write(path, Analysis(names={str(k): "x" * 50 for k in range(2000)}, remarks=str(which)))
    elif path.suffix in (".json", ".html"):
        modes = chain.modes().take(np.arange(5 - which))
        if path.suffix == ".json":
            ms.write(path, modes)
        else:
            ms.report(ms.stabilize(chain.impulse_response(60, noise=0.01, seed=which), orders=(2, 4)), path)
    else:
        ms.write(path, chain.frequency_response(np.linspace(0.2, 8, 400 + which), quantity="acceleration"))


def whole(path: Path) -> bool:
    """Whether a file is one of the two contents, whole."""
    if path.suffix == ".html":
        return path.read_text(encoding="utf-8").rstrip().endswith("</html>")
    found = ms.read(path) if not path.name.endswith(".analysis.json") else None
    if found is None:
        from modalscope.io.analysis import read_analysis

        return len(read_analysis(path).names) == 2000
    return len(found) in (4, 5) if isinstance(found, ms.ModalModel) else found.lines in (400, 401)


@pytest.mark.study("robustness")
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_writer_that_is_killed_leaves_a_whole_file(suffix: str, tmp_path: Path) -> None:
    draw = np.random.default_rng(len(suffix))
    path = tmp_path / f"file{suffix}"
    for _ in range(KILLS):
        command = [sys.executable, "-c", WRITER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            assert writer.stdout.readline() == "ready\n"
            time.sleep(float(draw.uniform(0.01, 0.3)))
            writer.kill()
        assert whole(path)
