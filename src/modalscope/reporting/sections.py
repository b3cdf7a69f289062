"""Write the sections of a report on one identification or on several bands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.response import Response
from modalscope.identification.identify import Identification
from modalscope.identification.method_names import cell_label
from modalscope.modal.rebuilt import explained, explains_enough
from modalscope.numerics.checks import Array
from modalscope.plot.web.poles import Fit, band_of, fit_of, inside
from modalscope.preprocess.singular_spectra import Decomposition
from modalscope.reporting import record
from modalscope.reporting.figures import (
    fit_errors_svg,
    mac_svg,
    response_svg,
    shape_svg,
    singular_values_svg,
    stabilization_svg,
)
from modalscope.reporting.html import (
    Section,
    folded,
    frequency,
    heading,
    listing,
    numbered,
    paragraph,
    percent,
    picture,
    table,
    value,
)
from modalscope.reporting.modes import modes_section
from modalscope.reporting.record import identification_script

# -------------------------------------------------------------------------------------------------------------- banded
# The bands that a result was identified in, each with its diagram and the modes that lie in it.


@dataclass(frozen=True, eq=False, slots=True)
class Shown:
    """One band as a report shows it.

    `modes`: those that lie in the band. `number`: counted from 1. `words`: its ends.
    """

    diagram: StabilizationDiagram
    modes: ModalModel
    number: int
    words: str

    def named(self, section: Section, several: bool) -> Section:
        """Return a section with the band in its title, where there are several; the first keeps its anchor."""
        if not several:
            return section
        anchor = section.anchor if self.number == 1 else f"{section.anchor}-{self.number}"
        return replace(section, anchor=anchor, title=f"{section.title}, {self.words}")


def bands_of(modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> list[Shown]:
    """Return every band with its own modes; one band has all.

    `modes`: of all bands. `diagrams`: one a band.
    """
    found = []
    for k, diagram in enumerate(diagrams):
        low, high = band_of(diagram, len(diagrams))
        found.append(Shown(diagram, inside(modes, diagram, len(diagrams)), k + 1, f"{low:.4g} to {high:.4g} Hz"))
    return found


# ------------------------------------------------------------------------------------------------------------ sections

#: Rows of a table that a reader still takes in.
_ROWS = 40


def stabilization_section(
    diagram: StabilizationDiagram, modes: ModalModel, spectra: Decomposition | None = None
) -> Section:
    """Draw the diagram with the selected modes, over the spectra of the record where they are known, and the singular values behind it."""
    over = "the singular values of the record's spectra" if spectra is not None else "the mode indicator of the data"
    caption = f"Poles of every order over {over}; the selected modes are marked."
    if diagram.tolerances:
        caption += (
            " A letter says what agrees with a pole of the order before: s all, v frequency and shape vector, d frequency and damping, "
            f"f frequency alone, o nothing. {_limits(diagram)}"
        )
    drawn = stabilization_svg(diagram, modes, spectra)
    body = picture(drawn, f"Stabilization diagram with {len(modes)} selected modes", caption)
    beside = []
    if diagram.singular_values.size > 1:
        words = "Singular values of the data matrix: a step tells how many states stand out of the noise."
        beside.append(
            picture(
                singular_values_svg(diagram.singular_values, diagram.orders),
                "Singular values of the data matrix",
                words,
            )
        )
    if len(diagram.orders) > 1:
        words = "What every order leaves unexplained, its outputs brought to the same level: where it turns flat, more states fit noise."
        beside.append(picture(fit_errors_svg(diagram), "Fit error of every order", words))
    body += f'<div class="pair">{"".join(beside)}</div>' if beside else ""
    return Section("stabilization", "Stabilization", body)


def _limits(diagram: StabilizationDiagram) -> str:
    """Return the tolerances of stability in words."""
    told = [
        f"MAC above {1 - limit:.3g}" if name == "shape" else f"{name} within {percent(limit)}"
        for name, limit in diagram.tolerances.items()
    ]
    return f"Tolerances: {', '.join(told)}."


def mode_pictures(modes: ModalModel) -> Iterator[Section]:
    """Give shapes and their MAC, whatever of them there is."""
    if len(modes):
        yield shapes_section(modes)
    if len(modes) > 1:
        yield mac_section(modes)


def shapes_section(modes: ModalModel) -> Section:
    """Draw every mode shape."""
    pictures = [
        picture(shape_svg(modes, i), f"Shape of mode {i + 1}, {frequency(f)}") for i, f in enumerate(modes.frequencies)
    ]
    lead = paragraph(
        "Each turned to its best phase, drawn with its largest component 1; MPC 1 means that the turn hides nothing. In files: "
        f"{modes.scaling}.",
        "muted",
    )
    return Section("shapes", "Mode shapes", f'{lead}<div class="pair">{"".join(pictures)}</div>')


def mac_section(modes: ModalModel) -> Section:
    """Draw the MAC of the modes with each other."""
    lead = paragraph(
        "Likeness of the shapes: 1 equal, 0 orthogonal. High values off the diagonal: too few channels, or one mode twice."
    )
    return Section(
        "mac", "MAC", f'{lead}<div class="narrow">{picture(mac_svg(modes), "MAC matrix of the modes")}</div>'
    )


def reasons_section(modes: ModalModel) -> Section:
    """Why each mode is reported, whatever the reasons hold: a sentence a mode, and the other fields as a table."""
    shown = {"text", *modes.indicators, "indicators", "frequency_spread_hz", "damping_ratio_spread"}
    keys = list(dict.fromkeys(key for reason in modes.reasons for key in reason if key not in shown))
    each = list(zip(modes.frequencies, modes.reasons, strict=True))
    body = ""
    if any("text" in reason for reason in modes.reasons):
        body += numbered((frequency(f), str(reason.get("text", ""))) for f, reason in each)
    rows = [
        [str(i + 1), f"{f:.5g}", *(value(key, reason.get(key)) for key in keys)] for i, (f, reason) in enumerate(each)
    ]
    if keys:
        figures = table(["mode", "frequency [Hz]", *(heading(key) for key in keys)], rows)
        body += folded("All figures behind these sentences", figures) if body else figures
    return Section("reasons", "Why each mode", body)


def left_out_section(modes: ModalModel) -> Section:
    """What looked like a mode and is not reported: gain in deviations, the reason, and what would bring it in."""
    rows = [
        [
            f"{each.frequency:.5g}",
            f"{100 * each.damping_ratio:.3g}",
            "" if each.gain != each.gain else f"{each.gain:.1f}",
            each.reason,
            each.remedy,
        ]
        for each in modes.left_out
    ]
    columns = ["frequency [Hz]", "damping [%]", "gain [deviations]", "why not", "what to do"]
    return Section("left-out", "What was left out", table(columns, rows, words=(3, 4)))


def responses_section(modes: ModalModel, response: Response, fit: Fit) -> Section:
    """Draw the channels that fit worst and best, and list the fit error of every channel."""
    title = "Measured against rebuilt"
    if fit is None:
        return Section(
            "responses",
            title,
            paragraph("The participation of the modes is not known, so that responses cannot be rebuilt."),
        )
    errors = fit[1]
    ranked = [
        divmod(int(k), errors.shape[1]) for k in np.argsort(-np.nan_to_num(errors, nan=-1.0), axis=None, kind="stable")
    ]
    known = [(i, j) for i, j in ranked if np.isfinite(errors[i, j])]
    chosen = known if len(known) <= 4 else [known[0], known[1], known[len(known) // 2], known[-1]]
    pictures = []
    for i, j in chosen:
        words = f"Output {response.output_dofs[i]}, {response.column_word} {response.columns[j]}, measured and rebuilt"
        pictures.append(picture(response_svg(response, modes, i, j), words))
    lead = (
        "All channels."
        if len(known) <= 4
        else "The two channels that fit worst, the one in the middle and the one that fits best."
    )
    body = f'{paragraph(lead, "muted")}<div class="pair">{"".join(pictures)}</div>'
    return Section("responses", title, body + _error_table(response, errors, ranked))


def _error_table(response: Response, errors: Array, ranked: list[tuple[int, int]]) -> str:
    """Outputs by inputs where that fits on a page, else the worst channels one below the other."""
    outputs, inputs = errors.shape
    largest = float(np.nanmax(errors, initial=0.0)) or 1.0
    caption = "Fit error |measured - rebuilt| / |measured| of each channel, %"
    if outputs <= _ROWS and inputs <= 12:
        cells = [[f"{100 * e:.2f}" if np.isfinite(e) else "–" for e in row] for row in errors]
        shades = [[0.0, *(0.75 * min(e / largest, 1.0) if np.isfinite(e) else 0.0 for e in row)] for row in errors]
        rows = [[dof, *row] for dof, row in zip(response.output_dofs, cells, strict=True)]
        return table(
            [f"output \\ {response.column_word}", *response.columns], rows, words=[0], shades=shades, caption=caption
        )
    if len(ranked) > _ROWS:
        caption += f"; the worst {_ROWS} of {len(ranked)}"
    rows = [[response.output_dofs[i], response.columns[j], f"{100 * errors[i, j]:.3g}"] for i, j in ranked[:_ROWS]]
    return table(["output", response.column_word, "fit error [%]"], rows, words=[0, 1], caption=caption)


# ------------------------------------------------------------------------------------------------------ identification
# The sections of a report on one identification: one method at one order, with its model.


def identification_sections(
    found: Identification, *, source: str | None = None, command: str | None = None
) -> Iterator[Section]:
    """Give the sections on one identification in the order of reading, each drawn when it is asked for."""
    modes, response = found.modes, found.response
    fit = fit_of(modes, response) if len(modes) else None
    yield _summary(found)
    yield modes_section(modes)
    yield _model(found)
    yield from mode_pictures(modes)
    yield responses_section(modes, response, fit)
    yield record.data_section(response, source)
    yield Section("settings", "Settings", listing(_settings(found).items()))
    yield record.notes_section(found.notes)
    yield record.repeat_section(identification_script(found, source), command)


def _summary(found: Identification) -> Section:
    low, high = found.response.span
    modes = found.modes
    count = f"{len(modes)} mode{'' if len(modes) == 1 else 's'}"
    verdict = f"{count} between {low:.5g} and {high:.5g} Hz, by {cell_label(found.method, found.domain)}, order {found.order}."
    body = paragraph(verdict, "verdict")
    enough = explains_enough(found.fit_error)
    # real and unstable poles of the model count here, selected modes alone would not
    body += paragraph(explained(found.fit_error).replace("modes explain", "whole model explains", 1)) if enough else ""
    body = body if enough else paragraph(explained(found.fit_error), "loud") + body
    odd = [f"mode {i + 1} is {kind}" for i, kind in enumerate(modes.kinds) if kind != "mode"]
    body += paragraph("; ".join(odd)) if odd else ""
    body += paragraph("One order alone cannot tell modes from noise: stabilize and select do.", "muted")
    return Section("summary", "Summary", body)


def _model(found: Identification) -> Section:
    """The state-space model, what is left over in a canonical form, and the singular values that the order was cut from."""
    model = found.state_space
    stable = np.all(model.poles.real < 0) if model.dt is None else np.all(np.abs(model.poles) < 1)
    facts = {
        "states": str(model.A.shape[0]),
        "order": f"{found.order}, the rank of the truncation",
        "kind": "continuous" if model.dt is None else f"sampled every {model.dt:.6g} s",
        "stable": "yes" if stable else "no",
        "fit error": percent(found.fit_error),
    }
    if len(found.extraneous):
        facts["extraneous poles"] = f"{len(found.extraneous)}: beyond the rank, told apart by their amplitude"
    body = listing(facts.items())
    if found.singular_values.size > 1:
        words = "Singular values of the data matrix: a step tells how many states stand out of the noise."
        drawn = singular_values_svg(found.singular_values, (found.order,))
        body += f'<div class="narrow">{picture(drawn, "Singular values of the data matrix", words)}</div>'
    return Section("model", "Model", body)


def _settings(found: Identification) -> dict[str, str]:
    cell = {"method": cell_label(found.method, found.domain), "domain": found.domain, "order": str(found.order)}
    return cell | record.settings_listed(found.settings)
