"""One program on one set, in a process and an environment of its own: `python child.py CONTESTANT.py VARIANT TEST.npz RESULT.json`.

It needs nothing but numpy and the program. What the program finds is written as JSON, with CPU seconds, megabytes at the peak above the
data, and how many numbers it was told that a person had to find.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import importlib.util
import json
import os
import re
import sys
import time
import warnings
from pathlib import Path

import numpy as np

#: CPU seconds and bytes that a program may take.
SECONDS, MEMORY = 300, 6 << 30

#: Arrays of a history of modes, beside its frequencies.
MONTHS = ("record", "damping_ratios", "shapes", "seconds")


class CannotError(Exception):
    """The program is not made for such a test."""


class Test:
    """What a program is given: `kind`, `band` in Hz or None, and the arrays of its kind.

    "records" (with forces) and "ambient", "decay": `outputs` (samples, l), `inputs` (samples, m), `sampling_rate`. Several runs stand one
    before the other in a first axis. "setups": `setups`, a list of such outputs, and `labels`, the names of their channels. "impulses":
    `values` (samples, l, m), `sampling_rate`. "responses": `values` (lines, l, m), `frequencies`, `quantity`. "months":
    modes of many records one below the other, `record` of each (from 0), `frequencies`, `damping_ratios`, `shapes` (n, l), and `seconds`
    at which the records began.
    """

    def __init__(self, path: str) -> None:
        with np.load(path) as held:
            arrays = {name: held[name] for name in held.files}
        about = json.loads(str(arrays.pop("about")))
        self.kind, self.band, self.quantity, self._answers = (about[x] for x in ("kind", "band", "quantity", "answers"))
        self.labels = about["labels"]
        self.setups = [arrays.pop(name) for name in sorted(arrays) if name.startswith("setup")]
        for name in ("outputs", "inputs", "values", "frequencies", "sampling_rate", *MONTHS):
            value = arrays.get(name)
            setattr(self, name, float(value) if name == "sampling_rate" and value is not None else value)
        self.told = 0

    def human(self, what: str):
        """Return what a person finds out for the program, and count the numbers.

        "frequencies": those of all known modes, to three digits, as read from a chart; "lowest frequency"; "modes": how many there are;
        "decimation", a factor of the rate, and "start", the second at which a decay begins, are not counted where nothing is to be done.
        """
        value = self._answers[what]
        if value is None:
            raise CannotError(f"a person would have to find {what}, and nobody knows it here")
        idle = {"decimation": 1, "start": 0}
        self.told += len(value) if isinstance(value, list) else int(value != idle.get(what))
        return value

    def slower(self, outputs):
        """Return outputs from where a decay begins on, at the rate that a person lowers theirs to, and that rate."""
        from scipy.signal import decimate

        later, q = outputs[round(self.human("start") * self.sampling_rate) :], self.human("decimation")
        return (later if q == 1 else decimate(later, q, axis=0, ftype="fir")), self.sampling_rate / q


def modes_of(A, C, rate):
    """Return what a contestant returns of the modes of a discrete state space model."""
    z, vectors = np.linalg.eig(A)
    kept = z.imag > 0
    s = np.log(z[kept]) * rate
    return {"frequencies": abs(s) / 2 / np.pi, "damping_ratios": -s.real / abs(s), "shapes": (C @ vectors)[:, kept]}


def loaded(path: str):
    """Return a module from its file."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def limited() -> None:
    """Let the system end a program that takes too much, where it can."""
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def peak() -> float:
    """Return the largest resident size so far in megabytes, 0 where the system tells none."""
    status = Path("/proc/self/status")
    told = re.search(r"VmHWM:\s*(\d+)", status.read_text()) if status.exists() else None
    return int(told[1]) / 1e3 if told else 0.0


def columns(found: dict) -> dict:
    """Return the arrays of a result as lists: shapes as real and imaginary parts, what is not finite as null."""
    f = np.atleast_1d(np.asarray(found["frequencies"], float))
    kept = np.isfinite(f) & (f > 0)
    told = {"labels": list(found["labels"])} if "labels" in found else {}
    for name in ("frequencies", "damping_ratios", "frequency_interval", "damping_interval", "marked"):
        if found.get(name) is not None:
            array = np.atleast_1d(np.asarray(found[name]))[kept]
            told[name] = np.where(np.isfinite(array), array, None).tolist()
    if found.get("shapes") is not None:
        shapes = np.asarray(found["shapes"]).T[kept]
        told |= {"shapes_real": shapes.real.astype(float).tolist(), "shapes_imag": shapes.imag.astype(float).tolist()}
    return told


def main() -> None:
    """Work once."""
    program, variant, data, result = sys.argv[1:]
    limited()
    test, start = Test(data), peak()
    answer: dict = {"status": "done"}
    np.random.seed(0)  # noqa: NPY002 - clusterings that draw from the global generator repeat themselves
    with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            module = loaded(program)
            names = [re.split(r"[=<>!~ \[]", each)[0] for each in module.REQUIRES]
            answer["versions"] = [f"{name} {importlib.metadata.version(name)}" for name in names]
            began = time.process_time()
            found = module.run(test, variant)
            answer |= {"cpu": time.process_time() - began, "memory": peak() - start, **columns(found)}
        except CannotError as error:
            answer = {"status": "cannot", "text": str(error)}
        except MemoryError:
            answer = {"status": "limit", "text": f"more than {MEMORY >> 30} GB"}
        except Exception as error:  # noqa: BLE001 - a program that fails is a result
            said = re.sub(r"0x[0-9a-f]+", "0x", f"{type(error).__name__}: {error}".splitlines()[0])
            answer = {"status": "failed", "text": said[:200]}
    answer["human"] = test.told
    Path(result).write_text(json.dumps(answer))


if __name__ == "__main__":
    sys.modules["child"] = sys.modules["__main__"]  # a contestant says `from child import CannotError`
    main()
