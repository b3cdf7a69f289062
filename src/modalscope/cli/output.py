"""Write results to the files that were asked for, or as JSON to stdout."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from pathlib import Path
from tempfile import mkstemp
from typing import TYPE_CHECKING, Any

from modalscope.cli.process import STDOUT
from modalscope.data import DataError, ModalModel
from modalscope.data.results import Result
from modalscope.io.atomic import MARK, PENDING, check_target, is_ours, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from modalscope.checking.certificate import Certificate

_PAGES = (".html", ".htm")

#: Suffixes of data, and of pictures.
DATA = (".uff", ".unv", ".npz", ".mat", ".h5", ".hdf5", ".csv")
PICTURES = (".png", ".svg", ".pdf")

_KNOWN = (".json", ".csv", ".uff", ".unv", *_PAGES, ".npz", ".h5", ".hdf5", ".mat")


def is_page(path: Path) -> bool:
    """Whether a report is written there, not modes alone."""
    return path.suffix.lower() in _PAGES


def check_outputs(options: argparse.Namespace, sources: Iterable[Path], known: tuple[str, ...] = _KNOWN) -> None:
    """Refuse names that cannot be written before the work is done, not after it; without an output there is nothing to write."""
    for path in options.outputs:
        if str(path) != STDOUT:
            check_output(path, sources, options.force, known)
        elif ".json" not in known:
            raise DataError("JSON on stdout was asked", f"this is written as {', '.join(known)}", "Name a file.")


def check_output(path: Path, sources: Iterable[Path], force: bool, known: tuple[str, ...] = _KNOWN) -> None:
    """Refuse a name that cannot be written: a source is never overwritten, a file that modalscope did not write only with --force."""
    if path.suffix.lower() not in known:
        raise DataError(
            f"writing {path.name} was asked", f"this is written as {', '.join(known)}", "Choose one of these suffixes."
        )
    target = check_target(path, tuple(sources))
    if not target.parent.is_dir():
        what = f"there is no folder {target.parent}"
        raise DataError(f"writing {str(path)!r} was asked", what, "Name a file in a folder that is there.")
    if not force and target.exists() and target.stat().st_size and not is_ours(target):
        raise DataError(
            f"writing {str(path)!r} was asked",
            "that file is there, and modalscope did not write it",
            "Choose another name, or say --force.",
        )


def write_outputs(
    options: argparse.Namespace, found: Any, source: str, certificate: Certificate | None = None, **beside: Any
) -> list[str]:
    """Write what was found to every output and return what is to be said of each; JSON for stdout is printed when all files are there.

    `options`: `outputs`, and the `command_line` that a report repeats. `source`: where the data came from. `certificate`: shown in a
    report. `**beside`: written into JSON beside modes.
    """
    told = []
    for path in (path for path in options.outputs if str(path) != STDOUT):
        if is_page(path):
            from modalscope.reporting import report

            report(found, path, source=source, command=options.command_line, certificate=certificate)
            told.append(f"written: {path}")
        else:
            told.append(_write(path, found, source, beside))
    if STDOUT in map(str, options.outputs):
        print(_document(found, source, beside))
    return told


def _document(found: Any, source: str, beside: dict[str, Any]) -> str:
    """Return what a JSON file would hold."""
    handle, name = mkstemp(suffix=".json")
    os.close(handle)
    place = Path(name)
    PENDING.add(place)
    try:
        _write(place, found, source, beside)
        return place.read_text(encoding="utf-8")
    finally:
        place.unlink()
        PENDING.discard(place)


def needed(options: argparse.Namespace, example: str) -> None:
    """Raise where a command that has nothing to say without a file was given none."""
    if not options.outputs:
        raise DataError("a file to write is needed", "there is no -o", f"Add for instance -o {example}.")


def write_picture(path: Path, axes: Axes) -> str:
    """Write a picture with the mark of the program, and return what is to be said of it."""
    from matplotlib.figure import Figure

    figure = axes.figure
    assert isinstance(figure, Figure)
    where = {".png": "Software", ".svg": "Creator", ".pdf": "Creator"}[path.suffix.lower()]
    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix.lower()[1:], dpi=150, metadata={where: MARK}, bbox_inches="tight")
    return f"written: {path}"


def write_data(path: Path, data: Any) -> str:
    """Write data and return what is to be said of the file."""
    from modalscope.data.shown import summary_of
    from modalscope.io import write

    write(path, data)
    return f"written: {path}, {summary_of(data)}{left_out(path, data)}"


def _write(path: Path, found: Any, source: str, beside: dict[str, Any]) -> str:
    """Write modes, in JSON with the analysis or what was found beside them."""
    from modalscope.io import write

    modes = getattr(found, "modes", found)
    if isinstance(found, Result) or path.suffix.lower() != ".json":
        write(path, found if isinstance(found, Result) else modes)
    else:
        write(path, modes, **{"data": {"file": Path(source).name}, **beside})
    return f"written: {path}{left_out(path, modes)}"


def left_out(path: Path, thing: Any) -> str:
    """Say what a format cannot hold of modes; nothing for other things and formats."""
    if not isinstance(thing, ModalModel) or path.suffix.lower() not in (".uff", ".unv"):
        return ""
    return "\nuniversal files hold poles and shapes: participation, spreads, indicators and reasons are left out (.json keeps them)"
