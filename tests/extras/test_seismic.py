"""miniSEED and SAC: records built here by the manuals, Steim packed by hand, and what ObsPy writes where it is installed."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.extras.seismic import steim
from modalscope.io import survey
from tests.support import refused

RNG = np.random.default_rng(3)
SLOW = np.cumsum(RNG.integers(-7, 8, 300))


def packed(values: np.ndarray, order: str = ">") -> bytes:
    """Return samples in Steim 1, each difference in the fewest bytes that hold its word."""
    steps = np.diff(values, prepend=values[0]).tolist()
    words: list[tuple[int, bytes]] = []
    while steps:
        for nibble, count, letter in ((1, 4, "b"), (2, 2, "h"), (3, 1, "i")):
            bound = 1 << (8 * struct.calcsize(letter) - 1)
            part = steps[:count]
            if len(part) == count and all(-bound <= step < bound for step in part):
                words.append((nibble, struct.pack(f"{order}{count}{letter}", *part)))
                steps = steps[count:]
                break
    frames = b""
    while words or not frames:
        room = 13 if not frames else 15
        first = struct.pack(f"{order}ii", int(values[0]), int(values[-1])) if not frames else b""
        own, words = words[:room], words[room:]
        nibbles = sum(nibble << (30 - 2 * (k + 16 - room)) for k, (nibble, _) in enumerate(own))
        frames += (struct.pack(f"{order}I", nibbles) + first + b"".join(word for _, word in own)).ljust(64, b"\0")
    return frames


def record(
    values: np.ndarray, encoding: int = 3, channel: str = "HNZ", at: float = 0.0, factor: int = 100, order: str = ">"
) -> bytes:
    """Return one record of version 2, 4096 bytes."""
    numbers = {1: "h", 3: "i", 4: "f", 5: "d"}
    body = (
        packed(values, order)
        if encoding == 10
        else struct.pack(f"{order}{len(values)}{numbers[encoding]}", *values.tolist())
    )
    seconds, parts = int(at), round(10_000 * (at % 1))
    head = b"000001D " + b"TWR  " + b"00" + channel.encode() + b"XX"
    head += struct.pack(order + "HHBBBBH", 2021, 63, 5, seconds // 60, seconds % 60, 0, parts)
    head += struct.pack(order + "HhhBBBBiHH", len(values), factor, 1, 0, 0, 0, 1, 0, 64, 48)
    head += struct.pack(order + "HHBBBB", 1000, 0, encoding, order == ">", 12, 0)
    return (head.ljust(64, b"\0") + body).ljust(4096, b"\0")


@pytest.mark.parametrize("order", [">", "<"])
@pytest.mark.parametrize("encoding", [1, 3, 4, 5, 10])
def test_every_encoding_gives_the_samples_back(tmp_path: Path, encoding: int, order: str) -> None:
    values = SLOW if encoding < 4 or encoding == 10 else SLOW / 4
    path = tmp_path / "a.mseed"
    path.write_bytes(record(values, encoding, order=order) + record(values[::-1], encoding, at=3.0, order=order))
    found = ms.read(path)
    assert (found.sampling_rate, found.output_dofs) == (100.0, ("TWR.00.HNZ",))
    np.testing.assert_array_equal(found.outputs[:, 0], np.r_[values, values[::-1]])


def test_large_steps_are_packed_in_words_of_their_own() -> None:
    values = np.array([0, 5, -100_000, 70_000, 70_003, 0, 1, 2, 3, 4_000_000, 2, 1, 0, -3, 90])
    np.testing.assert_array_equal(steim(packed(values), 1, len(values)), values)


def test_steim_2_by_the_words_of_the_manual() -> None:
    """One word of each packing: 4 x 8, 1 x 30, 2 x 15, 3 x 10, 5 x 6, 6 x 5, 7 x 4 bits."""
    steps = [[1, -2, 3, -128], [-300_000_000], [-9000, 16383], [-512, 511, 7], [-32, 31, 0, 5, -1]]
    steps += [[-16, 15, 1, 2, 3, 4], [-8, 7, 1, 0, 2, 3, -4]]
    kinds = [(1, None, 8), (2, 1, 30), (2, 2, 15), (2, 3, 10), (3, 0, 6), (3, 1, 5), (3, 2, 4)]
    words, nibbles = [], 0
    for k, (part, (nibble, upper, bits)) in enumerate(zip(steps, kinds, strict=True)):
        word = 0
        for step in part:
            word = word << bits | step & ((1 << bits) - 1)
        words.append(word | ((upper or 0) << 30 if upper is not None else 0))
        nibbles |= nibble << (30 - 2 * (k + 3))
    flat = [step for part in steps for step in part]
    values = np.cumsum([40, *flat[1:]])
    frame = struct.pack(">Iii7I", nibbles, 40, int(values[-1]), *words).ljust(64, b"\0")
    np.testing.assert_array_equal(steim(frame, 2, len(values)), values)
    with pytest.raises(ValueError, match="its header says"):
        steim(frame[:11] + b"\1" + frame[12:], 2, len(values))
    with pytest.raises(ValueError, match="differences"):
        steim(frame, 2, len(values) + 1)


def test_channels_are_put_together_over_the_stretch_that_all_have(tmp_path: Path) -> None:
    path = tmp_path / "a.mseed"
    late = record(SLOW[50:], channel="HNE", at=0.5)
    path.write_bytes(record(SLOW) + late + record(SLOW[:40], at=9.0))  # a gap of 6 s, and a short rest
    data = ms.read(path)
    assert data.output_dofs == ("TWR.00.HNZ", "TWR.00.HNE")
    np.testing.assert_array_equal(data.outputs, np.stack([SLOW[50:], SLOW[50:]], axis=1))
    assert any("1 gap" in note for note in survey(path).notes)


def test_what_cannot_be_one_record_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "a.mseed"
    path.write_bytes(record(SLOW) + record(SLOW, channel="LNZ", factor=1))
    refused("different rates.*TWR.00.HNZ 100 Hz", ms.read, path)
    path.write_bytes(record(SLOW) + record(SLOW, channel="HNE", at=60.0))
    refused("no time in common", ms.read, path)
    path.write_bytes(record(SLOW)[:3000])
    refused("cut off", ms.read, path)
    path.write_bytes(b"nothing of the kind" * 100)
    refused("it holds no samples", ms.read, path)


def sac(values: np.ndarray, step: float = 0.005, quantity: int = 7, kind: int = 1, order: str = "<") -> bytes:
    reals, integers = np.full(70, -12345.0), np.full(40, -12345)
    reals[0] = step
    integers[[6, 9, 15, 16, 35]] = 6, len(values), kind, quantity, 1
    names = b"TWR     " + b"-12345  " * 19 + b"HHZ     " + b"-12345  " * 3
    return (
        reals.astype(order + "f4").tobytes()
        + integers.astype(order + "i4").tobytes()
        + names
        + values.astype(order + "f4").tobytes()
    )


@pytest.mark.parametrize("order", ["<", ">"])
def test_sac_gives_samples_name_rate_and_quantity(tmp_path: Path, order: str) -> None:
    path = tmp_path / "a.sac"
    path.write_bytes(sac(SLOW, order=order))
    found = ms.read(path)
    assert (found.sampling_rate, found.output_dofs, found.quantities) == (200.0, ("TWR.HHZ",), ("velocity",))
    np.testing.assert_array_equal(found.outputs[:, 0], SLOW)
    path.write_bytes(sac(SLOW, kind=2, order=order))
    refused("no even record", ms.read, path)
    path.write_bytes(sac(SLOW, order=order)[:-4])
    refused("counts 300 samples, and 299 follow", ms.read, path)


@pytest.mark.parametrize("encoding", ["STEIM1", "STEIM2", "INT32", "FLOAT64"])
def test_what_obspy_writes(tmp_path: Path, encoding: str) -> None:
    obspy = pytest.importorskip("obspy")
    kind = "f8" if encoding == "FLOAT64" else "i4"
    values = np.cumsum(RNG.integers(-30_000, 30_000, 4000)).astype(kind)
    trace = obspy.Trace(values, {"station": "TWR", "channel": "HNZ", "sampling_rate": 200.0})
    trace.write(str(tmp_path / "a.mseed"), format="MSEED", encoding=encoding, reclen=512)
    np.testing.assert_array_equal(ms.read(tmp_path / "a.mseed").outputs[:, 0], values)


def test_a_channel_that_rises_by_one_is_a_channel(tmp_path: Path) -> None:
    path = tmp_path / "a.mseed"
    path.write_bytes(record(np.arange(100)))
    np.testing.assert_array_equal(ms.read(path).outputs[:, 0], np.arange(100.0))
