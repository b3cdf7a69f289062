"""Interpret the files, ranges and reading options of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from modalscope.cli.process import remark
from modalscope.data import DataError, ModalModel, Note
from modalscope.data.shown import summary_of
from modalscope.io import set_max_memory, survey

#: Options of reading that are handed on as they are.
_AS_GIVEN = (
    "sampling_rate",
    "columns",
    "ignore",
    "rows",
    "resample",
    "skip",
    "delimiter",
    "decimal",
    "transpose",
    "sheet",
)


def read_data(options: argparse.Namespace, path: Path) -> tuple[Any, tuple[Note, ...]]:
    """Read a file with the options given on the command line; say what of it was left out."""
    found = survey(path, **reading_options(options, path))
    return found.thing, found.told


def read_test(options: argparse.Namespace) -> tuple[Any, tuple[Note, ...]]:
    """Read the files of one test, responses or records; say what of them was left out."""
    from modalscope.workflow.sources import opened

    data, _, told = opened(options.files, [reading_options(options, path) for path in options.files])
    return data, told


def read_modes(options: argparse.Namespace, path: Path) -> ModalModel:
    """Read a file of modes."""
    modes, told = read_data(options, path)
    for note in told:
        remark(note)
    if not isinstance(modes, ModalModel):
        raise DataError(
            f"modes in {path} were asked",
            f"the file holds {summary_of(modes)}",
            "Give a file of modes, or find them first: modalscope identify.",
        )
    return modes


def reading_options(options: argparse.Namespace, path: Path) -> dict[str, Any]:
    """Return the options of `modalscope.io.read` for one of the files; what it may take of the memory is set for the process."""
    set_max_memory(options.max_memory)
    given: dict[str, Any] = {"quantity": options.quantity} if options.quantity else {}
    given |= {name: value for name in _AS_GIVEN if (value := getattr(options, name)) not in (None, False)}
    if options.geometry:
        given["geometry"] = [options.geometry, options.lines] if options.lines else options.geometry
    if options.units:
        given["units"] = _pairs("units", options.units.split(","), '"2=N,AccA=m/s^2"')
    for name, example in (("rename", "y=outputs"), ("axes", "values=inputs,outputs,lines")):
        items = getattr(options, name)
        if items:
            given[name] = _pairs(name, items, example)
    files = getattr(options, "files", [path])
    for name in ("input_dofs", "output_dofs"):
        items = getattr(options, name, None)
        if items and path in files:
            given[name] = _labels(name, items, files, path)
    return given


def _labels(name: str, items: list[str], files: list[Path], path: Path) -> list[str]:
    """Return the labels of the channels of one file: those for all, or its own item."""
    if len(items) not in (1, len(files)):
        raise DataError(
            f"--{name.replace('_', '-')} {' '.join(items)} was asked",
            f"there are {len(items)} items and {len(files)} files",
            "Give one item for all files, or one for each; labels of one file have commas between them.",
        )
    return items[0 if len(items) == 1 else files.index(path)].split(",")


def _pairs(name: str, items: list[str], example: str) -> dict[str, str]:
    pairs = [item.partition("=") for item in items]
    for item, (old, sign, new) in zip(items, pairs, strict=True):
        if not (old and sign and new):
            raise DataError(
                f"--{name} {item} was asked",
                "it is not of the form NAME=VALUE",
                f"Write for instance --{name} {example}.",
            )
    return {old: new.replace(",", " ") for old, _, new in pairs}


def parse_orders(text: str | None) -> range | None:
    """Read `2:60:2`, `2:60` or `40`; both ends belong to the range.

    Examples
    --------
    >>> parse_orders("2:10:4"), parse_orders("12")
    (range(2, 11, 4), range(12, 13))
    """
    if text is None:
        return None
    try:
        parts = [int(part) for part in text.split(":")]
    except ValueError:
        parts = []
    first, last, step = {1: (*parts, *parts, 1), 2: (*parts, 1), 3: tuple(parts)}.get(len(parts), (0, 0, 0))
    if not (1 <= first <= last and step >= 1):
        raise DataError(
            f"orders {text!r} were asked",
            "they are not of the form FIRST:LAST:STEP, FIRST at least 1",
            "Write for instance --orders 2:60:2.",
        )
    return range(first, last + 1, step)


def parse_delays(words: Sequence[str] | None) -> dict[str, int] | None:
    """Read `y3=12 y4=12`, or `none`, which takes no delay out.

    Examples
    --------
    >>> parse_delays(["y3=12"]), parse_delays(["none"]), parse_delays(None)
    ({'y3': 12}, {}, None)
    """
    if words is None:
        return None
    if list(words) == ["none"]:
        return {}
    parts = [word.rpartition("=") for word in words]
    if not all(dof and samples.isdecimal() for dof, _, samples in parts):
        raise DataError(
            f"delays {' '.join(words)!r} were asked",
            "they are not of the form DOF=SAMPLES, a whole number of samples",
            "Write for instance --delays y3=12 y4=12, or --delays none.",
        )
    return {dof: int(samples) for dof, _, samples in parts}
