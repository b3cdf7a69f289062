"""Ordinary files cut, changed and mixed: each is read or refused by a DataError, never by another error, and soon."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from tests.io.ordinary import CASES
from tests.support import refused

TOKENS = (
    b"1e999",
    b"nan",
    b'"',
    b";;;",
    b"\0",
    b"1+2i",
    b"2024-13-45",
    b"24:61:99",
    b"\xff\xfe",
    b"1.234.567",
    b"#",
    b"(" * 300,
)


def damaged(data: bytes, rng: np.random.Generator) -> list[bytes]:
    """Return a file cut short, with bytes changed, with a part of it twice, and with a text in it that belongs elsewhere."""
    found = [data[: int(k)] for k in rng.integers(1, len(data), 4)]
    for _ in range(8):
        changed = bytearray(data)
        for k in rng.integers(0, min(len(data), 600), 4):
            changed[k] = rng.integers(0, 256)
        found.append(bytes(changed))
    first, middle, last = sorted(int(k) for k in rng.integers(0, len(data), 3))
    found.append(data[:first] + data[middle:last] + data[first:])
    for token in rng.choice(len(TOKENS), 4, replace=False):
        place = int(rng.integers(0, len(data)))
        found.append(data[:place] + TOKENS[token] + data[place:])
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_damage_is_answered_in_plain_words(tmp_path: Path, name: str) -> None:
    case = CASES[name]
    path = tmp_path / f"a{case.suffix}"
    case.write(path)
    rng = np.random.default_rng(len(name))
    for k, data in enumerate(damaged(path.read_bytes(), rng)):
        path.write_bytes(data)
        with contextlib.suppress(ms.DataError):
            ms.read(path, **({"sampling_rate": 1024.0} if k % 2 else {}))


#: Each so long that work which grows with the square of its length takes minutes, and work in proportion a second or two.
BOMBS = {
    "one line without end": b"1," * 5_000_000,
    "a quotation mark that nothing closes": b"a,b\n1,2\n2,3\n3,4\n" + b'"' + b"x," * 5_000_000,
    "brackets": b"(" * 1_000_000 + b"\n" + b"1 2\n" * 100,
    "digits and points": (b"1." * 199 + b"\n") * 2000,
    "keys": b"key: 1\n" * 100_000,
}


@pytest.mark.parametrize("name", BOMBS)
def test_what_asks_for_much_is_answered_soon(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(BOMBS[name])
    begun = time.process_time()
    with contextlib.suppress(ms.DataError):
        ms.read(path)
    assert time.process_time() - begun < 20


def test_rows_of_another_length_and_texts_among_numbers_are_named_by_their_line(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    good = [f"{k / 100:.2f},{k % 7},{k % 5}" for k in range(900)]
    path.write_text("Time,Force,AccA\n" + "\n".join([*good[:700], "7.0,1", *good[701:]]))
    refused(r"line 702 has 2: \['7.0', '1'\]", ms.read, path)
    path.write_text("Time,Force,AccA\n" + "\n".join([*good[:700], "7.00,1,OVL", *good[701:]]))
    refused(r"line 702 holds 'OVL' there(.|\n)*ignore=\[3\]", ms.read, path)
    path.write_text(
        "Time,Force,AccA,AccB\n" + "\n".join(f"{line},{'OVL' if k == 700 else 1}" for k, line in enumerate(good))
    )
    assert ms.read(path, ignore=4).output_dofs == ("AccA",)


def test_rows_of_many_samples_are_read_when_they_are_said_to_be_channels(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("".join(",".join(map(str, row)) + "\n" for row in np.arange(60_000).reshape(2, 30_000) % 7))
    refused("29999 cells in line 1(.|\n)*transpose=True", ms.read, path, sampling_rate=100.0)
    assert ms.read(path, sampling_rate=100.0, transpose=True).outputs.shape == (30_000, 2)
