"""Results written where the user asked for them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from modalscope.io.atomic import check_target
from modalscope.io.marks import is_ours
from modalscope.model import DataError, ModalModel
from modalscope.model.result import Result

__all__ = ["check_output", "is_page", "left_out", "write_modes", "write_page", "write_result"]

_PAGES = (".html", ".htm")
_KNOWN = (".json", ".csv", ".uff", ".unv", *_PAGES, ".npz", ".h5", ".hdf5", ".mat")


def is_page(path: Path) -> bool:
    """Whether a report is written there, not modes alone."""
    return path.suffix.lower() in _PAGES


def check_output(options: argparse.Namespace, *sources: Path) -> None:
    """Refuse a name that cannot be written before the work is done, not after it; without an output there is nothing to write.

    A source is never overwritten, and a file that modalscope did not write only with --force.
    """
    path = options.output
    if path is None:
        return
    if path.suffix.lower() not in _KNOWN:
        raise DataError(
            f"writing {path.name} was asked",
            f"results are written as {', '.join(_KNOWN)}",
            "Choose one of these suffixes.",
        )
    target = check_target(path, sources)
    if not target.parent.is_dir():
        what = f"there is no folder {target.parent}"
        raise DataError(f"writing {str(path)!r} was asked", what, "Name a file in a folder that is there.")
    if not options.force and target.exists() and target.stat().st_size and not is_ours(target):
        raise DataError(
            f"writing {str(path)!r} was asked",
            "that file is there, and modalscope did not write it",
            "Choose another name, or say --force.",
        )


def write_page(options: argparse.Namespace, result: Any, **more: Any) -> str:
    """Write a report with the command that repeats it, and say where."""
    from modalscope.reporting import report

    report(result, options.output, source=str(options.file), command=options.command_line, **more)
    return f"written: {options.output}"


def write_result(options: argparse.Namespace, result: Result) -> str:
    """Write the modes of a result, in JSON with its analysis, and say where and what the format leaves out."""
    from modalscope.io import write

    write(options.output, result)
    return f"written: {options.output}{left_out(options.output, result.modes)}"


def write_modes(options: argparse.Namespace, modes: ModalModel, **found: Any) -> str:
    """Write modes, in JSON with what was `found` beside them, and say where and what the format leaves out."""
    from modalscope.io import write

    beside = {**found, "data": {"file": options.file.name}} if options.output.suffix.lower() == ".json" else {}
    write(options.output, modes, **beside)
    return f"written: {options.output}{left_out(options.output, modes)}"


def left_out(path: Path, thing: Any) -> str:
    """Say what a format cannot hold of modes; nothing for other things and formats."""
    if not isinstance(thing, ModalModel) or path.suffix.lower() not in (".uff", ".unv"):
        return ""
    return "\nuniversal files hold poles and shapes: participation, spreads, indicators and reasons are left out (.json keeps them)"
