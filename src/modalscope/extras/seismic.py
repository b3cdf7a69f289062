"""Read records of seismology: miniSEED 2 and 3 (integers, floats, Steim 1 and 2) and SAC.

A miniSEED file is a row of records, each with the name of its channel, its start, rate and samples: channels are put together, and cut to
the stretch that all have without a gap. SAC is a header of 70 reals, 40 integers and 24 names, and the samples of one channel.
Sources: SEED Reference Manual, version 2.4 (FDSN, 2012), chapter 8 and appendix B (Steim); miniSEED 3 (FDSN, 2023); SAC Users Manual,
"SAC data file format".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from modalscope.data.shown import counted
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.contents import Contents, Options, damage_as_error, needs, unreadable
from modalscope.io.limits import Room, room
from modalscope.numerics.checks import RealArray

#: Records begin at multiples of 128 bytes.
_BYTES_OF_HEAD, _BYTES_BETWEEN, _BYTES_OF_FRAME, _BYTES_OF_SAC = 48, 128, 64, 632
_NUMBERS = {1: "i2", 3: "i4", 4: "f4", 5: "f8"}
_STEIM = {10: 1, 11: 2}
#: Nibble, and in Steim 2 the two bits above it -> how many differences of how many bits a word of 32 holds.
_PACKING: dict[int, dict[tuple[int, int | None], tuple[int, int]]] = {
    1: {(1, None): (4, 8), (2, None): (2, 16), (3, None): (1, 32)},
    2: {(1, None): (4, 8), (2, 1): (1, 30), (2, 2): (2, 15), (2, 3): (3, 10), (3, 0): (5, 6), (3, 1): (6, 5), (3, 2): (7, 4)},
}  # fmt: skip
#: Part of a step by which the start of a record may differ from the end of the one before.
_MAX_OFF_STEP = 0.5
#: What `IDEP` of SAC says the samples are.
_QUANTITIES = {6: "displacement", 7: "velocity", 8: "acceleration"}


@dataclass(slots=True)
class _Stretch:
    """Samples of one channel without a gap: the time of the first, and the pieces."""

    start: datetime
    rate: float
    pieces: list[RealArray] = field(default_factory=list)

    @property
    def samples(self) -> int:
        return sum(map(len, self.pieces))

    @property
    def end(self) -> datetime:
        """The time of the next sample."""
        return self.start + timedelta(seconds=self.samples / self.rate)


def read_miniseed(path: Path, options: Options) -> Contents:
    """Read a miniSEED file (options of tables): all channels of one rate, over the longest stretch that all have.

    Raises `DataError`: no such file, another encoding, damage, channels of different rates or without a common stretch.
    """
    space = room(path.name, path.stat().st_size)
    stretches: dict[str, list[_Stretch]] = {}
    with damage_as_error(f"{path.name} as miniSEED", "Copy it again, or export it as text."):
        for name, piece in _records(path.name, path.read_bytes(), space):
            held = stretches.setdefault(name, [])
            last = held[-1] if held else None
            if (
                last
                and last.rate == piece.rate
                and abs((piece.start - last.end).total_seconds()) * last.rate <= _MAX_OFF_STEP
            ):
                last.pieces += piece.pieces
            else:
                held.append(piece)
    return contents_from_table(_table(path.name, stretches), options)


def _records(where: str, data: bytes, space: Room) -> Iterator[tuple[str, _Stretch]]:
    """Give the channel and the samples of every record; those without samples are passed over."""
    at = 0
    while at + _BYTES_OF_HEAD <= len(data):
        third = data[at : at + 3] == b"MS\x03"
        if not third and not _is_record(data, at):  # headers of a SEED volume, or what fills the file
            at += _BYTES_BETWEEN
            continue
        name, start, rate, count, encoding, order, body, size = (_third if third else _second)(data, at)
        if size <= 0 or at + size > len(data):
            raise ValueError("its last record is cut off")
        if count and encoding in (*_NUMBERS, *_STEIM):
            space.take("its samples", 8 * count)
            values = _values(data[body : at + size], encoding, order, count)
            yield name, _Stretch(start, rate, [values])
        elif count and rate:
            fault = f"{name} has the encoding {encoding}, which is none of integers, floats and Steim 1 and 2"
            raise needs(where, "samples as numbers", fault, "Convert it with another program, to Steim 2 or to text.")
        at += size


def _is_record(data: bytes, at: int) -> bool:
    """Whether a record of data begins at a place: a number that may be missing, a letter for its quality, and a day of a year."""
    number, quality = data[at : at + 6].strip(b" \0"), data[at + 6 : at + 7]
    days = {struct.unpack_from(order + "H", data, at + 22)[0] for order in "<>"}
    return (
        (not number or number.isdigit())
        and quality in (b"D", b"R", b"Q", b"M")
        and any(1 <= day <= 366 for day in days)
    )


Head = tuple[str, datetime, float, int, int, str, int, int]


def _second(data: bytes, at: int) -> Head:
    """Return channel, start, rate, count, encoding, order of bytes, and where samples begin and the record ends, of version 2."""
    year = struct.unpack_from(">H", data, at + 20)[0]
    order = ">" if 1900 <= year <= 2500 else "<"
    year, day, hour, minute, second, _, parts = struct.unpack_from(order + "HHBBBBH", data, at + 20)
    count, factor, multiplier = struct.unpack_from(order + "Hhh", data, at + 30)
    begin, blockette = struct.unpack_from(order + "HH", data, at + 44)
    rate = float(factor) if factor > 0 else (-1.0 / factor if factor else 0.0)
    rate *= multiplier if multiplier > 0 else (-1.0 / multiplier if multiplier else 1.0)
    encoding, power, micros, samples = -1, 0, 0, order
    while blockette:
        kind, following = struct.unpack_from(order + "HH", data, at + blockette)
        if kind == 1000:
            encoding, big, power = struct.unpack_from("BBB", data, at + blockette + 4)
            samples = ">" if big else "<"
        elif kind == 100:
            rate = struct.unpack_from(order + "f", data, at + blockette + 4)[0] or rate
        elif kind == 1001:
            micros = struct.unpack_from("b", data, at + blockette + 5)[0]
        blockette = following if following > blockette else 0
    station, location, channel = (
        data[at + a : at + b].decode("latin-1").strip() for a, b in ((8, 13), (13, 15), (15, 18))
    )
    start = datetime(year, 1, 1) + timedelta(
        days=day - 1, hours=hour, minutes=minute, seconds=second, microseconds=100 * parts + micros
    )
    name = ".".join(word for word in (station, location, channel) if word)
    return name, start, rate, count, encoding, samples, at + begin, 1 << power if power else 0


def _third(data: bytes, at: int) -> Head:
    """Return the same of version 3, which names its channel `FDSN:NET_STA_LOC_B_S_SS`."""
    nanos, year, day, hour, minute, second, encoding, rate, count = struct.unpack_from("<IHHBBBBdI", data, at + 4)
    letters, extra, length = struct.unpack_from("<BHI", data, at + 33)
    words = data[at + 40 : at + 40 + letters].decode("latin-1").partition(":")[2].split("_")
    name = ".".join(word for word in ([*words[1:3], "".join(words[3:])]) if word)
    start = datetime(year, 1, 1) + timedelta(
        days=day - 1, hours=hour, minutes=minute, seconds=second, microseconds=nanos / 1e3
    )
    body = at + 40 + letters + extra
    order = ">" if encoding in _STEIM else "<"
    return name, start, rate if rate >= 0 else -1 / rate, count, encoding, order, body, body - at + length


def _values(body: bytes, encoding: int, order: str, count: int) -> RealArray:
    if encoding in _NUMBERS:
        word = np.dtype(order + _NUMBERS[encoding])
        if len(body) < count * word.itemsize:
            raise ValueError(f"a record counts {count} samples and has {len(body)} bytes of them")
        return np.frombuffer(body, word, count).astype(float)
    return steim(body, _STEIM[encoding], count, order)


def steim(body: bytes, version: int, count: int, order: str = ">") -> RealArray:
    """Return samples of Steim compression: x(0) stands in the first frame, x(k) = x(k-1) + d(k).

    `body`: frames of 64 bytes, a word of 16 nibbles that say how the 15 others are packed. `version`: 1 or 2.

    Raises
    ------
    ValueError
        Fewer differences than samples, an unknown packing, or a last sample that is not the one of the header.
    """
    frames = np.frombuffer(body[: len(body) // _BYTES_OF_FRAME * _BYTES_OF_FRAME], order + "u4").reshape(-1, 16)
    if not len(frames):
        raise ValueError("a compressed record has no frame")
    first, last = frames[0, 1:3].astype(np.uint32).view(np.int32)
    packing, steps = _PACKING[version], []
    for row, frame in enumerate(frames.tolist()):
        for k in range(3 if row == 0 else 1, 16):
            nibble, word = frame[0] >> (30 - 2 * k) & 3, frame[k]
            if nibble:
                pack = packing.get((nibble, None)) or packing.get((nibble, word >> 30))
                if pack is None:
                    raise ValueError(f"a word is packed as {nibble}.{word >> 30}, which no Steim {version} is")
                part = _signed(word, *pack)
                # bytes and halves of a word stand in the order of memory, parts of other lengths in that of the word
                steps += part[::-1] if order == "<" and (nibble, None) in packing else part
        if len(steps) >= count:
            break
    if len(steps) < count:
        raise ValueError(f"a record counts {count} samples and has {len(steps)} differences")
    values = np.cumsum(np.r_[int(first), np.array(steps[1:count], np.int64)])
    if values[-1] != last:
        raise ValueError(f"the last sample of a record is {values[-1]}, and its header says {last}")
    return values.astype(float)


def _signed(word: int, count: int, bits: int) -> list[int]:
    """Return so many signed numbers of so many bits, of which the last ends the word."""
    half, mask = 1 << (bits - 1), (1 << bits) - 1
    return [((word >> bits * k & mask) ^ half) - half for k in reversed(range(count))]


def _table(where: str, stretches: dict[str, list[_Stretch]]) -> Table:
    """Return the channels over the stretch that all have, of several the longest."""
    if not any(stretches.values()):
        raise unreadable(f"{where} as miniSEED", "it holds no samples", "Give a file of data records.")
    rates = {stretch.rate for held in stretches.values() for stretch in held}
    if len(rates) > 1:
        some = ", ".join(f"{name} {held[0].rate:g} Hz" for name, held in list(stretches.items())[:6])
        raise unreadable(
            where, f"its channels have different rates: {some}", "Save channels of different rates in separate files."
        )
    rate = rates.pop()
    longest = [max(held, key=lambda stretch: stretch.samples) for held in stretches.values()]
    start, end = max(stretch.start for stretch in longest), min(stretch.end for stretch in longest)
    count = round((end - start).total_seconds() * rate)
    if count < 2:
        raise unreadable(
            f"{where} as one record", "its channels have no time in common", "Give channels of the same time."
        )
    columns = []
    for k, (name, stretch) in enumerate(zip(stretches, longest, strict=True), 1):
        first = round((start - stretch.start).total_seconds() * rate)
        columns.append(Column(number=k, name=name, values=np.concatenate(stretch.pieces)[first : first + count]))
    gaps = sum(len(held) - 1 for held in stretches.values())
    notes = [f"{counted(gaps, 'gap')}: {count} samples from {start:%Y-%m-%d %H:%M:%S} were taken"] if gaps else []
    layout = ((f"{len(columns)} channels", f"{count} samples from {start:%Y-%m-%d %H:%M:%S}"),)
    return Table(
        where=where,
        columns=tuple(columns),
        rate=rate,
        rate_from="its header",
        notes=tuple(notes),
        layout=layout,
        roles={column.number: "out" for column in columns},
    )


def read_sac(path: Path, options: Options) -> Contents:
    """Read a SAC file: the samples of one channel (options of tables).

    Raises `DataError`: no such file, spectra or uneven times, or fewer samples than its header counts.
    """
    space = room(path.name, path.stat().st_size)
    with damage_as_error(f"{path.name} as SAC", "Copy it again, or export it as text."), path.open("rb") as file:
        head = file.read(_BYTES_OF_SAC)
        orders = [
            order
            for order in "<>"
            if len(head) == _BYTES_OF_SAC and struct.unpack_from(order + "i", head, 304)[0] in (6, 7)
        ]
        if not orders:
            raise ValueError("it does not begin as such a file does")
        integers = np.frombuffer(head, orders[0] + "i4", 40, 280)
        step, count = float(np.frombuffer(head, orders[0] + "f4", 1)[0]), int(integers[9])
        if integers[15] not in (1, -12345) or integers[35] == 0 or not 0 < step < 1e6 or count < 1:
            raise ValueError(f"it holds no even record (type {integers[15]}, step {step:g} s, {count} samples)")
        space.take("its samples", 8 * count)
        values = np.frombuffer(file.read(4 * count), orders[0] + "f4")
        if len(values) < count:
            raise ValueError(f"its header counts {count} samples, and {len(values)} follow")
    names = [head[place : place + 8].decode("latin-1").strip(" \0") for place in (440, 600)]
    name = ".".join(word for word in names if word and not word.startswith("-12345"))
    with np.errstate(invalid="ignore"):  # signalling NaN, which is refused later
        samples = values.astype(float)
    table = Table(
        where=path.name,
        columns=(Column(number=1, name=name, values=samples),),
        rate=float(f"{1 / step:.7g}"),  # the step has single precision
        rate_from="DELTA in its header",
        roles={1: "out"},
        quantity=_QUANTITIES.get(int(integers[16])),
    )
    return contents_from_table(table, options)
