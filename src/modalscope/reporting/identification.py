"""The sections of a report on one identification: one method at one order, with its model."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modalscope.identification.identify import Identification
from modalscope.identification.lookup import cell_label
from modalscope.modal.explained import explained, explains_enough
from modalscope.plot.web.fits import fit_of
from modalscope.reporting import record, sections
from modalscope.reporting.figures import singular_values_svg
from modalscope.reporting.html import Section, listing, paragraph, picture
from modalscope.reporting.modes import modes_section
from modalscope.reporting.numbers import percent
from modalscope.reporting.scripts import identification_script

__all__ = ["identification_sections"]


def identification_sections(
    found: Identification, *, source: str | None = None, command: str | None = None
) -> Iterator[Section]:
    """Give the sections on one identification in the order of reading, each drawn when it is asked for."""
    modes, response = found.modes, found.response
    fit = fit_of(modes, response) if len(modes) else None
    yield _summary(found)
    yield modes_section(modes)
    yield _model(found)
    yield from sections.mode_pictures(modes)
    yield sections.responses_section(modes, response, fit)
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
