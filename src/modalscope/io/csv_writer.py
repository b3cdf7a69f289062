"""CSV out: responses, a record of one run, and tables of modes; the layout is that of `modalscope.io.csv`."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.io.contents import Options, Thing
from modalscope.io.csv import read
from modalscope.io.marks import MARK
from modalscope.model import DataError, FrequencyResponse, ImpulseResponse, ModalModel, Signals
from modalscope.model.checks import Array
from modalscope.model.mode_table import known_columns
from modalscope.model.response import Response

__all__ = ["write"]

#: What stands in a header without doubt.
_PLAIN = re.compile(r"[\w :+.²³µ-]*|\w+/\w+²?")


def write(path: Path, thing: Thing, options: Options) -> None:
    """Write a response, a record of one run or a table of modes.

    Raises
    ------
    DataError
        A direct term, several runs, or labels that a header of columns does not give back.
    """
    if isinstance(thing, ModalModel):
        _put(path, None, *_modes_table(thing))
        return
    if isinstance(thing, FrequencyResponse):
        notes, table = _notes(thing, "quantity", "sampling_rate"), _frequency_table(thing)
    elif isinstance(thing, ImpulseResponse):
        notes, table = _notes(thing, "quantity", "sampling_rate", "kind", "first_sample"), _impulse_table(thing)
    elif isinstance(thing, Signals):
        notes, table = _notes(thing, "sampling_rate") | _quantities(thing), _record_table(thing)
    else:
        raise DataError(
            f"writing {type(thing).__name__} as .csv was asked", "there is no such table", "Use .npz, .h5 or .uff."
        )
    _check_header(path, thing, table[0])
    _put(path, notes, *table)


def _check_header(path: Path, thing: Signals | Response, header: Sequence[str]) -> None:
    """Raise when the header does not give the labels and units back: it parts them by signs that they may hold themselves."""
    _put(
        path, {} if header[0] == "frequency_hz" else {"sampling_rate": "1"}, header, [[k] * len(header) for k in (1, 2)]
    )
    try:
        again: Any = read(path, {}).thing
        kept = (again.output_dofs, again.input_dofs, again.units) == (thing.output_dofs, thing.input_dofs, thing.units)
    except DataError:
        kept = False
    if not kept:
        labels = (*thing.output_dofs, *thing.input_dofs, *thing.units[0], *thing.units[1])
        odd = [repr(label) for label in dict.fromkeys(labels) if not _PLAIN.fullmatch(label)]
        raise DataError(
            f"writing the labels and units {', '.join(odd or map(repr, labels))} as .csv was asked",
            "its header of columns would not give them back",
            "Rename them, or use .npz or .h5.",
        )


def _put(path: Path, notes: dict[str, str] | None, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        if notes is not None:
            file.writelines(f"# {name}: {value}\n" for name, value in {"written by": MARK, **notes}.items())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def _notes(thing: Any, *names: str) -> dict[str, str]:
    return {name: str(value) for name in names if (value := getattr(thing, name)) is not None}


def _quantities(record: Signals) -> dict[str, str]:
    return {"quantities": ", ".join(q or "" for q in record.quantities)} if any(record.quantities) else {}


def _flat(values: Array) -> Array:
    return values.reshape(values.shape[0], -1)


def _pair(thing: Any, i: int, j: int) -> str:
    units = (thing.units[0][i], thing.units[1][j])
    return f"{thing.output_dofs[i]} / {thing.input_dofs[j]}" + (f" [{units[0]} / {units[1]}]" if any(units) else "")


def _impulse_table(response: ImpulseResponse) -> tuple[list[str], list[list[float]]]:
    if response.feedthrough is not None:
        raise DataError(
            "writing an impulse response as .csv was asked",
            "its direct term has no column there",
            "Use .npz, .h5 or .uff.",
        )
    _, outputs, inputs = response.values.shape
    header = ["time_s", *(_pair(response, i, j) for i in range(outputs) for j in range(inputs))]
    return header, np.column_stack([response.times, _flat(response.values)]).tolist()


def _frequency_table(frf: FrequencyResponse) -> tuple[list[str], list[list[float]]]:
    pairs = [_pair(frf, i, j) for i in range(frf.values.shape[1]) for j in range(frf.values.shape[2])]
    values = _flat(frf.values)
    both = np.stack([values.real, values.imag], axis=2).reshape(values.shape[0], -1)
    header = ["frequency_hz", *(f"{part} {pair}" for pair in pairs for part in ("real", "imag"))]
    return header, np.column_stack([frf.frequencies, both]).tolist()


def _record_table(record: Signals) -> tuple[list[str], list[list[float]]]:
    if record.runs > 1:
        raise DataError(
            "writing records as .csv was asked",
            f"there are {record.runs} runs, and a table holds one",
            "Use .npz or .h5, or write each run alone.",
        )
    outputs, inputs = record.by_run()
    sides = [("out", label, unit) for label, unit in zip(record.output_dofs, record.units[0], strict=True)]
    sides += [("in", label, unit) for label, unit in zip(record.input_dofs, record.units[1], strict=True)]
    header = ["time_s", *(f"{side} {label}" + (f" [{unit}]" if unit else "") for side, label, unit in sides)]
    columns = [np.arange(record.samples) / record.sampling_rate, outputs[0]] + ([] if inputs is None else [inputs[0]])
    return header, np.column_stack(columns).tolist()


def _modes_table(modes: ModalModel) -> tuple[list[str], list[list[Any]]]:
    columns: dict[str, Sequence[Any]] = {"mode": list(range(1, len(modes) + 1))}
    columns |= {name: np.asarray(values).tolist() for name, values in known_columns(modes).items()}
    for label, row in zip(modes.output_dofs, modes.shapes, strict=True):
        columns |= {f"real {label}": row.real.tolist(), f"imag {label}": row.imag.tolist()}
    return list(columns), [list(row) for row in zip(*columns.values(), strict=True)]
