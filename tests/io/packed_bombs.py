"""The bombs of every other format: their bytes are put together here, when this is imported."""

from __future__ import annotations

import io
import json
import struct
import zlib
from pathlib import Path

import numpy as np

from tests.io.bombs import BOMBS, MB, bomb, deflated, element

# ------------------------------------------------------------------------------------------------------------------ npz


def npy_head(shape: tuple[int, ...], dtype: str, length: int = 128) -> bytes:
    text = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".ljust(length - 11) + "\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text.encode()


#: Name, packed bytes, the size that it states, method and checksum.
Member = tuple[str, bytes, int, int, int]


def zipped(members: list[Member], *, one_place: bool = False) -> bytes:
    data, central, place = [], [], 0
    for name, packed, size, method, check in members:
        head = struct.pack("<5H3IHH", 20, 0, method, 0, 33, check, len(packed), min(size, 2**32 - 1), len(name), 0)
        central.append(
            b"PK\1\2" + struct.pack("<H", 20) + head + struct.pack("<HHHII", 0, 0, 0, 0, place) + name.encode()
        )
        if not (one_place and data):
            data.append(b"PK\3\4" + head + name.encode() + packed)
            place += 0 if one_place else len(data[-1])
    listed, count = b"".join(central), min(len(members), 65535)
    end = struct.pack("<HHHHIIH", 0, 0, count, count, len(listed), sum(map(len, data)), 0)
    return b"".join([*data, listed, b"PK\5\6", end])


def stored(name: str, data: bytes, size: int | None = None) -> Member:
    return f"{name}.npy", data, len(data) if size is None else size, 0, zlib.crc32(data)


def one_array(name: str, shape: tuple[int, ...], dtype: str, size: int) -> Member:
    head = npy_head(shape, dtype)
    packed, check = deflated(head, size + len(head), raw=True)
    return f"{name}.npy", packed, size + len(head), 8, check


def small(name: str, array: np.ndarray) -> Member:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array)
    return stored(name, stream.getvalue())


RATE = small("sampling_rate", np.array(100.0))


def archive(name: str, *members: Member, one_place: bool = False) -> None:
    BOMBS[f"{name}.npz"] = lambda path: path.write_bytes(zipped(list(members), one_place=one_place)) and None


archive("a gigabyte of zeros", RATE, one_array("outputs", (125 * MB, 1), "<f8", 1000 * MB))
archive("bytes that become doubles", RATE, one_array("outputs", (90 * MB, 1), "|i1", 90 * MB))
archive("a shape beyond its member", RATE, stored("outputs", npy_head((10**12, 1), "<f8")))
archive("a member beyond the archive", RATE, stored("outputs", npy_head((5 * 10**8, 1), "<f8"), 4 * 10**9 + 128))
archive("a shape of nothing times everything", RATE, stored("outputs", npy_head((0, 10**18), "<f8")))
archive("a negative shape", RATE, stored("outputs", npy_head((-1, 10**9), "<f8")))
archive("all members in one place", *[("a.npy", *one_array("a", (MB // 8,), "<f8", MB)[1:])] * 5000, one_place=True)
archive("members without number", *[stored(f"{k}", b"") for k in range(100_000)])
archive("ten thousand unknown names", *[(f"frequenzy{k}.npy", *small("a", np.zeros(1))[1:]) for k in range(10_000)])
archive("packed by LZMA", RATE, ("outputs.npy", b"\x09\x04\5\0\x5d\xff\xff\xff\xff" + b"\0" * 99, 10**9, 14, 0))
archive(
    "one long label", RATE, small("outputs", np.zeros((3, 2))), one_array("output_dofs", (2,), "<U5000000", 40 * MB)
)
archive(
    "labels without number",
    RATE,
    small("outputs", np.zeros((3, 2))),
    one_array("output_dofs", (20 * MB,), "<U1", 80 * MB),
)
archive("lines without number", small("geometry_nodes", np.array(["a", "b"])), small("geometry_coordinates", np.zeros((2, 3))),
        one_array("geometry_lines", (30 * MB, 2), "|i1", 60 * MB))  # fmt: skip
archive(
    "notes of brackets",
    small("poles", np.array([1j])),
    small("shapes", np.ones((1, 1))),
    small("notes", np.array("[" * 100_000)),
)
archive("notes of empty lists", small("poles", np.array([1j])), small("shapes", np.ones((1, 1))),
        small("notes", np.array("[" + "[]," * 1_500_000 + "[]]")))  # fmt: skip
archive("as much as may be", RATE, one_array("outputs", (12 * MB, 1), "<f8", 96 * MB))
archive(
    "as much as may be, complex",
    small("frequencies", np.arange(1.0, MB + 1)),
    one_array("values", (MB, 7, 1), "<c16", 112 * MB),
)
archive("as many bytes as may be", RATE, one_array("outputs", (15 * MB, 1), "|i1", 15 * MB))
archive("a diagram of brackets", small("diagram", np.array("[" * 100_000)))
archive("a record of many fields", RATE, stored("outputs", npy_head((9,), "V2000000000")))


@bomb("a head of four gigabytes.npz")
def _(path: Path) -> None:
    data = b"\x93NUMPY\2\0" + struct.pack("<I", 2**32 - 1) + b" " * 100
    path.write_bytes(zipped([stored("outputs", data)]))


# --------------------------------------------------------------------------------------------------------------- MATLAB


def variable(kind: int, shape: tuple[int, ...], name: str, *parts: bytes, count: int | None = None) -> bytes:
    """Return a variable; `count` is the length that it states when more is to follow."""
    body = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack(f"<{len(shape)}i", *shape))
    body += element(1, name.encode()) + b"".join(parts)
    return struct.pack("<II", 14, len(body) if count is None else count + len(body)) + body


def matlab(name: str, *elements: bytes) -> None:
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    BOMBS[f"{name}.mat"] = lambda path: path.write_bytes(head + b"".join(elements)) and None


def nested(kind: int, depth: int) -> bytes:
    inner = variable(6, (0, 0), "", element(9, b""))
    for _ in range(depth):
        fields = (element(5, struct.pack("<i", 2)), element(1, b"a\0")) if kind == 2 else ()
        inner = variable(kind, (1, 1), "", *fields, inner)
    return variable(
        kind, (1, 1), "a", *((element(5, struct.pack("<i", 2)), element(1, b"a\0")) if kind == 2 else ()), inner
    )


def large(kind: int, word: int, size: int, shape: tuple[int, int], name: str = "outputs") -> bytes:
    body = variable(kind, shape, name, struct.pack("<II", word, size), count=size)
    return element(15, deflated(body, size + len(body), raw=False)[0])


EMPTY = variable(4, (0, 0), "")
matlab("a gigabyte of zeros", large(6, 9, 1000 * MB, (125 * MB, 1)))
matlab(
    "as much as may be",
    large(6, 9, 96 * MB, (12 * MB, 1)),
    variable(6, (1, 1), "sampling_rate", element(9, struct.pack("<d", 100))),
)
matlab("bytes that become doubles", large(6, 1, 90 * MB, (90 * MB, 1)))
matlab("variables without names", *[large(6, 9, 80 * MB, (10 * MB, 1), "")] * 50)
matlab("a text of a hundred megabytes", large(4, 16, 100 * MB, (1, 100 * MB)))
matlab("rows of text", large(4, 16, 20 * MB, (4 * MB, 5)))
matlab("dimensions beyond counting", variable(6, (2**31 - 1,) * 32, "a", element(9, b"")))
matlab("cells without number", element(15, zlib.compress(variable(1, (1000 * 1000, 1), "a", EMPTY * 1_000_000))))
matlab("cells in cells", nested(1, 10_000))
matlab("structures in structures", nested(2, 10_000))
matlab("names without number", variable(2, (1, 1), "a", element(5, struct.pack("<i", 1)), element(1, b"a" * 10 * MB)))
matlab("compressed twice", element(15, zlib.compress(element(15, zlib.compress(b"\0" * 10 * MB)))))
matlab("a long text among short ones", variable(1, (20_001, 1), "output_dofs", variable(4, (1, 100_000), "", element(16, b"x" * 100_000)),
       *[variable(4, (1, 1), "", element(16, b"x"))] * 20_000))  # fmt: skip
matlab("empty elements", element(15, deflated(b"", 100 * MB, raw=False)[0]))


# ------------------------------------------------------------------------------------------------------------ CSV, JSON


def text(name: str, *parts: str) -> None:
    BOMBS[name] = lambda path: path.write_text("".join(parts)) and None


def columns(names: list[str], rows: int = 1) -> str:
    return ",".join(names) + "\n" + (",".join(["1"] * len(names)) + "\n") * rows


text("a million lines.csv", columns(["frequency_hz", *[f"real {k} / 1" for k in range(10**6)]]))
text("a million channels.csv", columns(["time_s", *[f"out {k}" for k in range(10**6)]]))
text("ninety thousand channels.csv", columns(["time_s", *[f"out {k}" for k in range(90_000)]]))
text("pairs that grow with the square.csv", columns(["time_s", *[f"{k} / {k}" for k in range(50_000)]]))
text(
    "complex pairs that grow with the square.csv",
    columns(["frequency_hz", *[f"real {k} / {k}" for k in range(50_000)]]),
)
text("a label of blanks.csv", columns(["time_s", "x" + " " * 130_000]))
text("a label of strokes.csv", columns(["time_s", "x/" * 60_000]))
text("an output of blanks.csv", columns(["time_s", "out " + " " * 130_000 + "["]))
text("a cell beyond the limit.csv", columns(["time_s", "out " + "1" * 10**6]))
text("a quote left open.csv", 'time_s,out 1\n1,2\n"', "1,2\n" * 5_000_000)
text("ten megabytes of blank lines.csv", "\n" * 10 * MB)
text("comments without number.csv", *[f"# a{k}: 1\n" for k in range(10**6)])
text("rows without number.csv", "time_s,out 1\n", "1,2\n" * 1_000_000)
text("digits without number.csv", "time_s,out 1\n0,1\n1,", "1" * 100_000, "\n")
text("one line without end.txt", "1," * 5_000_000)
text("brackets.txt", "(" * 1_000_000 + "\n", "1 2\n" * 100)
text("digits and points.txt", ("1." * 199 + "\n") * 2000)
text("keys.txt", "key: 1\n" * 100_000)
text("digits below a step.txt", "NPTS= 4000, DT= .01 SEC\n5 ", "1" * 100_000, "x\n")
text("eight hundred channels.txt", columns(["t", *[f"a{k}" for k in range(800)]], 20))
text("brackets.json", "[" * 10**6)
text("empty lists.json", '{"modalscope": 1, "modes": [', "[]," * 7_000_000, "[]]}")
text("empty mappings.json", '{"modalscope": 1, "modes": [', "{}," * 300_000, "{}]}")
text("a number of a million digits.json", '{"modalscope": 1, "modes": ', "1" * 10**6, "}")
text(
    "a diagram of zeros.json",
    json.dumps({"modalscope": "1", "diagram": {}, "arrays": {"a": {"shape": [10**6, 10**6], "kind": "f"}}}),
)
text(
    "a diagram of nothing times everything.json",
    json.dumps({"diagram": {}, "arrays": {"a": {"shape": [0, 10**18], "kind": "f"}}}),
)
text("a diagram of one long text.json", json.dumps({"diagram": {}, "arrays": {"a": ["x" * MB, *["x"] * 100_000]}}))
text(
    "an analysis of one long text.analysis.json",
    json.dumps({"analysis": {"options": {"a": {"array": ["x" * MB, *["x"] * 10**5]}}}}),
)
text("an analysis of brackets.analysis.json", "[" * 10**6)
text("an analysis of empty lists.analysis.json", "[" + "[]," * 7_000_000 + "[]]")


# ------------------------------------------------------------------------------------------------------ universal files


def one_set(dataset: str, *lines: str) -> str:
    return "\n".join(["    -1", f"{dataset:>6}", *lines, "    -1", ""])


def function(out: int, into: int, points: int = 2, first: float = 0.0, data: str | None = None) -> str:
    head = ["NONE"] * 5 + [f"{4:5}{0:10}{0:5}{0:10} {'NONE':10}{out:10}{3:4} {'NONE':10}{into:10}{3:4}"]
    form = f"{5:10}{points:10}{1:10}{first:13.5E}{1:13.5E}{0:13.5E}"
    axis = [f"{kind:10}{0:5}{0:5}{0:5} {'NONE':20} {'NONE':20}" for kind in (18, 12, 13, 0)]
    return one_set("58", *head, form, *axis, data if data is not None else f"{1:13.5E}{1:13.5E}" * points)


def shape(node: int) -> str:
    values = "".join(f"{1:13.5E}" for _ in range(3))
    return one_set("55", *["NONE"] * 5, "".join(f"{k:10}" for k in (1, 2, 2, 12, 2, 3)), f"{2:10}{4:10}{0:10}{node:10}",
                   "".join(f"{v:13.5E}" for v in (node + 1, 1, 0.01, 0)), f"{node:10}", values)  # fmt: skip


text("twenty megabytes of blank lines.uff", "\n" * 20 * MB)
text("blank lines in a set.uff", one_set("58", "\n" * 20 * MB))
text("short lines in a set.uff", one_set("15", "1\n" * 8 * MB))
text("sets without number.uff", one_set("999") * 500_000)
text("pairs that grow with the square.uff", *[function(k, k) for k in range(5000)])
text("a row and a column.uff", *[function(k, 1) for k in range(400)], *[function(1, k) for k in range(2, 400)])
text("abscissas without number.uff", *[function(k, 1, first=k * 10.0) for k in range(5000)])
text("shapes at nodes of their own.uff", *[shape(k) for k in range(3000)])
text("points beyond counting.uff", function(1, 1, points=9_999_999_999, data=""))
text(
    "an element of a thousand million nodes.uff",
    one_set("2412", f"{1:10}{41:10}{1:10}{1:10}{1:10}{10**9:10}", *[f"{1:10}" * 8] * 50_000),
)
text("a line of a million digits.uff", one_set("15", "1" * MB))
BINARY = "    -1\n    58b     1     2          11999999999999     0     0           0           0\n"
text("bytes beyond counting.uff", BINARY, "NONE\n" * 11)
