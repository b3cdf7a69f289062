"""Write what was measured as a maker's program, a laboratory or a script would, as the choices say."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from scipy.io import savemat

from benchmarks.exports.draw import ARRAYS, HALVES, Choices
from benchmarks.exports.truth import RECORDS, Truth, draw_truth
from benchmarks.exports.words import Half, Maker

_SIGNS = {"comma": ",", "semicolon": ";", "tab": "\t", "blanks": " ", "bar": "|"}
_FORMS = {"six digits": "{:.7g}", "scientific": "{:.7e}", "fixed": "{:.5f}"}
_START = datetime(2021, 3, 14, 10, 12, 33)


@dataclass
class Column:
    """A column as it is written: name, unit, cells; what it is, for the truth."""

    name: str
    unit: str
    cells: list[str]
    kind: str = "extra"
    values: np.ndarray = field(default_factory=lambda: np.zeros(0))


@dataclass
class Drawn:
    """A file: its path, choices, what was measured, and whether it is to be refused, by its nature."""

    path: Path
    choices: Choices
    truth: Truth
    refused: bool
    columns: list[Column]


def write(folder: Path, seed: int, choices: Choices, given: Truth | None = None, name: str = "") -> Drawn:
    """Write the file of a seed and its choices into a folder; `given`: what was measured, where it is one of several of a test."""
    rng = np.random.default_rng([seed, 1])
    words = HALVES[choices["half"]]
    truth = draw_truth(rng, choices["content"]) if given is None else given
    if choices["numbers"] == "fixed":  # whoever prints five decimals has values of such a size
        scale = 3.0 / max(np.abs(truth.outputs).max(), 1e-9)
        truth.outputs = truth.outputs * scale
    columns = _columns(rng, truth, choices, words)
    _names_and_units(truth, columns)
    refused = choices["content"] == "spectrum" or choices["axis"] == "absent"
    refused = refused or (choices["container"] == "npy" and not any(c.kind == "axis" for c in columns))
    suffix = {"mat struct": "mat", "mat arrays": "mat", "mat matrix": "mat"}.get(
        choices["container"], choices["container"]
    )
    path = folder / f"{name or f'file{seed}'}.{suffix}"
    if choices["container"] in ARRAYS:
        if choices["container"] != "mat matrix" and (
            choices["container"] == "npy" or truth.inputs is not None or truth.of_lines
        ):
            truth.units = [""] * len(truth.units)  # arrays of several kinds come without
        _write_arrays(rng, path, truth, choices, columns)
    else:
        _write_rows(rng, path, truth, choices, columns, words)
    return Drawn(path, choices, truth, refused, columns)


# what stands in the columns


def _columns(rng: np.random.Generator, truth: Truth, choices: Choices, words: Half) -> list[Column]:
    named = choices["telling"] == "yes"
    units = {kind: str(rng.choice([unit for unit, _ in pairs])) for kind, pairs in words.units.items()}
    if choices["head"] in ("none", "names"):
        units = dict.fromkeys(units, "")
    axis = _axis(rng, truth, choices, words)
    measured = (
        _of_record(rng, truth, words, units, named, choices["drive"])
        if truth.content in RECORDS
        else _of_lines(rng, truth, choices, words, units)
    )
    extras = [_extra(rng, truth, name) for name in (choices["extra"], choices["more"]) if name != "absent"]
    first = [
        extra for extra, name in zip(extras, (choices["extra"], choices["more"]), strict=False) if name == "index first"
    ]
    rest = [extra for extra in extras if extra not in first]
    columns = [*first, *axis, *measured, *rest]
    form = _FORMS[choices["numbers"]]
    for column in columns:
        if not column.cells:
            column.cells = [form.format(value) for value in column.values]
            column.values = np.array([float(cell) for cell in column.cells])
    _read_back(truth, columns)
    return columns


def _read_back(truth: Truth, columns: list[Column]) -> None:
    """Put into the truth what was written, with the digits that it has there."""
    of = {
        kind: [c.values for c in columns if c.kind == kind]
        for kind in ("out", "in", "real", "imag", "mag", "phase", "level")
    }
    if of["out"] and truth.content in RECORDS:
        truth.outputs = np.stack(of["out"], axis=1)
        truth.inputs = np.stack(of["in"], axis=1) if of["in"] else None
    if of["real"]:
        truth.outputs = np.stack(of["real"], axis=1) + 1j * np.stack(of["imag"], axis=1)
    if of["phase"]:
        size = np.stack(of["mag"], axis=1) if of["mag"] else 10 ** (np.stack(of["level"], axis=1) / 20)
        phase = np.stack(of["phase"], axis=1)
        truth.outputs = size * np.exp(1j * (phase if truth.content == "polar radians" else np.deg2rad(phase)))


def _axis(rng: np.random.Generator, truth: Truth, choices: Choices, words: Half) -> list[Column]:
    kind, x = choices["axis"], truth.axis
    if truth.of_lines:
        factor = {"rad/s": 2 * np.pi, "rad/sec": 2 * np.pi, "rpm": 60.0, "U/min": 60.0, "cpm": 60.0, "kHz": 1e-3}.get(
            kind, 1.0
        )
        unit = kind if factor != 1.0 else "Hz"
        if kind in ("start and step", "absent"):
            return []
        return [Column(str(rng.choice(words.frequency)), unit, [f"{value * factor:.9g}" for value in x], "axis")]
    if kind in ("rate", "step", "absent"):
        return []
    name = str(rng.choice(words.time))
    if kind == "index and rate":
        return [Column("Index", "", [str(k + 1) for k in range(len(x))], "index")]
    if kind in ("stamps", "clock"):
        stamps = [_START + timedelta(seconds=float(value)) for value in x]
        form = "%Y-%m-%d %H:%M:%S.%f" if kind == "stamps" else "%H:%M:%S.%f"
        return [Column("Date" if kind == "stamps" else name, "", [stamp.strftime(form) for stamp in stamps], "stamps")]
    if kind in ("epoch", "epoch ms"):
        start, factor, digits = 1615716753.0, (1.0 if kind == "epoch" else 1e3), (6 if kind == "epoch" else 3)
        return [Column("Timestamp", "", [f"{(start + value) * factor:.{digits}f}" for value in x], "axis")]
    factor, digits = {"s": (1.0, 8), "ms": (1e3, 5), "us": (1e6, 2)}[kind]
    return [Column(name, kind, [f"{value * factor:.{digits}f}" for value in x], "axis")]


def _of_record(
    rng: np.random.Generator, truth: Truth, words: Half, units: dict[str, str], named: bool, drive: str
) -> list[Column]:
    style = str(rng.choice(words.sensors))
    letters = "xyzuv"
    outs = [
        Column(style.format(n=k + 1, axis=letters[k]), units["acceleration"], [], "out", truth.outputs[:, k])
        for k in range(truth.outputs.shape[1])
    ]
    if truth.inputs is None:
        return outs
    if drive == "instead":  # the force was not measured
        voltage = Column(str(rng.choice(words.drives)), "V" if units["force"] else "", [], "in", truth.inputs[:, 0])
        return [voltage, *outs] if rng.random() < 0.7 else [*outs, voltage]
    force = Column(
        str(rng.choice(words.forces)) if named or not units["force"] else style.format(n=9, axis="w"),
        units["force"],
        [],
        "in",
        truth.inputs[:, 0],
    )
    if not named and not units["force"]:
        force.name = style.format(n=9, axis="w")
    if drive == "beside":  # what the amplifier made of it
        size = 2 * truth.inputs[:, 0] / np.abs(truth.inputs).max()
        values = np.convolve(size, [0.1, 0.6, 0.3], "same") + 0.01 * rng.standard_normal(len(size))
        outs.insert(
            int(rng.integers(len(outs) + 1)),
            Column(str(rng.choice(words.drives)), "V" if units["force"] else "", [], values=values),
        )
    return [force, *outs] if rng.random() < 0.7 else [*outs, force]


def _of_lines(
    rng: np.random.Generator, truth: Truth, choices: Choices, words: Half, units: dict[str, str]
) -> list[Column]:
    columns: list[Column] = []
    style = str(rng.choice(["H{n}", "FRF {n}", "{n}Z/1X", "Point {n}"]))
    first, second = words.parts[int(rng.integers(len(words.parts)))]
    size, angle = words.polar[int(rng.integers(len(words.polar)))]
    unit, content = units["response"], truth.content
    for k in range(truth.outputs.shape[1]):
        name, h = style.format(n=k + 2), truth.outputs[:, k]
        if content == "spectrum":
            columns.append(Column(name.replace("FRF", "CH").replace("H", "CH"), "", [], "spectrum", np.abs(h)))
        elif content == "complex":
            columns.append(
                Column(
                    name,
                    unit,
                    [f"{v.real:.7g}{v.imag:+.7g}{'i' if choices['half'] == 'near' else 'j'}" for v in h],
                    "complex",
                    h,
                )
            )
        elif content == "parts":
            columns += [
                Column(first.format(name=name), unit, [], "real", h.real),
                Column(second.format(name=name), unit, [], "imag", h.imag),
            ]
        else:
            phase = np.angle(h) if content == "polar radians" else np.angle(h, deg=True)
            values, of, kind = (
                (20 * np.log10(np.abs(h) + 1e-12), "dB", "level") if content == "decibels" else (np.abs(h), unit, "mag")
            )
            angles = "rad" if content == "polar radians" else "deg"
            told = choices["head"] not in ("none", "names")
            columns += [
                Column(size.format(name=name), of if told else "", [], kind, values),
                Column(angle.format(name=name), angles if told else "", [], "phase", phase),
            ]
    if choices["coherence"] == "yes":
        truth.coherence = np.clip(1 - 0.02 * np.abs(rng.standard_normal(truth.outputs.shape)), 0, 1)
        pattern = str(rng.choice(words.coherence))
        columns += [
            Column(pattern.format(name=style.format(n=k + 2)), "", [], "coherence", truth.coherence[:, k])
            for k in range(truth.outputs.shape[1])
        ]
    return columns


def _extra(rng: np.random.Generator, truth: Truth, name: str) -> Column:
    rows = len(truth.axis)
    k = np.arange(rows)
    if name in ("index first", "counter last"):
        return Column(
            "Index" if name == "index first" else "Frame",
            "",
            [str(v) for v in k + (1 if name == "index first" else 4711)],
        )
    if name == "comment":
        return Column("Comment", "", ["" if v else "start of test" for v in k])
    if name == "trigger":
        return Column("Trigger", "", [str(int(30 <= v < 60)) for v in k])
    if name == "tacho":
        return Column("Tacho", "", [str(int(v % 17 < 3)) for v in k])
    if name == "second time":
        return Column("Time_chan_2", "s", [f"{v:.8f}" for v in truth.axis], "extra")
    if name == "features":
        return Column("Features", "", [str(int(v)) for v in np.rint(80 + 5 * rng.standard_normal(rows))], "extra")
    if name == "generator":
        return Column("Source", "V", [], values=rng.standard_normal(rows))
    slow = np.round(21.5 + 0.3 * np.sin(k / rows), 1)
    if name in ("temperature", "temp"):
        return Column(
            "Temperature" if name == "temperature" else "Temp",
            "°C" if name == "temperature" else "",
            [f"{v:.1f}" for v in slow],
        )
    if name == "battery":
        return Column("Battery", "V", [f"{v / 5.2:.2f}" for v in slow])
    if name == "magnitude":
        size = np.sqrt(np.sum(np.abs(truth.outputs) ** 2, axis=1))
        return Column("|a|", "", [], values=size)
    return Column("Drive voltage", "V", [], values=rng.standard_normal(rows))


def _names_and_units(truth: Truth, columns: list[Column]) -> None:
    kinds = {"out": 0, "real": 0, "mag": 0, "level": 0, "complex": 0, "in": 1}
    measured = sorted((c for c in columns if c.kind in kinds), key=lambda c: kinds[c.kind])
    truth.names, truth.units = [c.name for c in measured], [c.unit for c in measured]


# rows of a text or a sheet


def _write_rows(
    rng: np.random.Generator, path: Path, truth: Truth, choices: Choices, columns: list[Column], words: Half
) -> None:
    sign, odd = _SIGNS[choices["separator"]], (choices["oddity"], choices["other"])
    comma = choices["decimal"] == "comma"
    body = [[_decimal(cell, comma) for cell in row] for row in zip(*(c.cells for c in columns), strict=True)]
    unequal = "unequal" in odd and len(columns) > 2
    if unequal:
        _shorten(truth, body, columns[-1].kind != "extra")
    head = _head_rows(columns, choices)
    statements = _statements(rng, truth, choices, words)
    if path.suffix == ".xlsx":
        _write_sheet(rng, path, statements, head, body, choices)
        return
    quoted = choices["quotes"]
    lines = [
        _joined(row, sign, quoted == "all" or (quoted == "names") or choices["head"] in ("four rows", "quoted"))
        for row in head
    ]
    rows = [_joined(row, sign, quoted == "all") for row in body]
    if sign == " ":
        rows = [" " + "  ".join(f"{cell:>14}" for cell in row) for row in body]
        lines = ["  ".join(f"{cell.replace(' ', '_'):>14}" for cell in row) for row in head]
    if "trailing delimiter" in odd:
        lines, rows = [line + sign for line in lines], [row + sign for row in rows]
    middle = len(rows) // 2
    if "remark" in odd:
        rows.insert(middle, "# remark: train passes")
    if "head again" in odd and lines:
        rows[middle:middle] = lines
    if "blank lines" in odd:
        rows[middle:middle] = ["", ""]
    if "cut line" in odd:
        rows[-1] = rows[-1][: max(1, len(rows[-1]) // 3)]
        _cut(truth, int(not unequal or columns[-1].kind == "extra"))
    if "footer" in odd:
        rows += ["End of file", f"Samples: {len(body)}"]
    above = [f"sep={sign}"] if "sep line" in odd else []
    above += [_statement(item, choices, sign) for item in statements]
    if choices["header"] == "comments" and choices["half"] == "near":
        lines = [f"# {line}" for line in lines]
    text = ("\r\n" if choices["line ends"] == "windows" else "\n").join([*above, *lines, *rows, ""])
    encoding = choices["encoding"] if choices["encoding"] != "utf-8" or "byte order mark" not in odd else "utf-8-sig"
    path.write_bytes(text.encode(encoding, errors="replace"))


def _decimal(cell: str, comma: bool) -> str:
    return (
        cell.replace(".", ",")
        if comma and ":" not in cell and not cell.isalpha() and any(c.isdigit() for c in cell)
        else cell
    )


def _shorten(truth: Truth, body: list[list[str]], measured: bool) -> None:
    """Leave the end of the last measured column blank, as loggers with channels of unequal length do."""
    missing = 7
    for row in body[-missing:]:
        row[-1] = ""
    if measured:
        _cut(truth, missing)


def _cut(truth: Truth, rows: int) -> None:
    kept = len(truth.axis) - rows
    truth.axis, truth.outputs = truth.axis[:kept], truth.outputs[:kept]
    truth.inputs = None if truth.inputs is None else truth.inputs[:kept]
    truth.coherence = None if truth.coherence is None else truth.coherence[:kept]


def _joined(row: list[str], sign: str, quoted: bool) -> str:
    return sign.join(f'"{cell}"' if quoted or (sign in cell and sign != " ") else cell for cell in row)


def _head_rows(columns: list[Column], choices: Choices) -> list[list[str]]:
    """Return the rows above the body that have a cell a column."""
    names, units, style = [c.name for c in columns], [c.unit for c in columns], choices["head"]
    odd = (choices["oddity"], choices["other"])
    if style == "none":
        return []
    rows = {
        "names": [[c.name for c in columns]],
        "brackets": [[f"{n} [{u}]" if u else n for n, u in zip(names, units, strict=True)]],
        "round": [[f"{n} ({u})" if u else n for n, u in zip(names, units, strict=True)]],
        "unit row": [names, units],
        "stroke": [[f"{n}/{u if '/' not in u else f'({u})'}" if u else n for n, u in zip(names, units, strict=True)]],
        "slash": [[f"{n} / {u}" if u else n for n, u in zip(names, units, strict=True)]],
        "units above": [[f"[{u}]" if u else "" for u in units], names],
        "four rows": [
            ["TOA5", "CR6", "7821", *[""] * max(0, len(names) - 3)][: max(3, len(names))],
            names,
            units,
            ["TS" if k == 0 else "Smp" for k in range(len(names))],
        ],
        "quoted": [["Sensitivity", *[f"{100 + 1.7 * k:.1f}" for k in range(len(names) - 1)]], names, units],
    }[style]
    if "two header rows" in odd:
        rows = (
            [*rows[:-1], rows[-1], ["", *[f"SN{4711 + k}" for k in range(len(names) - 1)]]] if len(names) > 2 else rows
        )
    return [row for row in rows if any(row)]


# header statements

Item = tuple[str, str, str]


def _statements(rng: np.random.Generator, truth: Truth, choices: Choices, words: Half) -> list[Item]:
    """Return keys, values and units of what stands above; remarks have no value."""
    if choices["header"] == "absent":
        return []
    maker = words.makers[choices["maker"]]
    many = {"short": 3, "twenty": 18, "ninety": 88}[choices["length"]]
    remarks = [("", str(rng.choice(maker.remarks)), "") for _ in range(many)]
    facts = _facts(rng, truth, choices, maker)
    for fact in facts:
        remarks.insert(int(rng.integers(0, len(remarks) + 1)), fact)
    return remarks


def _facts(rng: np.random.Generator, truth: Truth, choices: Choices, maker: Maker) -> list[Item]:
    facts: list[Item] = [(maker.count, str(len(truth.axis)), "")] if rng.random() < 0.5 else []
    step = float(truth.axis[1] - truth.axis[0])
    if truth.of_lines:
        if choices["axis"] == "start and step":
            facts += [
                (maker.first, f"{truth.axis[0]:g}", "Hz"),
                (maker.step if maker.step.startswith(("X-", "Inc", "Delta")) else "Frequency step", f"{step:g}", "Hz"),
            ]
        return facts
    if choices["axis"] == "step":
        return [
            *facts,
            (
                maker.step,
                f"{step:.10g}",
                "s" if not any(b in maker.step for b in "([") and "_S" not in maker.step else "",
            ),
        ]
    if choices["rate"] == "said" and choices["axis"] != "absent":
        unit = "" if any(b in maker.rate for b in "([") or "HZ" in maker.rate else "Hz"
        facts.append((maker.rate, f"{truth.rate:g}", unit if rng.random() < 0.7 else ""))
    return facts


def _statement(item: Item, choices: Choices, sign: str) -> str:
    key, value, unit = item
    style = choices["header"]
    comma = choices["decimal"] == "comma"
    value = value.replace(".", ",") if comma and key else value
    if not key:
        text = value
        if style == "equals":
            text = text.replace(": ", "=", 1)
    elif style == "equals":
        text = f"{key}={value}{' ' + unit if unit else ''}"
    elif style == "cells":
        text = sign.join([key, value, *([unit] if unit else [])]) if sign != " " else f"{key}: {value} {unit}".rstrip()
    else:
        text = f"{key}: {value} {unit}".rstrip()
    if style == "comments":
        return f"# {text}" if choices["half"] == "near" else f"% {text}"
    if style == "sections" and not key and value.startswith(("T", "D", "E")):
        return f"[{value.split(':')[0]}]"
    return text


def _write_sheet(
    rng: np.random.Generator,
    path: Path,
    statements: list[Item],
    head: list[list[str]],
    body: list[list[str]],
    choices: Choices,
) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    for key, value, unit in statements:
        sheet.append(
            [key, float(value), unit] if key else [part.strip() for part in value.replace("\t", ":").split(":", 1)]
        )
    for row in head:
        sheet.append(row)
    for k, row in enumerate(body):
        cells = [_cell(cell, choices["decimal"] == "comma") for cell in row]
        if k == len(body) // 2 and "remark" in (choices["oddity"], choices["other"]):
            sheet.append(["remark: train passes"])
        sheet.append(cells)
    book.save(path)


def _cell(text: str, as_text: bool) -> str | float | None:
    if text == "":
        return None
    try:
        return text if as_text else float(text)
    except ValueError:
        return text


# arrays


def _write_arrays(rng: np.random.Generator, path: Path, truth: Truth, choices: Choices, columns: list[Column]) -> None:
    near = choices["half"] == "near"
    of = {kind: [c for c in columns if c.kind == kind] for kind in {c.kind for c in columns}}
    with_axis = choices["axis"] not in ("absent", "rate", "step", "start and step", "index and rate", "stamps", "clock")
    axis = of.get("axis", [])
    vector = np.array([float(cell) for cell in axis[0].cells]) if axis and with_axis else None
    if choices["container"] in ("mat matrix", "npy"):
        parts = [
            c
            for c in columns
            if c.kind
            in ("axis", "out", "in", "real", "imag", "mag", "level", "phase", "spectrum", "coherence", "complex")
        ]
        table = np.stack([c.values if c.values.size else np.array([float(v) for v in c.cells]) for c in parts], axis=1)
        if path.suffix == ".npy":
            np.save(path, table)
        else:
            savemat(path, {"data" if near else "M": table, **_labels(parts, near), **_scalars(truth, choices, near)})
            truth.units = truth.units if any(c.unit for c in parts) else [""] * len(truth.units)
        return
    names = {
        "axis": "t" if near else "Time",
        "out": "acc" if near else "responses",
        "in": "force" if near else "excitation",
        "complex": "H" if near else "FRF",
    }
    if truth.of_lines:
        names["axis"] = (
            "w" if choices["axis"] == "rad/s" else "omega" if choices["axis"] == "rad/sec" else "f" if near else "freq"
        )
    elif choices["axis"] in ("ms", "us"):
        names["axis"] = f"t_{choices['axis']}"
    arrays: dict[str, np.ndarray | str] = {} if vector is None else {names["axis"]: vector}
    for kind in ("in", "out", "complex", "real", "imag", "mag", "level", "phase", "spectrum", "coherence"):
        if kind in of:
            arrays[names.get(kind, {"level": "dB", "imag": "imag"}.get(kind, kind))] = np.stack(
                [c.values for c in of[kind]], axis=1
            )
    arrays |= _labels(of.get("out", []), near) if not of.get("in") else {}
    arrays |= _scalars(truth, choices, near)
    arrays["date" if near else "Operator"] = "2021-03-14" if near else "J. Smith"
    if choices["container"] == "npz":
        np.savez(path, **arrays)
    else:
        savemat(path, {"test" if near else "Data": arrays} if choices["container"] == "mat struct" else arrays)


def _labels(columns: list[Column], near: bool) -> dict[str, np.ndarray]:
    if not columns or not any(c.unit for c in columns):
        return {}
    names, units = (
        np.array([c.name for c in columns], dtype=object),
        np.array([c.unit or "-" for c in columns], dtype=object),
    )
    return {
        "names" if near else "channel_names": names.astype(str),
        "units" if near else "channel_units": units.astype(str),
    }


def _scalars(truth: Truth, choices: Choices, near: bool) -> dict[str, np.ndarray]:
    axis, step = choices["axis"], float(truth.axis[1] - truth.axis[0])
    if axis == "absent":
        return {}
    if truth.of_lines:
        return {"f0": np.array(truth.axis[0]), "df": np.array(step)} if axis == "start and step" else {}
    if axis == "step":
        return {"Ts": np.array(step)}
    if axis in ("rate", "index and rate", "stamps", "clock") or choices["rate"] == "said":
        return {"fs" if near else "sampleRate": np.array(truth.rate)}
    return {}
