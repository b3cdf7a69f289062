"""Interpret the files, reading options and choices of the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from modalscope.data import DataError, ModalModel, Note
from modalscope.data.shown import summary_of
from modalscope.interfaces.cli.parser import EXPERT, Parser, add_reading
from modalscope.interfaces.cli.process import progress, remark
from modalscope.io import set_max_memory, survey
from modalscope.io.contents import SeveralTests
from modalscope.io.options import TEXT

#: Options of `modalscope.io.read` that the command line has under the same names.
_READ_OPTIONS = ("quantity", "sampling_rate", "conjugate", "exact_nodes", *TEXT)


def read_data(options: argparse.Namespace, path: Path) -> tuple[Any, tuple[Note, ...]]:
    """Read a file with the options of the command line; return its data and the notes."""
    with progress("reading"):
        contents = survey(path, **reading_options(options, path))
    return contents.thing, contents.told


def read_test(options: argparse.Namespace) -> tuple[Any, tuple[Note, ...]]:
    """Read the files of one test, responses or records; return its data and the notes."""
    from modalscope.analysis.workflow.sources import opened

    with progress("reading"):
        data, _, notes = opened(options.files, [reading_options(options, path) for path in options.files])
    return data, notes


def read_parts(options: argparse.Namespace) -> tuple[list[Any], Callable[[], tuple[Any, tuple[Note, ...]]]]:
    """Read the files of one test; return what each holds, and what gives them together with the notes."""
    from modalscope.analysis.workflow.sources import merged_parts, opened_parts

    with progress("reading"):
        reading = [reading_options(options, path) for path in options.files]
        parts = opened_parts(options.files, reading)

    def merged() -> tuple[Any, tuple[Note, ...]]:
        data, _, notes = merged_parts(options.files, reading, parts, decays=False)
        return data, notes

    return [part for part, _, _ in parts], merged


def each_test(options: argparse.Namespace) -> list[tuple[str, argparse.Namespace]]:
    """Return every test of every file with its name, and the options of the command for it alone."""
    found = []
    for path in options.files:
        names: tuple[str, ...] = ("",)
        try:
            survey(path, **reading_options(options, path))
        except SeveralTests as several:
            names = several.names
        except DataError:  # said where it is used
            pass
        for name in names:
            alone = argparse.Namespace(**{**vars(options), "files": [path], "sheet": name or options.sheet})
            found.append((f"{path.name}, {name}" if name else path.name, alone))
    return found


def read_modes(options: argparse.Namespace, path: Path) -> ModalModel:
    """Read a file of modes, and print its notes."""
    modes, notes = read_data(options, path)
    remark(*notes)
    if not isinstance(modes, ModalModel):
        asked, contents = f"modes in {path}:", f"the file holds {summary_of(modes)}"
        raise DataError(asked, contents, "Give a file of modes, or identify them: modalscope identify.")
    return modes


def choices(options: argparse.Namespace) -> dict[str, Any]:
    """Return what a command is told of the identification as its keyword arguments: bands, channels, route, method, orders."""
    several = [options.band] if options.band and isinstance(options.band[0], float) else options.band or ()
    bands = [tuple(band) for band in several]
    told = vars(options)
    names = ("route", "reciprocal", "exclude", "method", "domain")
    given: dict[str, Any] = {name: told[name] for name in names if name in told}
    given |= {"orders": parse_orders(options.orders)} if "orders" in told else {}
    given |= {name: told[name] for name in EXPERT if told.get(name) is not None}
    given |= {name: parse_shifts(name, given[name]) for name in ("row_shifts", "column_shifts") if name in given}
    return {"band": bands[0] if len(bands) == 1 else bands or None, "delays": parse_delays(options.delays), **given}


def parse_shifts(name: str, text: str) -> list[int]:
    """Return `0,1,2,4` as whole numbers.

    Raises `DataError`: something else.
    """
    words = text.split(",")
    if not all(word.strip().isdecimal() for word in words):
        asked = f"--{name.replace('_', '-')} {text}:"
        raise DataError(asked, "shifts are whole numbers, 0 among them", "Write them as 0,1,2,4.")
    return [int(word) for word in words]


def reading_options(options: argparse.Namespace, path: Path) -> dict[str, Any]:
    """Return the options of `modalscope.io.read` for one of the files, and set the memory limit of the process."""
    usual = Parser(add_help=False)
    add_reading(usual)
    options = usual.parse_args([], argparse.Namespace(**vars(options)))  # of a command that has none the defaults
    set_max_memory(options.max_memory)
    values = {name: getattr(options, name) for name in _READ_OPTIONS}
    given: dict[str, Any] = {name: value for name, value in values.items() if value not in (None, False)}
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
    """Return the channel labels of one file: the single item, or that of the file."""
    if len(items) not in (1, len(files)):
        asked = f"--{name.replace('_', '-')} {' '.join(items)}:"
        remedy = "Give one item for all files or one per file, labels separated by commas."
        raise DataError(asked, f"these are {len(items)} items for {len(files)} files", remedy)
    return items[0 if len(items) == 1 else files.index(path)].split(",")


def _pairs(name: str, items: list[str], example: str) -> dict[str, str]:
    pairs = [item.partition("=") for item in items]
    for item, (old, sign, new) in zip(items, pairs, strict=True):
        if not (old and sign and new):
            asked, form = f"--{name} {item}:", "its form is NAME=VALUE"
            raise DataError(asked, form, f"Write for instance --{name} {example}.")
    return {old: new.replace(",", " ") for old, _, new in pairs}


def parse_orders(text: str | None) -> range | list[int] | None:
    """Return the range `2:60:2` or `2:60`, both ends included, or the orders up to `40`.

    Examples
    --------
    >>> parse_orders("2:10:4"), parse_orders("12")
    (range(2, 11, 4), [2, 4, 6, 8, 10, 12])
    """
    if text is None:
        return None
    from modalscope.identification.method import checked_orders

    if text.isdecimal():
        return checked_orders(int(text))
    try:
        parts = [int(part) for part in text.split(":")]
    except ValueError:
        parts = []
    first, last, step = {2: (*parts, 1), 3: tuple(parts)}.get(len(parts), (0, 0, 0))
    if not (1 <= first <= last and step >= 1):
        form = "their form is FIRST:LAST:STEP, FIRST at least 1"
        raise DataError(f"orders {text!r}:", form, "Write for instance --orders 2:60:2.")
    return range(first, last + 1, step)


def parse_delays(words: Sequence[str] | None) -> dict[str, int] | None:
    """Return the delays `y3=12 y4=12` in samples; `none` removes no delay.

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
        asked, form = f"delays {' '.join(words)!r}:", "their form is DOF=SAMPLES, in whole samples"
        raise DataError(asked, form, "Write for instance --delays y3=12 y4=12, or --delays none.")
    return {dof: int(samples) for dof, _, samples in parts}
