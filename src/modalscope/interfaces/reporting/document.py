"""Assemble a report and write it to a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from itertools import chain, takewhile
from pathlib import Path
from typing import Any

from modalscope.analysis.checking.certificate import Certificate
from modalscope.analysis.comparing import Comparison
from modalscope.analysis.monitoring.store import Store
from modalscope.analysis.planning.next_measurement import next_measurement
from modalscope.data import DataError, ModalModel, Signals, StabilizationDiagram, StateSpace
from modalscope.data.analysis import VERSION
from modalscope.data.notes import Note
from modalscope.data.rebuilt import fit_error
from modalscope.data.records import Records
from modalscope.data.response import Response
from modalscope.data.results import Result
from modalscope.data.shown import counted
from modalscope.identification.identify import Identification
from modalscope.identification.method_names import cell_label
from modalscope.interfaces.plot.web.alive import drawing_of, selected
from modalscope.interfaces.plot.web.fits import rebuilt_lines
from modalscope.interfaces.reporting import record, sections
from modalscope.interfaces.reporting.comparison import comparison_sections
from modalscope.interfaces.reporting.header import header_of, header_of_remarks, header_sections
from modalscope.interfaces.reporting.html import Section, page, paragraph
from modalscope.interfaces.reporting.modes import (
    certificate_section,
    identification_summary,
    intervals_section,
    modes_section,
    summary_section,
)
from modalscope.interfaces.reporting.simulations import model_sections
from modalscope.io.atomic import replacing
from modalscope.io.formats import sources_of
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_kind, check_path
from modalscope.numerics.plugins import REPORTS, added, names_added
from modalscope.selection.judging.grades import grades
from modalscope.signals.doctor import Finding
from modalscope.signals.preprocess.singular_spectra import Decomposition, decomposition

Reported = Result | StabilizationDiagram | Identification | Comparison | StateSpace | Store


@named()
def report(
    thing: Reported | tuple[ModalModel, StabilizationDiagram],
    path: str | Path,
    *,
    title: str | None = None,
    source: str | None = None,
    command: str | None = None,
    certificate: Certificate | None = None,
    data: Signals | Records | None = None,
    header: str | Path | Mapping[str, Any] | None = None,
) -> Path:
    """Write a report on modes, a diagram, an identification, a comparison, a model or months of records: one HTML file with its pictures.

    The file loads nothing from outside and can be read without a network.

    Parameters
    ----------
    thing : StabilizationDiagram, (ModalModel, StabilizationDiagram), Identification, Comparison, StateSpace, Store, result with a diagram
        A diagram, whose modes are selected automatically; or with its selected modes; one order; a comparison of methods; a model, with
        `data`; or a store of months of records.
    path : path
        Ends in .html; or in .docx or .pptx for a document or slides, which need the extra `office`, of modes with a diagram. An existing
        file is replaced only by a complete new one.
    title, source, command : str, optional
        Heading, source of the data, and the command line that gave the result.
    certificate : Certificate, optional
        Of a result: whether its intervals hold; the modes are reported with its standard deviations.
    data : Signals or Records, optional
        With inputs: what a model is simulated beside.
    header : path or mapping, optional
        What a customer's report says first, as a .toml file or its entries; by default remarks of the analysis such as `project: P-22`.
        `project`, `structure`, `operator`, `date` and any others; `sensors`, a table each with `channel`, `sensor`, `serial`,
        `sensitivity`, `calibrated`; `conclusion`; `title`, the heading.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    DataError
        An object without modes or diagram, another suffix, or a file that cannot be written.
    """
    if source is not None:
        check_kind("source of a report", source, (str, Path))
        source = str(source)
    for name, text in (("title", title), ("command", command)):
        check_kind(f"{name} of a report", "" if text is None else text, str)
    if isinstance(thing, Store):
        from modalscope.interfaces.reporting.months import months_sections

        return write_page(path, title or thing.path.name, "Months of records", months_sections(thing), [thing.path])
    if isinstance(thing, StateSpace):
        check_kind("data of a report on a model", data, (Signals, Records))
        assert data is not None
        heading = title or _heading("State-space model", " of ", source)
        parts = model_sections(thing, data, command)
        return write_page(path, heading, date.today().isoformat(), parts, sources_of(data))
    if isinstance(thing, Comparison):
        heading = title or _heading("Methods compared", " on ", source)
        parts = comparison_sections(thing, source=source, command=command)
        return write_page(path, heading, _subtitle(thing.response), parts, sources_of(thing))
    if isinstance(thing, Identification):
        heading = title or _heading(f"{cell_label(thing.method, thing.domain)}, order {thing.order}", ": ", source)
        parts = identification_sections(thing, source, command)
        return write_page(path, heading, _subtitle(thing.response), parts, sources_of(thing))
    remarks = thing.analysis.remarks if isinstance(thing, Result) else ()
    head = header_of_remarks(remarks) if header is None else header_of(header)
    origin = _origin(thing, source, command) if isinstance(thing, Result) else Origin(source, command)
    modes, (diagram, *_) = selected(thing, "a report")
    if certificate is not None:
        check_kind("certificate of report", certificate, Certificate)
        modes, origin = certificate.modes, replace(origin, certificate=certificate)
    what = "Modes" if origin.source else "Modal identification"
    heading = title or head.get("title") or _heading(what, " of ", origin.source)
    sources = (*sources_of(thing), *sources_of(diagram))
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix in names_added(REPORTS):
        with replacing(path, sources) as temporary:
            added(REPORTS, suffix)(temporary, heading, _subtitle(diagram.response), modes, diagram, origin)
        return Path(path)
    parts = chain(header_sections(head), stabilization_sections(modes, diagram, origin))
    return write_page(path, heading, _subtitle(diagram.response), parts, sources)


def _heading(what: str, joint: str, source: str | None) -> str:
    return f"{what}{joint}{_name_of_test(source.split(', '))}" if source else what


def _name_of_test(files: Sequence[str]) -> str:
    """Return the name of a file; of several what their names have in common, or their folder, and how many they are."""
    places = [Path(file) for file in files]
    if len(places) == 1:
        return places[0].name
    letters = zip(*(place.stem for place in places), strict=False)
    same = "".join(each[0] for each in takewhile(lambda each: len(set(each)) == 1, letters))
    common = same.rstrip(" _-.0123456789")
    folder = places[0].resolve().parent.name
    return f"{common if len(common) > 2 else folder} ({len(places)} files)"


@dataclass(frozen=True, eq=False, slots=True)
class Origin:
    """The origin of a result.

    `source`, `command`: the file, and the command line. `findings`, `notes`, `script`: of the whole analysis; by default those of the
    diagram. `data`: the measurement; the spectra of ambient records are drawn behind the diagram. `diagrams`: of all bands, if several.
    `names`: what the user calls modes, by their frequencies. `plan`: what to measure next, a line each, where that can be told.
    """

    source: str | None = None
    command: str | None = None
    findings: Sequence[Finding] | None = None
    notes: Sequence[Note] | None = None
    script: str | None = None
    certificate: Certificate | None = None
    data: object = None
    diagrams: Sequence[StabilizationDiagram] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    plan: Sequence[str] = ()

    @property
    def spectra(self) -> Decomposition | None:
        """Singular values of the spectra of a record without inputs; else None."""
        record = self.data
        return decomposition(record) if isinstance(record, Signals) and record.inputs is None else None


def _origin(result: Result, source: str | None, command: str | None) -> Origin:
    if result.analysis.apart:
        remedy = "Write .json or .csv, report on the setups together (apart=False), or on each by itself."
        raise DataError("a report shows one diagram", "setups identified apart have one each", remedy)
    source = source or ", ".join(file.path for file in result.analysis.files if file.path) or None
    script = record.result_script(result)
    told = {"data": result.data, "diagrams": result.diagrams, "names": result.analysis.names}
    try:
        told["plan"] = str(next_measurement(result)).split("\n")
    except DataError:  # of ambient records, several bands or modes without intervals nothing can be told
        told["plan"] = ()
    return Origin(source, command, result.findings, result.notes, script, **told)


def stabilization_sections(modes: ModalModel, diagram: StabilizationDiagram, origin: Origin) -> Iterator[Section]:
    """Yield the sections on a diagram and its modes in the order of reading, each drawn when it is asked for."""
    holds = None if origin.certificate is None else origin.certificate.holds
    judged = grades(modes, holds)
    bands = sections.bands_of(origin.diagrams if len(origin.diagrams) > 1 else (diagram,))
    diagrams, several, spectra = [band.diagram for band in bands], len(bands) > 1, origin.spectra
    drawing = drawing_of(modes, *diagrams, spectra=spectra, holds=holds)
    yield summary_section(modes, diagrams, drawing.fit, band=_limits(bands), judged=judged)
    yield from sections.alive_section(drawing)
    yield modes_section(modes, holds, origin.names)
    if len(modes):
        yield intervals_section(modes)
    if origin.certificate is not None:
        yield certificate_section(origin.certificate)
    yield sections.stabilization_section(diagrams, modes, spectra)
    yield from sections.mode_pictures(modes, holds, points=drawing.points)
    for band in bands:
        band_fit, band_lines = drawing.fit, drawing.lines
        if several and drawing.fit is not None:
            band_lines = rebuilt_lines(modes, band.diagram, len(bands))
            band_fit = fit_error(band_lines.measured, band_lines.rebuilt)
        yield band.named(sections.responses_section(band.diagram.response, band_fit, band_lines), several)
    if any("text" in reason for reason in modes.reasons):
        yield sections.reasons_section(modes)
    if modes.left_out:
        yield sections.left_out_section(modes)
    if origin.plan:
        yield Section("next", "What to measure next", "".join(map(paragraph, origin.plan)))
    yield record.data_section(diagram.response, origin.source, origin.findings, origin.data)
    for band in bands:
        orders = {"orders": record.orders_listed(band.diagram.orders)}
        yield band.named(record.settings_section(band.diagram, orders), several)
    yield record.notes_section(origin.notes or (*modes.notes, *diagram.notes), diagram.kinds)
    yield record.repeat_section(origin.script or record.stabilization_script(diagram, origin.source), origin.command)


def _limits(bands: Sequence[sections.Band]) -> str:
    """Return a sentence on the bands."""
    if len(bands) > 1:
        return f"Identified in {len(bands)} bands: {', '.join(band.words for band in bands)}."
    limits = getattr(bands[0].diagram.settings, "band", None)
    return "Band: full range." if limits is None else f"Band: {limits[0]:g} to {limits[1]:g} Hz."


def identification_sections(identified: Identification, source: str | None, command: str | None) -> Iterator[Section]:
    """Yield the sections on one identification in the order of reading, each drawn when it is asked for."""
    modes, response = identified.modes, identified.response
    yield identification_summary(identified)
    yield modes_section(modes)
    yield sections.model_section(identified)
    yield from sections.mode_pictures(modes)
    yield sections.all_responses(modes, response)
    yield record.data_section(response, source)
    yield record.settings_section(identified, {"order": str(identified.order)})
    yield record.notes_section(identified.notes)
    yield record.repeat_section(record.identification_script(identified, source), command)


def _subtitle(response: Response) -> str:
    outputs = counted(len(response.output_dofs), "output")
    return f"{outputs}, {counted(len(response.input_dofs), response.column_word)}, {date.today().isoformat()}"


def write_page(
    path: str | Path, title: str, subtitle: str, parts: Iterable[Section], sources: Iterable[Path] = ()
) -> Path:
    """Write sections as a page; an existing file is unchanged until the new one is complete.

    The target is checked before a generator of sections draws its first picture. The sources of the data are never overwritten.

    Raises `DataError`: another suffix than .html or .htm, or a file that cannot be written.
    """
    target = check_path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        formats = "reports are .html files, of results also .docx and .pptx"
        raise DataError(f"a report in {target.name!r}:", formats, "End the name in .html.")
    with replacing(target, sources) as temporary:
        text = page(title, subtitle, parts, f"written by modalscope {VERSION}")
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
    return target
