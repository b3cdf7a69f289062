"""Damage to a file: flipped bits, cuts, other digits, other lengths, blocks that change places, what was put in between."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Mutation = Callable[[bytearray, np.random.Generator], None]

_INTERESTING = (
    0,
    1,
    2,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0x8000,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    2**63 - 1,
    2**64 - 1,
)
_WORDS = (
    b"nan", b"inf", b"-1", b"1e400", b"9999999999", b"\0", b"\n", b'"', b"'", b"[", b"{", b"]}", b",", b"/", b"null", b"true",
    b'"x"', b"\xff\xfe", b"    -1\n", b"    -1\n    58\n", b" ", b"\t", b"#", b":", b"_", b"\xe2\x80\xae",
)  # fmt: skip


def bits(data: bytearray, rng: np.random.Generator) -> None:
    """Flip one bit, or a few."""
    for _ in range(int(rng.choice([1, 1, 1, 2, 8]))):
        data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))


def cut(data: bytearray, rng: np.random.Generator) -> None:
    """Cut the end off."""
    del data[int(rng.integers(len(data))) :]


def hole(data: bytearray, rng: np.random.Generator) -> None:
    """Take a piece out."""
    start = int(rng.integers(len(data)))
    del data[start : start + int(rng.integers(1, 64))]


def digits(data: bytearray, rng: np.random.Generator) -> None:
    """Change a digit, a sign, a point, an exponent, or a letter; a byte where there is none."""
    places = [k for k in rng.integers(len(data), size=200) if 0x2B <= data[k] < 0x7F]
    for place in places[:1]:
        data[int(place)] = int(rng.choice(list(b"0123456789.-+eE xZ")))
    if not places:
        data[int(rng.integers(len(data)))] = int(rng.integers(256))


def lengths(data: bytearray, rng: np.random.Generator) -> None:
    """Write an interesting whole number of 1 to 8 bytes over what is there; most often near the beginning or the end."""
    size = min(int(rng.choice([1, 2, 4, 8])), len(data))
    reach = int(rng.choice([128, 1024, len(data)]))
    start = min(int(rng.integers(min(reach, len(data)))), len(data) - size)
    start = len(data) - size - start if rng.integers(4) == 0 else start
    value = int(_INTERESTING[int(rng.integers(len(_INTERESTING)))]) % 256**size
    data[start : start + size] = value.to_bytes(size, "little" if rng.integers(2) else "big")


def swap(data: bytearray, rng: np.random.Generator) -> None:
    """Let two blocks change places."""
    size = int(rng.integers(1, max(2, min(64, len(data) // 2))))
    a, b = (int(k) for k in rng.integers(max(1, len(data) - size), size=2))
    data[a : a + size], data[b : b + size] = data[b : b + size], data[a : a + size]


def twice(data: bytearray, rng: np.random.Generator) -> None:
    """Repeat a block."""
    start = int(rng.integers(len(data)))
    block = data[start : start + int(rng.integers(1, 256))]
    data[start:start] = block


def insert(data: bytearray, rng: np.random.Generator) -> None:
    """Put a word or some bytes in."""
    word = _WORDS[int(rng.integers(len(_WORDS)))] if rng.integers(4) else rng.bytes(int(rng.integers(1, 16)))
    place = int(rng.integers(len(data) + 1))
    data[place:place] = word


KINDS: tuple[Mutation, ...] = (bits, cut, hole, digits, lengths, swap, twice, insert)


def mutated(data: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """Return the kind of the damage and the damaged file; never the file itself, never an empty one."""
    while True:
        changed, kind = bytearray(data), KINDS[int(rng.integers(len(KINDS)))]
        kind(changed, rng)
        if changed and changed != data:
            return kind.__name__, bytes(changed)
