"""A whole report: which sections it has, and its way to the disk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import date
from pathlib import Path

from modalscope.comparing import Comparison
from modalscope.io.atomic import replacing
from modalscope.modal.rebuilt import fit_error, rebuilt
from modalscope.model import DataError, ModalModel, StabilizationDiagram
from modalscope.model.checks import check_path
from modalscope.model.response import Response
from modalscope.model.version import VERSION
from modalscope.reporting import record, sections
from modalscope.reporting.comparison import comparison_sections
from modalscope.reporting.html import Section, page

__all__ = ["identification_sections", "report", "report_modes", "write_page"]


def report(
    thing: tuple[ModalModel, StabilizationDiagram] | Comparison,
    path: str | Path,
    *,
    title: str | None = None,
    source: str | None = None,
    command: str | None = None,
) -> Path:
    """Write what was found as one self-contained HTML file, pictures included; nothing is asked from outside.

    Parameters
    ----------
    thing : (ModalModel, StabilizationDiagram) or Comparison
        Selected modes and the diagram that they were selected from; or a comparison of methods.
    path : path
        Ends in .html. An earlier file is replaced only by a complete new one.
    title, source, command : str, optional
        Heading, where the data came from, and the command line that gave the result.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    DataError
        Something else than modes with their diagram or a comparison, another suffix, or a file that cannot be written.
    """
    if isinstance(thing, Comparison):
        heading = title or (f"Methods compared on {Path(source).name}" if source else "Methods compared")
        parts = comparison_sections(thing, source=source, command=command)
        return write_page(path, heading, _subtitle(thing.response), parts)
    if isinstance(thing, tuple) and len(thing) == 2:
        modes, diagram = thing if isinstance(thing[0], ModalModel) else thing[::-1]
        if isinstance(modes, ModalModel) and isinstance(diagram, StabilizationDiagram):
            return report_modes(path, modes=modes, diagram=diagram, title=title, source=source, command=command)
    raise DataError(
        "a report was asked",
        f"it was given {type(thing).__name__}",
        "Give the pair (modes, diagram), modes = select(diagram), or a comparison.",
    )


def report_modes(
    path: str | Path,
    *,
    modes: ModalModel,
    diagram: StabilizationDiagram,
    title: str | None = None,
    source: str | None = None,
    command: str | None = None,
) -> Path:
    """Write the report on one identification; see `report`."""
    heading = title or (f"Modes of {Path(source).name}" if source else "Modal identification")
    parts = identification_sections(modes, diagram, source=source, command=command)
    return write_page(path, heading, _subtitle(diagram.response), parts)


def identification_sections(
    modes: ModalModel, diagram: StabilizationDiagram, *, source: str | None = None, command: str | None = None
) -> Iterator[Section]:
    """Give the sections on one identification in the order of reading, each drawn when it is asked for."""
    response = diagram.response
    fit = None if modes.participation is None else fit_error(response.values, rebuilt(response, modes))
    yield sections.summary_section(modes, diagram, fit)
    yield sections.modes_section(modes)
    yield sections.stabilization_section(diagram, modes)
    if len(modes):
        yield sections.shapes_section(modes)
    if len(modes) > 1:
        yield sections.mac_section(modes)
    yield sections.responses_section(modes, response, fit)
    if modes.reasons:
        yield sections.reasons_section(modes)
    yield record.data_section(response, source)
    yield record.settings_section(diagram)
    yield record.notes_section(diagram)
    yield record.repeat_section(diagram, source, command)


def _subtitle(response: Response) -> str:
    counts = f"{len(response.output_dofs)} outputs, {len(response.input_dofs)} inputs"
    return f"{counts}, {date.today().isoformat()}"


def write_page(path: str | Path, title: str, subtitle: str, parts: Iterable[Section]) -> Path:
    """Write sections as a page; an earlier file stays as it was until the new one is complete.

    Sections may come from a generator: a file that cannot be written is found before any picture is drawn.

    Raises
    ------
    DataError
        Another suffix than .html or .htm, or a file that cannot be written.
    """
    target = check_path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise DataError(f"a report in {target.name!r} was asked", "reports are HTML files", "End the name in .html.")
    with replacing(target) as temporary:
        text = page(title, subtitle, parts, f"written by modalscope {VERSION}")
        temporary.write_text(text, encoding="utf-8")
    return target
