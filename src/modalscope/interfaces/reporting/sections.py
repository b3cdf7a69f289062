"""Write the sections on diagrams, shapes, reasons and responses, each of one band if there are several."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.rebuilt import band_of
from modalscope.data.response import Response
from modalscope.data.shown import figures, frequency, percent
from modalscope.identification.identify import Identification
from modalscope.interfaces.plot.diagrams import fit_errors_picture, singular_values_picture, stabilization_picture
from modalscope.interfaces.plot.matrices import mac_picture
from modalscope.interfaces.plot.picture import unit_of
from modalscope.interfaces.plot.responses import coherence_of, lines_picture, title_of
from modalscope.interfaces.plot.shapes import shape_picture
from modalscope.interfaces.plot.web.alive import Drawing, alive_blob, front_end
from modalscope.interfaces.plot.web.fits import Fit, Lines, fit_of, lines_of_response
from modalscope.interfaces.reporting.html import Section, figure, listing, numbered, paragraph, table
from modalscope.numerics.checks import Array, BoolArray, RealArray
from modalscope.selection.judging.description import described
from modalscope.signals.preprocess.singular_spectra import Decomposition

#: Maximum rows and columns of a table of channels.
_MAX_TABLE_ROWS, _MAX_TABLE_COLUMNS = 40, 12

#: Maximum number of drawn channels.
_MAX_CHANNELS = 4

#: Pixels of a picture as wide as the page.
_WIDE = (900, 500)

#: The interactive section needs scripts; it is hidden without them and on paper.
_ALIVE_STYLE = """body:not(.alive) #explore, body:not(.alive) a[href="#explore"] { display: none; }
@media print { #explore { display: none; } }"""


@dataclass(frozen=True, eq=False, slots=True)
class Band:
    """One band of a report; `number`: counted from 1, `words`: its limits."""

    diagram: StabilizationDiagram
    number: int
    words: str

    def named(self, section: Section, several: bool) -> Section:
        """Return a section with the band in its title if there are several; the first keeps its anchor."""
        if not several:
            return section
        anchor = section.anchor if self.number == 1 else f"{section.anchor}-{self.number}"
        return replace(section, anchor=anchor, title=f"{section.title}, {self.words}")


def bands_of(diagrams: Sequence[StabilizationDiagram]) -> list[Band]:
    """Return every band of the diagrams, one per band."""
    bands = []
    for k, diagram in enumerate(diagrams):
        low, high = band_of(diagram, len(diagrams))
        bands.append(Band(diagram, k + 1, f"{low:.4g} to {high:.4g} Hz"))
    return bands


def alive_section(drawing: Drawing) -> Iterator[Section]:
    """Yield the interactive section, if there are modes and the package has its front end.

    Labels of the user are in the data, which are base64, never in the markup.
    """
    script, style = front_end("viewer.js"), front_end("viewer.css")
    if script is None or style is None or not len(drawing.modes):
        return
    data = base64.b64encode(zlib.compress(alive_blob(drawing), 6)).decode("ascii")
    lead = "Drag to zoom, double-click for the full range; select a mode in the table or a channel of the response."
    body = (
        f'{paragraph(lead, "muted")}<style>{_ALIVE_STYLE}{style}</style><div id="alive"></div>'
        f'<script id="alive-data" type="application/octet-stream">{data}</script>'
        f'<script id="alive-script">{script.replace("</script", "<" + chr(92) + "/script")}</script>'
    )
    yield Section("explore", "Interactive results", body)


def stabilization_section(
    diagrams: Sequence[StabilizationDiagram], modes: ModalModel, spectra: Decomposition | None = None
) -> Section:
    """Draw one diagram of all bands with the selected modes, over the mode indicator or given spectra.

    Below are the singular values and what is unexplained at each order, of every band.
    """
    diagram = diagrams[0]
    curves = "the singular values of the spectra" if spectra is not None else "the mode indicator"
    caption = f"Poles of all orders over {curves}; lines mark the selected modes."
    if diagram.tolerances:
        tolerances = ", ".join(
            f"MAC above {1 - limit:.3g}" if name == "shape" else f"{name} within {percent(limit)}"
            for name, limit in diagram.tolerances.items()
        )
        caption += f" Marks state what agrees with a pole of the previous order. Tolerances: {tolerances}."
    body = figure(stabilization_picture(diagrams, modes, spectra=spectra), caption, *_WIDE)
    pictures = "".join(_of_orders(band, f"{band.words}: " if len(diagrams) > 1 else "") for band in bands_of(diagrams))
    body += f'<div class="pair">{pictures}</div>' if pictures else ""
    return Section("stabilization", "Stabilization", body)


def _of_orders(band: Band, lead: str) -> str:
    """Draw singular values and the misfit of every order of a band, as far as there are several."""
    diagram = band.diagram
    pictures = singular_values_figure(diagram.singular_values, diagram.orders, lead)
    if len(diagram.orders) > 1:
        words = (
            "unexplained part at each order, outputs scaled to the same level: beyond the knee, more states fit noise."
        )
        pictures += figure(fit_errors_picture(diagram), capitalized(f"{lead}{words}"))
    return pictures


def singular_values_figure(values: RealArray, orders: Sequence[int], lead: str = "") -> str:
    """Draw the singular values of the data matrix, if there are several."""
    if values.size < 2:
        return ""
    picture = singular_values_picture(values, most=max(orders, default=20))
    words = "singular values of the data matrix: a gap indicates the number of significant states."
    return figure(picture, capitalized(f"{lead}{words}"))


def capitalized(words: str) -> str:
    """Return a sentence with its first letter large."""
    return words[:1].upper() + words[1:]


def model_section(identified: Identification) -> Section:
    """Describe the state-space model, its extraneous poles and the singular values of the data matrix."""
    model = identified.state_space
    stable = np.all(model.poles.real < 0) if model.dt is None else np.all(np.abs(model.poles) < 1)
    facts = {
        "states": str(model.A.shape[0]),
        "order": f"{identified.order}, the rank of the truncation",
        "kind": "continuous" if model.dt is None else f"sampled every {model.dt:.6g} s",
        "stable": "yes" if stable else "no",
        "unexplained": percent(identified.fit_error),
    }
    if len(identified.extraneous):
        facts["extraneous poles"] = f"{len(identified.extraneous)}, beyond the rank; identified by their amplitude"
    drawn = singular_values_figure(identified.singular_values, (identified.order,))
    return Section("model", "Model", listing(facts.items()) + (f'<div class="narrow">{drawn}</div>' if drawn else ""))


def mode_pictures(
    modes: ModalModel, holds: BoolArray | None = None, *, points: ModalModel | None = None
) -> Iterator[Section]:
    """Yield the mode shapes and their AutoMAC, as far as there are modes; a single point has one number, 1, for a shape.

    `holds`: as in `grades`. `points`: as of `over_points`.
    """
    points = modes if points is None else points
    if len(points.output_dofs) < 2:
        return
    if len(modes):
        bars = points.geometry is None and points.shapes_std is not None
        pictures = "".join(
            figure(shape_picture(points, i, std=bars), f"Mode {each.number}: {each.grade}, {each.reason}", height=280)
            for i, each in enumerate(described(modes, holds))
        )
        over = "" if points is modes else "Over the points that were driven, by reciprocity. "
        lead = (
            f"{over}Each shape is turned in phase until its imaginary part is smallest; its real part is drawn, largest component 1. "
            f"At MPC 1 nothing else is left. In files: {modes.scaling}."
        )
        yield Section("shapes", "Mode shapes", f'{paragraph(lead, "muted")}<div class="pair">{pictures}</div>')
    if len(modes) > 1:
        lead = "Similarity of the shapes: 1 equal, 0 orthogonal. High values off the diagonal: too few channels, or a duplicate mode."
        drawn = figure(mac_picture(points), width=600)
        yield Section("mac", "AutoMAC", f'{paragraph(lead)}<div class="narrow">{drawn}</div>')


def reasons_section(modes: ModalModel) -> Section:
    """List a sentence per mode."""
    pairs = zip(modes.frequencies, modes.reasons, strict=True)
    body = numbered((frequency(f), str(reason.get("text", ""))) for f, reason in pairs)
    return Section("reasons", "Reasons for each mode", body)


def left_out_section(modes: ModalModel) -> Section:
    """List the candidates that are not reported: significance, reason and remedy."""
    rows = []
    for c in modes.left_out:
        significance = "" if c.gain != c.gain else f"{c.gain:.1f}"
        rows.append([f"{c.frequency:.5g}", figures(100 * c.damping_ratio), significance, c.reason, c.remedy])
    columns = ["frequency [Hz]", "damping [%]", "significance", "reason", "remedy"]
    return Section("left-out", "Candidates left out", table(columns, rows, words=(3, 4)))


def all_responses(modes: ModalModel, response: Response) -> Section:
    """Return the section on the responses of one band that modes rebuild."""
    fit = fit_of(modes, response) if len(modes) else None
    return responses_section(response, fit, None if fit is None else lines_of_response(modes, response))


def responses_section(response: Response, fit: Fit, lines: Lines | None) -> Section:
    """Draw the channels of largest, median and smallest misfit, and list what is unexplained of every channel."""
    title = "Measured and rebuilt responses"
    if fit is None or lines is None:
        why = "Responses cannot be rebuilt: the participation of the modes is not known."
        return Section("responses", title, paragraph(why))
    errors = fit[1]
    order = np.argsort(-np.nan_to_num(errors, nan=-1.0), axis=None, kind="stable")
    ranked = [divmod(int(k), errors.shape[1]) for k in order]
    drawn = [(i, j) for i, j in ranked if np.isfinite(errors[i, j])]
    lead = "All channels."
    if len(drawn) > _MAX_CHANNELS:
        drawn = [drawn[0], drawn[1], drawn[len(drawn) // 2], drawn[-1]]
        lead = "The channels with the two largest, the median and the smallest unexplained part."
    pictures = "".join(_channel(response, lines, i, j, errors[i, j]) for i, j in drawn)
    body = f'{paragraph(lead, "muted")}<div class="pair">{pictures}</div>'
    return Section("responses", title, body + _error_table(response, errors, ranked))


def _channel(response: Response, lines: Lines, i: int, j: int, error: float) -> str:
    """Draw one channel, with its coherence where that is known on the lines drawn."""
    known = response.coherence is not None and len(response.coherence) == len(lines.frequencies)
    coherence = coherence_of(response.coherence, i, j) if known and response.coherence is not None else None
    sides = lines.measured[:, i, j], lines.rebuilt[:, i, j]
    unit, title = unit_of(response.picture(), i, j), title_of(response, i, j)
    picture = lines_picture(lines.frequencies, *sides, coherence, unit, title)
    return figure(picture, f"{percent(error)} unexplained", height=350)


def _error_table(response: Response, errors: Array, ranked: list[tuple[int, int]]) -> str:
    """Return a table of outputs by inputs where it fits on a page, else a list by descending misfit."""
    outputs, inputs = errors.shape
    caption = "Unexplained part of each channel, |measured - rebuilt| / |measured|, %"
    if outputs <= _MAX_TABLE_ROWS and inputs <= _MAX_TABLE_COLUMNS:
        largest = float(np.nanmax(errors, initial=0.0)) or 1.0
        shades = [[0.0, *(0.75 * min(e / largest, 1.0) if np.isfinite(e) else 0.0 for e in row)] for row in errors]
        rows = [
            [dof, *(f"{100 * e:.2f}" if np.isfinite(e) else "–" for e in row)]
            for dof, row in zip(response.output_dofs, errors, strict=True)
        ]
        head = [f"output \\ {response.column_word}", *response.columns]
        return table(head, rows, words=[0], shades=shades, caption=caption)
    listed = ranked[:_MAX_TABLE_ROWS]
    caption += f"; the largest {len(listed)} of {len(ranked)}" if len(ranked) > len(listed) else ""
    rows = [[response.output_dofs[i], response.columns[j], figures(100 * errors[i, j])] for i, j in listed]
    return table(["output", response.column_word, "unexplained [%]"], rows, words=[0, 1], caption=caption)
