"""Assemble a report and write it to a file."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Protocol

from modalscope.checking.certificate import Certificate
from modalscope.comparing import Comparison
from modalscope.data import DataError, ModalModel, Signals, StabilizationDiagram
from modalscope.data.analysis import VERSION
from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.results import Result
from modalscope.doctor import Finding
from modalscope.identification.identify import Identification
from modalscope.identification.method_names import cell_label
from modalscope.io.atomic import replacing
from modalscope.io.formats import sources_of
from modalscope.judging.select import select
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_kind, check_path
from modalscope.plot.web.alive import alive_blob, front_end
from modalscope.plot.web.poles import fit_of, fit_of_bands
from modalscope.preprocess.singular_spectra import Decomposition, decomposition
from modalscope.reporting import record, sections
from modalscope.reporting.comparison import comparison_sections
from modalscope.reporting.grades import grades
from modalscope.reporting.html import Section, page, paragraph
from modalscope.reporting.modes import certificate_section, intervals_section, modes_section, summary_section
from modalscope.reporting.record import result_script, stabilization_script
from modalscope.reporting.sections import Shown, bands_of, identification_sections

# --------------------------------------------------------------------------------------------------------------- alive
# The part of a report that moves: the front end of the page and its data, in the file itself; without scripts it is not there.

#: What is only there where scripts run, and never on paper.
_STYLE = """body:not(.alive) #explore, body:not(.alive) a[href="#explore"] { display: none; }
@media print { #explore { display: none; } }"""


def alive_section(
    modes: ModalModel, *diagrams: StabilizationDiagram, spectra: Decomposition | None = None
) -> Iterator[Section]:
    """Give the section that moves, where there are modes and the front end was built with the package.

    Nothing that a user wrote stands in it as markup: labels are in the data, which are base64.

    `spectra`: of a record without inputs: what stands behind the poles.
    """
    script, style = front_end("viewer.js"), front_end("viewer.css")
    if script is None or style is None or not len(modes):
        return
    data = base64.b64encode(alive_blob(modes, *diagrams, spectra=spectra)).decode("ascii")
    lead = paragraph(
        "Drag to zoom, double-click for the whole; choose a mode in the table or a channel of the curve.", "muted"
    )
    yield Section(
        "explore",
        "Look closer",
        f'{lead}<style>{_STYLE}{style}</style><div id="alive"></div>'
        f'<script id="alive-data" type="application/octet-stream">{data}</script>'
        f'<script id="alive-script">{script.replace("</script", "<" + chr(92) + "/script")}</script>',
    )


# ------------------------------------------------------------------------------------------------------------ document


class _Result(Protocol):
    """What has selected modes and the diagram that they were selected from."""

    @property
    def modes(self) -> ModalModel: ...

    @property
    def diagram(self) -> StabilizationDiagram: ...


Reported = Comparison | Identification | StabilizationDiagram | tuple[ModalModel, StabilizationDiagram] | _Result


@named()
def report(
    thing: Reported,
    path: str | Path,
    *,
    title: str | None = None,
    source: str | None = None,
    command: str | None = None,
    certificate: Certificate | None = None,
) -> Path:
    """Write a report on modes, a diagram, an identification or a comparison: one HTML file, pictures included.

    Nothing is asked from outside: the file can be sent to anybody and read without a network.

    Parameters
    ----------
    thing : StabilizationDiagram, (ModalModel, StabilizationDiagram), Identification, Comparison or any result with modes and diagram
        A diagram, whose modes are selected automatically; or with its selected modes; one order; or a comparison of methods.
    path : path
        Ends in .html. An earlier file is replaced only by a complete new one.
    title, source, command : str, optional
        Heading, where the data came from, and the command line that gave the result.
    certificate : Certificate, optional
        Of a result: whether its intervals hold; the modes are shown with its deviations.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    DataError
        Something that has neither modes nor a diagram, another suffix, or a file that cannot be written.
    """
    if source is not None:
        check_kind("source of a report", source, (str, Path))
        source = str(source)
    for name, text in (("title", title), ("command", command)):
        check_kind(f"{name} of a report", "" if text is None else text, str)
    if isinstance(thing, Comparison):
        heading = title or _heading("Methods compared", " on ", source)
        parts = comparison_sections(thing, source=source, command=command)
        return write_page(path, heading, _subtitle(thing.response), parts, sources_of(thing))
    if isinstance(thing, Identification):
        heading = title or _heading(f"{cell_label(thing.method, thing.domain)}, order {thing.order}", ": ", source)
        parts = identification_sections(thing, source=source, command=command)
        return write_page(path, heading, _subtitle(thing.response), parts, sources_of(thing))
    origin = Origin(source, command)
    if isinstance(thing, Result):
        if thing.analysis.apart:
            raise DataError(
                "a report on setups that were identified apart was asked",
                "a report shows one stabilization diagram",
                "Write .json or .csv, report on the setups together (apart=False), or on each by itself.",
            )
        files = [file.path for file in thing.analysis.files if file.path]
        known = source or ", ".join(files) or None
        origin = Origin(
            known, command, thing.findings, thing.notes, result_script(thing), data=thing.data, diagrams=thing.diagrams
        )
    modes, diagram = _selected(thing)
    if certificate is not None:
        check_kind("certificate of report", certificate, Certificate)
        modes, origin = certificate.modes, replace(origin, certificate=certificate)
    heading = title or _heading("Modes" if origin.source else "Modal identification", " of ", origin.source)
    parts = stabilization_sections(modes, diagram, origin)
    return write_page(path, heading, _subtitle(diagram.response), parts, (*sources_of(thing), *sources_of(diagram)))


def _selected(thing: object) -> tuple[ModalModel, StabilizationDiagram]:
    """Return modes and diagram: the pair in either order, of a result, or those that a diagram shows."""
    if isinstance(thing, StabilizationDiagram):
        return select(thing), thing
    pair = thing if isinstance(thing, tuple) else (getattr(thing, "modes", None), getattr(thing, "diagram", None))
    if len(pair) == 2:
        modes, diagram = pair if isinstance(pair[0], ModalModel) else pair[::-1]
        if isinstance(modes, ModalModel) and isinstance(diagram, StabilizationDiagram):
            return modes, diagram
    raise DataError(
        "a report was asked",
        f"it was given {type(thing).__name__}",
        "Give a diagram (of stabilize), the pair (modes, diagram) with modes = select(diagram), an identification, or a comparison.",
    )


def _heading(what: str, joint: str, source: str | None) -> str:
    return f"{what}{joint}{Path(source).name}" if source else what


@dataclass(frozen=True, eq=False, slots=True)
class Origin:
    """Where a result came from, and what is told of it beside the diagram's own.

    `source`, `command`: the file, and the command line that was typed. `findings`, `notes`, `script`: of the whole analysis; by default
    those of the diagram. `data`: what was measured: of ambient records the spectra stand behind the diagram. `diagrams`: of every band,
    where there are several.
    """

    source: str | None = None
    command: str | None = None
    findings: Sequence[Finding] | None = None
    notes: Sequence[Note] | None = None
    script: str | None = None
    certificate: Certificate | None = None
    data: object = None
    diagrams: Sequence[StabilizationDiagram] = ()

    @property
    def spectra(self) -> Decomposition | None:
        """Singular values of the spectra of a record without inputs; None of all else."""
        record = self.data
        return decomposition(record) if isinstance(record, Signals) and record.inputs is None else None


def stabilization_sections(modes: ModalModel, diagram: StabilizationDiagram, origin: Origin) -> Iterator[Section]:
    """Give the sections on a diagram and its modes in the order of reading, each drawn when it is asked for."""
    response, judged = diagram.response, grades(modes, origin.certificate)
    shown = bands_of(modes, origin.diagrams if len(origin.diagrams) > 1 else (diagram,))
    several = len(shown) > 1
    fit = fit_of_bands(modes, [each.diagram for each in shown])
    yield summary_section(modes, [each.diagram for each in shown], fit, band=_bands(shown), judged=judged)
    spectra = origin.spectra
    yield from alive_section(modes, *(each.diagram for each in shown), spectra=spectra)
    yield modes_section(modes, judged)
    if len(modes):
        yield intervals_section(modes)
    if origin.certificate is not None:
        yield certificate_section(origin.certificate)
    for each in shown:
        yield each.named(sections.stabilization_section(each.diagram, each.modes, spectra), several)
    yield from sections.mode_pictures(modes)
    for each in shown:
        own = fit_of(each.modes, each.diagram.response) if several else fit
        yield each.named(sections.responses_section(each.modes, each.diagram.response, own), several)
    if modes.reasons:
        yield sections.reasons_section(modes)
    if modes.left_out:
        yield sections.left_out_section(modes)
    yield record.data_section(response, origin.source, origin.findings, origin.data)
    for each in shown:
        yield each.named(record.settings_section(each.diagram), several)
    yield record.notes_section(diagram.notes if origin.notes is None else origin.notes, diagram.kinds)
    yield record.repeat_section(origin.script or stabilization_script(diagram, origin.source), origin.command)


def _bands(shown: Sequence[Shown]) -> str:
    """Return the band that was asked, or the bands, in words."""
    if len(shown) > 1:
        return f"Identified in {len(shown)} bands: {', '.join(each.words for each in shown)}."
    asked = getattr(shown[0].diagram.settings, "band", None)
    return (
        "No band was asked: all of the data was used."
        if asked is None
        else f"Band asked: {asked[0]:g} to {asked[1]:g} Hz."
    )


def _subtitle(response: Response) -> str:
    sides = ((len(response.output_dofs), "output"), (len(response.input_dofs), response.column_word))
    counts = ", ".join(f"{count} {word}{'' if count == 1 else 's'}" for count, word in sides)
    return f"{counts}, {date.today().isoformat()}"


def write_page(
    path: str | Path, title: str, subtitle: str, parts: Iterable[Section], sources: Iterable[Path] = ()
) -> Path:
    """Write sections as a page; an earlier file stays as it was until the new one is complete.

    Sections may come from a generator: a file that cannot be written is found before any picture is drawn. The sources, which the
    data came from, are never overwritten.

    Raises `DataError`: another suffix than .html or .htm, or a file that cannot be written.
    """
    target = check_path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise DataError(f"a report in {target.name!r} was asked", "reports are HTML files", "End the name in .html.")
    with replacing(target, sources) as temporary:
        text = page(title, subtitle, parts, f"written by modalscope {VERSION}")
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
    return target
