"""Files whose headers contradict themselves, built field by field, and read: each is answered or refused, and none of it in silence.

A whole file of each format is written; then one field of its header, or two, get another value: a count, a size, a rate, a kind, a shape.
"""

from __future__ import annotations

import io
import re
import struct
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

import modalscope as ms
from modalscope.data import DataError
from tests.io.apart import hidden, read
from tests.test_every_argument import within

#: What a field of a text may become.
WORDS = (
    *("0", "-1", "1", "2", "3", "7", "61", "59", "1000000000", "99999999999999999999"),
    *("nan", "inf", "-inf", "1e308", "1e-308", "x", "", "٣"),
)

#: What an array may become.
ARRAYS: dict[str, Callable[[np.ndarray], Any]] = {
    "none": lambda a: np.atleast_1d(a)[:0],
    "shorter": lambda a: np.atleast_1d(a)[:-1],
    "twice": lambda a: np.concatenate([np.atleast_1d(a)] * 2),
    "turned": lambda a: np.atleast_2d(a).T,
    "deeper": lambda a: np.asarray(a)[None, None],
    "whole numbers": lambda a: np.zeros(np.shape(a), int),
    "texts": lambda a: np.full(np.shape(a), "text"),
    "complex": lambda a: np.full(np.shape(a), 1j),
    "nan": lambda a: np.full(np.shape(a), np.nan),
    "huge": lambda a: np.full(np.shape(a), 1e308),
    "bool": lambda a: np.ones(np.shape(a), bool),
    "backwards": lambda a: np.atleast_1d(a)[::-1],
    "a number": lambda a: np.float64(3.5),
    "minus": lambda a: np.full(np.shape(a), -1.0),
}

RECORD = ms.systems.chain5().simulate(samples=60, sampling_rate=100.0, noise=0.01, seed=0)
RESPONSE = ms.systems.chain5().frequency_response(np.linspace(0.2, 8, 60), quantity="acceleration")


def _whole(suffix: str, what: Any) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"a{suffix}")
        ms.write(path, what)
        return path.read_bytes()


def text_file(suffix: str, what: Any, head: int) -> Callable[[np.random.Generator], tuple[str, bytes]]:
    """Return a builder that changes one or two words of the lines of a head."""
    whole = _whole(suffix, what).decode("latin-1").splitlines(keepends=True)

    def build(draw: np.random.Generator) -> tuple[str, bytes]:
        lines = list(whole)
        for _ in range(draw.integers(1, 3)):
            k = int(draw.integers(min(head, len(lines))))
            words = list(re.finditer(r"[^\s,;]+", lines[k]))
            if words:
                word, new = words[int(draw.integers(len(words)))], str(draw.choice(WORDS))
                width = max(len(word[0]), len(new))  # columns of fixed width stay
                lines[k] = lines[k][: word.start()] + new.rjust(width) + lines[k][word.end() :]
        return suffix, "".join(lines).encode("utf-8", errors="replace")

    return build


def wav(draw: np.random.Generator) -> tuple[str, bytes]:
    """Build the head of a wave file from its fields."""
    data = (1000 * np.random.default_rng(0).standard_normal((60, 2))).astype("<i2").tobytes()
    fields = [
        36 + len(data),
        16,
        1,
        2,
        100,
        400,
        4,
        16,
        len(data),
    ]  # size, length, kind, channels, rate, bytes, block, bits, data
    for _ in range(draw.integers(1, 3)):
        fields[int(draw.integers(9))] = int(draw.choice([0, 1, 2, 3, 5, 17, 24, 32, 64, 1000, 65535]))
    head = struct.pack("<4sI4s4sIHHIIHH4sI", b"RIFF", fields[0], b"WAVE", b"fmt ", *fields[1:8], b"data", fields[8])
    return ".wav", head + data


def npy(draw: np.random.Generator) -> tuple[str, bytes]:
    """Build an array file whose header says another shape, kind or order than its bytes have."""
    shape = tuple(int(n) for n in draw.choice([0, 1, 2, 3, 59, 60, 61, 10**9, -1], draw.integers(0, 4)))
    kind = draw.choice(["<f8", ">f8", "<f4", "<c16", "|b1", "<i8", "|O", "<U9", "|V8", "<M8[s]", "<f3"])
    text = (
        f"{{'descr': '{kind}', 'fortran_order': {draw.choice(['True', 'False', '7'])}, 'shape': {shape}, }}".ljust(117)
        + "\n"
    )
    return ".npy", b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text.encode() + RECORD.outputs.astype(
        "<f8"
    ).tobytes()


def arrays(suffix: str, what: Any) -> Callable[[np.random.Generator], tuple[str, bytes]]:
    """Return a builder that changes one or two of the named arrays of a file."""
    with np.load(io.BytesIO(_whole(".npz", what))) as whole:
        held = {name: whole[name] for name in whole.files}

    def build(draw: np.random.Generator) -> tuple[str, bytes]:
        found: dict[str, Any] = dict(held)
        for _ in range(draw.integers(1, 3)):
            name = str(draw.choice(list(held)))
            if draw.random() < 0.1:
                found.pop(name, None)
            else:
                found[name] = ARRAYS[str(draw.choice(list(ARRAYS)))](np.asarray(held[name]))
        into = io.BytesIO()
        if suffix == ".npz":
            np.savez(into, **found)
        elif suffix == ".mat":
            scipy.io.savemat(into, {name[:31]: np.array(x, order="C") for name, x in found.items()})
        else:
            import h5py  # an extra

            with h5py.File(into, "w") as file:
                for name, x in found.items():
                    file[name] = x.astype("S") if np.asarray(x).dtype.kind == "U" else x
        return suffix, into.getvalue()

    return build


def builders() -> list[Callable[[np.random.Generator], tuple[str, bytes]]]:
    """Return the builders of all formats."""
    made = [wav, npy]
    for what in (RECORD, RESPONSE):
        made += [text_file(".uff", what, 45), text_file(".csv", what, 12)]
        made += [arrays(suffix, what) for suffix in (".npz", ".mat", ".h5")]
    return [*made, text_file(".json", ms.systems.chain5().modes(), 60)]


def files(count: int, seed: int) -> list[str]:
    """Build and read so many files; return what ended in other ways than by an answer or in words of what is wrong with the file."""
    told, tally, made = [], Counter[str](), builders()
    with tempfile.TemporaryDirectory() as folder:
        for k in range(count):
            draw = np.random.default_rng([seed, k])
            suffix, content = made[k % len(made)](draw)
            path = Path(folder, f"{k}{suffix}")
            path.write_bytes(content)
            try:
                with within(10), warnings.catch_warnings():
                    warnings.simplefilter("error")
                    read(path)
                how = "read"
            except DataError as error:
                how = "refused" if hidden(error) is None else f"hidden {hidden(error)!r}"
            except BaseException as error:  # noqa: BLE001 - what else there is, is the question
                how = f"{type(error).__name__}: {str(error)[:200]}"
            tally[how if how in ("read", "refused") else "other"] += 1
            if how not in ("read", "refused"):
                told.append(f"built file {k}{suffix}, seed {seed}: {how}")
            path.unlink()
    print(f"{count} built files, seed {seed}: {dict(tally)}")
    return told
