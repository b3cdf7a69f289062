"""Write results to the output files, or as JSON to stdout."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from tempfile import mkstemp
from typing import TYPE_CHECKING, Any

from modalscope.data import DataError, ModalModel, StabilizationDiagram
from modalscope.data.results import Result
from modalscope.interfaces.cli.process import STDOUT, progress
from modalscope.io.atomic import MARK, PENDING, check_target, is_ours, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from modalscope.analysis.checking.certificate import Certificate

#: Suffixes of reports, data, pictures and results.
PAGES = (".html", ".htm", ".docx", ".pptx")
DATA = (".uff", ".unv", ".npz", ".mat", ".h5", ".hdf5", ".csv")
PICTURES = (".png", ".svg", ".pdf")
_RESULTS = (".json", ".csv", ".uff", ".unv", ".xlsx", *PAGES, ".npz", ".h5", ".hdf5", ".mat")


def check_outputs(
    options: argparse.Namespace, sources: Iterable[Path], suffixes: tuple[str, ...] = _RESULTS, example: str = ""
) -> None:
    """Raise for output names that cannot be written, before the work is done; with an example, for none, too."""
    if example and not options.outputs:
        raise DataError("this command writes a file", "no -o was given", f"Add for instance -o {example}.")
    for path in options.outputs:
        if str(path) != STDOUT:
            check_output(path, sources, options.force, suffixes)
        elif ".json" not in suffixes:
            raise DataError("JSON on stdout:", f"the formats are {', '.join(suffixes)}", "Name a file.")


def check_output(path: Path, sources: Iterable[Path], force: bool, suffixes: tuple[str, ...] = _RESULTS) -> None:
    """Raise for a name that cannot be written: never overwrite a source, and only with --force a file of another program."""
    asked = f"writing {str(path)!r}:"
    if path.suffix.lower() not in suffixes:
        raise DataError(asked, f"the formats are {', '.join(suffixes)}", "Choose one of these suffixes.")
    target = check_target(path, tuple(sources))
    if not target.parent.is_dir():
        raise DataError(asked, f"there is no folder {target.parent}", "Name a file in an existing folder.")
    if not force and target.exists() and target.stat().st_size and not is_ours(target):
        fault = "the file exists and modalscope did not write it"
        raise DataError(asked, fault, "Choose another name, or use --force.")


def write_outputs(
    options: argparse.Namespace, result: Any, certificate: Certificate | None = None, record: Any = None, **fields: Any
) -> list[str]:
    """Write a result to every output file, print JSON for stdout, and return a message per file.

    `options`: `files`, `outputs`, and the `command_line` of the report. `certificate`, `record`: for the report. `**fields`: written into
    JSON with the modes.
    """
    source = ", ".join(map(str, options.files))
    fields = {"data": {"file": Path(source).name}, **fields}
    named = [path for path in options.outputs if str(path) != STDOUT]
    reported = {"source": source, "certificate": certificate, "data": record}
    messages = [write_file(options, path, result, fields, **reported) for path in named]
    if STDOUT in map(str, options.outputs):
        with progress("writing"):
            document = _document(result, fields)
        print(document)
    return messages


def write_file(options: argparse.Namespace, path: Path, result: Any, fields: dict[str, Any], **reported: Any) -> str:
    """Write a result to one file, a report or data, and return the message; `reported`: what a report takes besides."""
    with progress(f"writing {path.name}"):
        if path.suffix.lower() not in PAGES:
            return _write(path, result, fields)
        from modalscope.interfaces.reporting import report

        header = getattr(options, "header", None)
        report(result, path, command=options.command_line, header=header, **reported)
        return f"written: {path}"


def _document(result: Any, fields: dict[str, Any]) -> str:
    """Return the text of the JSON file."""
    handle, name = mkstemp(suffix=".json")
    os.close(handle)
    place = Path(name)
    PENDING.add(place)
    try:
        _write(place, result, fields)
        return place.read_text(encoding="utf-8")
    finally:
        place.unlink()
        PENDING.discard(place)


def write_picture(path: Path, draw: Callable[..., Axes], *given: Any, **options: Any) -> str:
    """Draw a picture, write it with the mark of the program, and return the message."""
    from matplotlib.figure import Figure

    where = {".png": "Software", ".svg": "Creator", ".pdf": "Creator"}[path.suffix.lower()]
    with progress(f"drawing {path.name}"), replacing(path) as temporary:
        figure = draw(*given, **options).figure
        assert isinstance(figure, Figure)
        figure.savefig(temporary, format=path.suffix.lower()[1:], dpi=150, metadata={where: MARK}, bbox_inches="tight")
    return f"written: {path}"


def write_pictures(
    options: argparse.Namespace, modes: ModalModel, diagrams: Sequence[StabilizationDiagram]
) -> list[str]:
    """Write the pictures of a result, named after its first output, and return a message per file.

    `options`: `files`, `outputs`, `pictures` (a suffix or None), `force`.
    """
    if options.pictures is None:
        return []
    from modalscope.interfaces.plot.gallery import pictures_of
    from modalscope.interfaces.plot.on_axes import painted

    named = [path for path in options.outputs if str(path) != STDOUT]
    if not named:
        asked = "--pictures names its files after an output"
        raise DataError(asked, "no -o was given", "Add for instance -o report.html.")
    messages = []
    for name, picture in pictures_of(modes, diagrams).items():
        path = named[0].with_name(f"{named[0].stem}_{name}.{options.pictures}")
        check_output(path, options.files, options.force, PICTURES)
        messages.append(write_picture(path, painted, picture))
    return messages


def write_data(path: Path, data: Any) -> str:
    """Write data and return the message."""
    from modalscope.data.shown import summary_of
    from modalscope.io import write

    with progress(f"writing {path.name}"):
        write(path, data)
    return f"written: {path}, {summary_of(data)}{_loss(path, data)}"


def _write(path: Path, result: Any, fields: dict[str, Any]) -> str:
    """Write a result or its modes, in JSON with the fields, and return the message."""
    from modalscope.io import write

    modes = getattr(result, "modes", result)
    more = fields if path.suffix.lower() == ".json" and not isinstance(result, Result) else {}
    write(path, result if isinstance(result, Result) else modes, **more)
    return f"written: {path}{_loss(path, modes)}"


def _loss(path: Path, data: Any) -> str:
    """Return what a universal file does not store of modes."""
    if not isinstance(data, ModalModel) or path.suffix.lower() not in (".uff", ".unv"):
        return ""
    return "\nuniversal files store poles and shapes only: participation, spreads, indicators and reasons are left out (use .json)"
