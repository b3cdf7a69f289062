"""Find the data sets of a universal file by their own counts, and guard against damaged ones.

Readers that search for the delimiter `    -1` take a truncated or foreign file for an empty one, and a delimiter inside
binary data for the end of it. Here a set that is not closed, data outside any set, or a payload that is not as long as
its header says is an error that names the set. Lines of text between the sets are comments, as the standard allows.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from modalscope.data import DataError
from modalscope.io.contents import unreadable
from modalscope.io.limits import MOST_PARTS, Room
from modalscope.io.uff.layout import Field, parse

#: Records before the data of a dataset 58.
HEADER_LINES = 11
#: Record 1 of dataset 58b, behind the dataset's number.
BINARY = (
    Field("dataset", 6, "i"), Field("flag", 1, "a"), Field("byte order", 6, "i"), Field("floating-point format", 6, "i"),
    Field("number of ASCII lines", 12, "i"), Field("number of bytes", 12, "i"),
    Field("", 6, "-"), Field("", 6, "-"), Field("", 12, "-"), Field("", 12, "-"),
)  # fmt: skip
#: Record 7 of dataset 58: the form of the data.
FORM = (
    Field("ordinate data type", 10, "i"), Field("number of points", 10, "i"), Field("abscissa spacing", 10, "i"),
    Field("abscissa minimum", 13, "e"), Field("abscissa increment", 13, "e"), Field("z-axis value", 13, "e"),
)  # fmt: skip

_CLOSING = re.compile(rb"^ {4}-1 *\r?$", re.MULTILINE)
_AFTER_PAYLOAD = re.compile(rb"\r?\n? {4}-1 *(?:\r?\n|\Z)")
_NUMBER = re.compile(rb" *\d+\Z")
_BLANK_LINES = re.compile(rb"(?:[ \t\r\f\v]*\n)*+")
#: Blanks, and the sign of the end of old files.
_BLANK = b" \t\r\n\x1a"
#: Lines of text between sets, and characters of one, at most.
_MAX_COMMENTS, _MAX_CHARACTERS = 50, 200
_LETTERS = re.compile(rb"[A-Za-z\xc0-\xff]{3}")
#: Bytes in the file for each set, and in memory for each line, at least.
_BYTES_OF_SET, _BYTES_OF_LINE = 200, 50
#: Parts of a value and bytes of a part, by ordinate data type; codes of byte orders and of IEEE numbers.
WORDS = {2: (1, 4), 4: (1, 8), 5: (2, 4), 6: (2, 8)}
_LITTLE, _BIG, _IEEE = 1, 2, 2


@dataclass(frozen=True, kw_only=True, slots=True)
class Block:
    """One set: its place in the file, its dataset number, its records, and the payload of a binary one.

    `order` is "<" or ">" for binary data; `abscissa_bytes` is the size of an abscissa value that is stored with each point, 0
    for even spacing; `note` says what was odd but certain.
    """

    place: int
    dataset: int
    records: tuple[bytes, ...]
    payload: bytes | None = None
    order: str = "<"
    abscissa_bytes: int = 0
    note: str = ""

    @property
    def name(self) -> str:
        """The set in words."""
        return f"set {self.place} (dataset {self.dataset}{'' if self.payload is None else 'b'})"


def scan(name: str, data: bytes, space: Room) -> list[Block]:
    """Return the sets of a universal file.

    `space`: what its lines may take.

    Raises `DataError`: not a universal file, a set that is cut off, a payload of another length than its header counts, more than the
    room.
    """
    blocks: list[Block] = []
    line, position = _past_comments(data, 0)
    while line.strip(_BLANK):
        if line.rstrip() != b"    -1":
            raise _foreign(name, line, blocks)
        block, position = _block(name, data, position, len(blocks) + 1, space)
        blocks.append(block)
        space.parts("sets", len(blocks), max(MOST_PARTS // 10, len(data) // _BYTES_OF_SET))
        line, position = _past_comments(data, position)
    if not blocks:
        raise _foreign(name, b"", blocks)
    return blocks


def _foreign(name: str, line: bytes, blocks: list[Block]) -> DataError:
    text = line[:30].decode("latin-1")
    if blocks:
        fault = f"after set {len(blocks)} comes {text!r} where a set should begin"
        return unreadable(name, fault, "The file is cut off or damaged there; export it again.")
    fault = f"it begins with {text!r}, not with the delimiter '    -1'" if line else "it has no sets"
    remedy = "Export it as a universal file, or give it the suffix of what it is."
    return unreadable(f"{name} as a universal file", fault, remedy)


def _cut(name: str, place: int, fault: str) -> DataError:
    return unreadable(f"set {place} of {name}", fault, "The file is cut off or damaged there; export or copy it again.")


def _block(name: str, data: bytes, start: int, place: int, space: Room) -> tuple[Block, int]:
    head, position = _line(data, start)
    if head[6:7] in (b"b", b"B") and head[:6].strip() == b"58":
        return _binary_block(name, data, head, position, place)
    rest = head[6:].strip()
    if not _NUMBER.match(head[:6].rstrip()) or (rest and not (head[6:7] == b" " and _is_text(rest))):
        raise _cut(name, place, f"it has {head[:20].decode('latin-1')!r} for its dataset number")
    closing = _CLOSING.search(data, position)
    if closing is None:
        raise _cut(name, place, "it is not closed by a delimiter '    -1' before the file ends")
    body = data[position : closing.start()]
    space.take("its lines", _BYTES_OF_LINE * body.count(b"\n"))
    records = tuple(line.rstrip(b"\r") for line in body.split(b"\n")[:-1])
    note = f"text after the number of set {place}: {rest.decode('latin-1')[:40]!r}" if rest else ""
    return Block(place=place, dataset=int(head[:6]), records=records, note=note), min(closing.end() + 1, len(data))


def _line(data: bytes, start: int) -> tuple[bytes, int]:
    end = data.find(b"\n", start)
    end = len(data) if end < 0 else end
    return data[start:end].rstrip(b"\r"), min(end + 1, len(data))


def _past_comments(data: bytes, start: int) -> tuple[bytes, int]:
    """Return the next line that is not blank, after comments: lines of text before a delimiter or the end of the file."""

    def next_line(start: int) -> tuple[bytes, int]:
        blank = _BLANK_LINES.match(data, start)
        return _line(data, blank.end() if blank else start)

    first = line, position = next_line(start)
    for _ in range(_MAX_COMMENTS):
        if line.rstrip() == b"    -1" or not line.strip(_BLANK):
            return (line, position) if start or line.strip(_BLANK) else first
        if not _is_text(line):
            break
        line, position = next_line(position)
    return first


def _is_text(line: bytes) -> bool:
    """Whether a line is a comment: printable, with a word in it, and no row of numbers."""
    text = line.decode("latin-1").strip()
    return len(text) <= _MAX_CHARACTERS and text.isprintable() and _LETTERS.search(line) is not None


def _binary_block(name: str, data: bytes, head: bytes, position: int, place: int) -> tuple[Block, int]:
    where = f"set {place} (dataset 58b) of {name}"
    header = parse(BINARY, head, where)
    if header["number of ASCII lines"] != HEADER_LINES:
        fault = f"it counts {header['number of ASCII lines']} ASCII lines where dataset 58 has {HEADER_LINES}"
        raise _cut(name, place, fault)
    order, number_format = header["byte order"], header["floating-point format"]
    if order not in (_LITTLE, _BIG) or number_format != _IEEE:
        remedy = "Export it with byte order 1 (little-endian) or 2 (big-endian) and format 2 (IEEE 754)."
        raise unreadable(where, f"its byte order is {order} and its floating-point format {number_format}", remedy)
    records = []
    for _ in range(HEADER_LINES):
        line, position = _line(data, position)
        records.append(line)
    form = parse(FORM, records[6], where)
    length, abscissa_bytes = _payload_length(name, place, form, header["number of bytes"])
    end = position + length
    after = _AFTER_PAYLOAD.match(data, end)
    if end > len(data) or after is None:
        short = f"{max(0, len(data) - position)} bytes are left in the file"
        fault = short if end > len(data) else "no delimiter follows them"
        raise _cut(name, place, f"its header counts {length} bytes of data, and {fault}")
    block = Block(
        place=place,
        dataset=58,
        records=tuple(records),
        payload=data[position:end],
        order="<" if order == _LITTLE else ">",
        abscissa_bytes=abscissa_bytes,
    )
    return block, after.end()


def _payload_length(name: str, place: int, form: dict[str, int], counted: int) -> tuple[int, int]:
    """Return the bytes of the payload and of an abscissa value, from record 7 and the byte count."""
    points = form["number of points"]
    kind, spacing = form["ordinate data type"], form["abscissa spacing"]
    if kind not in WORDS or points < 1 or spacing not in (0, 1):
        raise _cut(name, place, f"its record 7 asks for data type {kind}, {points} points and spacing {spacing}")
    parts, size = WORDS[kind]
    # the standard stores an uneven abscissa in single precision, most programs in that of the ordinate
    abscissas = (0,) if spacing else (size, 4)
    for abscissa in abscissas:
        if counted == points * (parts * size + abscissa):
            return counted, abscissa
    length = points * (parts * size + abscissas[0])
    if counted == points * size:
        return length, abscissas[0]  # some programs count one value a complex point; all bytes are there
    raise _cut(name, place, f"its header counts {counted} bytes, and its {points} points need {length}")
