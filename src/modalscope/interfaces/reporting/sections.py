"""Write the sections on diagrams, shapes, reasons and responses, each of one band if there are several."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.rebuilt import band_of
from modalscope.data.response import Response
from modalscope.data.shown import frequency, percent
from modalscope.identification.identify import Identification
from modalscope.interfaces.plot.web.alive import Drawing, alive_blob, front_end
from modalscope.interfaces.plot.web.fits import Fit, Lines
from modalscope.interfaces.plot.web.modes import modes_parts
from modalscope.interfaces.reporting.figures import (
    fit_errors_svg,
    mac_svg,
    response_svg,
    shape_svg,
    singular_values_svg,
    stabilization_svg,
)
from modalscope.interfaces.reporting.html import (
    Section,
    figure,
    folded,
    heading,
    listing,
    numbered,
    paragraph,
    table,
    value,
)
from modalscope.numerics.checks import Array, BoolArray, RealArray
from modalscope.selection.judging.description import described
from modalscope.signals.preprocess.singular_spectra import Decomposition

#: Maximum rows and columns of a table of channels.
_MAX_TABLE_ROWS, _MAX_TABLE_COLUMNS = 40, 12

#: Maximum number of drawn channels.
_MAX_CHANNELS = 4

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
    """Return every band of the diagrams, one a band."""
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
    yield Section(
        "explore",
        "Interactive results",
        f'{paragraph(lead, "muted")}<style>{_ALIVE_STYLE}{style}</style><div id="alive"></div>'
        f'<script id="alive-data" type="application/octet-stream">{data}</script>'
        f'<script id="alive-script">{script.replace("</script", "<" + chr(92) + "/script")}</script>',
    )


def stabilization_section(
    diagram: StabilizationDiagram, modes: ModalModel, spectra: Decomposition | None = None
) -> Section:
    """Draw the diagram with the selected modes over the mode indicator or given spectra, singular values and the misfit of every order.

    `modes`: of all bands; those inside are drawn, by the numbers that they have in every table and picture.
    """
    curves = "the singular values of the spectra" if spectra is not None else "the mode indicator"
    caption = f"Poles of all orders over {curves}; lines mark the selected modes."
    if diagram.tolerances:
        tolerances = ", ".join(
            f"MAC above {1 - limit:.3g}" if name == "shape" else f"{name} within {percent(limit)}"
            for name, limit in diagram.tolerances.items()
        )
        caption += f" Marks state what agrees with a pole of the previous order. Tolerances: {tolerances}."
    body = figure(stabilization_svg(diagram, modes, spectra, "Stabilization diagram with the selected modes"), caption)
    pictures = singular_values_picture(diagram.singular_values, diagram.orders)
    if len(diagram.orders) > 1:
        caption = (
            "Unexplained part at each order, outputs scaled to the same level: beyond the knee, more states fit noise."
        )
        pictures += figure(fit_errors_svg(diagram, "Unexplained part at each order"), caption)
    body += f'<div class="pair">{pictures}</div>' if pictures else ""
    return Section("stabilization", "Stabilization", body)


def singular_values_picture(values: RealArray, orders: Sequence[int]) -> str:
    """Draw the singular values of the data matrix, if there are several."""
    title = "Singular values of the data matrix"
    caption = f"{title}: a gap indicates the number of significant states."
    return figure(singular_values_svg(values, orders, title), caption) if values.size > 1 else ""


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
    drawn = singular_values_picture(identified.singular_values, (identified.order,))
    return Section("model", "Model", listing(facts.items()) + (f'<div class="narrow">{drawn}</div>' if drawn else ""))


def mode_pictures(
    modes: ModalModel,
    drawn: Mapping[str, Array] | None = None,
    holds: BoolArray | None = None,
    *,
    points: ModalModel | None = None,
) -> Iterator[Section]:
    """Yield the mode shapes and their AutoMAC, as far as there are modes; a single point has one number, 1, for a shape.

    `drawn`: the arrays of `modes_parts`, if they are known. `holds`: as in `grades`. `points`: as of `over_points`.
    """
    points = modes if points is None else points
    if len(points.output_dofs) < 2:
        return
    drawn = modes_parts(modes, {}, points=points)[1] if drawn is None else drawn
    if len(modes):
        pictures = "".join(
            figure(
                shape_svg(points, i, drawn, f"Shape of mode {i + 1}"),
                f"Mode {each.number}: {each.frequency} Hz, damping {each.damping} %, {each.grade}, MPC {each.mpc}",
            )
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
        yield Section(
            "mac", "AutoMAC", f'{paragraph(lead)}<div class="narrow">{figure(mac_svg(points, "AutoMAC"))}</div>'
        )


def reasons_section(modes: ModalModel) -> Section:
    """List a sentence per mode, and the other fields of its reasons as a table."""
    shown = {"text", *modes.indicators, "indicators", "frequency_spread_hz", "damping_ratio_spread"}
    keys = list(dict.fromkeys(key for reason in modes.reasons for key in reason if key not in shown))
    pairs = list(zip(modes.frequencies, modes.reasons, strict=True))
    body = ""
    if any("text" in reason for reason in modes.reasons):
        body += numbered((frequency(f), str(reason.get("text", ""))) for f, reason in pairs)
    if keys:
        rows = [
            [str(i + 1), f"{f:.5g}", *(value(key, reason.get(key)) for key in keys)]
            for i, (f, reason) in enumerate(pairs)
        ]
        figures = table(["mode", "frequency [Hz]", *map(heading, keys)], rows)
        body += folded("All values behind these sentences", figures) if body else figures
    return Section("reasons", "Reasons for each mode", body)


def left_out_section(modes: ModalModel) -> Section:
    """List the candidates that are not reported: significance, reason and remedy."""
    rows = [
        [
            f"{candidate.frequency:.5g}",
            f"{100 * candidate.damping_ratio:.3g}",
            "" if candidate.gain != candidate.gain else f"{candidate.gain:.1f}",
            candidate.reason,
            candidate.remedy,
        ]
        for candidate in modes.left_out
    ]
    columns = ["frequency [Hz]", "damping [%]", "significance", "reason", "remedy"]
    return Section("left-out", "Candidates left out", table(columns, rows, words=(3, 4)))


def responses_section(response: Response, fit: Fit, lines: Lines | None) -> Section:
    """Draw the channels of largest, median and smallest misfit, and list what is unexplained of every channel."""
    title = "Measured and rebuilt responses"
    if fit is None or lines is None:
        return Section(
            "responses", title, paragraph("Responses cannot be rebuilt: the participation of the modes is not known.")
        )
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
    coherence, of_channel = response.coherence, None
    if coherence is not None and len(coherence) == len(lines.frequencies):
        each = coherence.reshape(*coherence.shape[:2], -1)
        of_channel = each[:, i, min(j, each.shape[2] - 1)]
    words = f"Output {response.output_dofs[i]}, {response.column_word} {response.columns[j]}"
    drawn = response_svg(lines, i, j, of_channel, f"{words}, measured and rebuilt")
    return figure(drawn, f"{words}: {percent(error)} unexplained")


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
    if len(ranked) > _MAX_TABLE_ROWS:
        caption += f"; the largest {_MAX_TABLE_ROWS} of {len(ranked)}"
    rows = [
        [response.output_dofs[i], response.columns[j], f"{100 * errors[i, j]:.3g}"] for i, j in ranked[:_MAX_TABLE_ROWS]
    ]
    return table(["output", response.column_word, "unexplained [%]"], rows, words=[0, 1], caption=caption)
