"""One program at one piece of work, in a process and an environment of its own: `python child.py PROGRAM.py FUNCTION DATA.npz`.

It needs nothing but numpy and the program. A line on its standard input is one run; it answers with a line of JSON: CPU seconds, the
megabytes at the peak above what there was with the data loaded, and the poles that were found, of which the clock knows nothing.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
import time
from pathlib import Path

import numpy as np


def loaded(path: str):
    """Return a module from its file."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def begin() -> float:
    """Forget the largest resident size so far where the system can, and return what there is in megabytes."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return peak()
    return _told("VmRSS")


def peak() -> float:
    """Return the largest resident size since `begin` in megabytes, or since the process began; 0 where the system tells neither."""
    if Path("/proc/self/status").exists():
        return _told("VmHWM")
    try:
        import resource
    except ImportError:
        return 0.0
    unit = 1e6 if sys.platform == "darwin" else 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def _told(name: str) -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name)) / 1e3


def poles_of(found: np.ndarray) -> np.ndarray:
    """Return what was found, or the eigenvalues of the matrix that was found."""
    return np.linalg.eigvals(found) if found.ndim == 2 else found


def main() -> None:
    """Answer every line with a run."""
    answers = os.fdopen(os.dup(1), "w")  # what programs print goes elsewhere
    os.dup2(2, 1)
    program, function, data = sys.argv[1:]
    work = getattr(loaded(program), function)
    with np.load(data) as file:
        arrays = {name: file[name] for name in file.files}
    before = begin()
    print(json.dumps({"ready": True}), file=answers, flush=True)
    for _ in sys.stdin:
        start = time.process_time()
        found = work(arrays)
        seconds = time.process_time() - start
        poles = np.atleast_1d(poles_of(np.asarray(found))).astype(complex)
        answer = {"seconds": seconds, "peak": peak() - before, "poles": [[z.real, z.imag] for z in poles]}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
