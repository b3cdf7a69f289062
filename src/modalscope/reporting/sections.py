"""The sections of a report on one identification; a comparison adds its own."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modalscope.identification.lookup import cell_label
from modalscope.modal.explained import explained, explains_enough
from modalscope.modal.rebuilt import fit_error, rebuilt
from modalscope.model import ModalModel, StabilizationDiagram
from modalscope.model.checks import Array
from modalscope.model.mode_table import told
from modalscope.model.response import Response
from modalscope.reporting.figures import (
    fit_errors_svg,
    mac_svg,
    response_svg,
    shape_svg,
    singular_values_svg,
    stabilization_svg,
)
from modalscope.reporting.html import Section, numbered, paragraph, picture, table
from modalscope.reporting.numbers import decimals, frequency, heading, percent, value

__all__ = [
    "Fit",
    "fit_of",
    "left_out_section",
    "loud",
    "mac_section",
    "mode_pictures",
    "modes_section",
    "reasons_section",
    "responses_section",
    "shapes_section",
    "stabilization_section",
    "summary_section",
]

#: Fit error in all and per channel (l, m), or None when the modes cannot be rebuilt.
Fit = tuple[float, Array] | None

#: Rows of a table that a reader still takes in.
_ROWS = 40

#: What the indicators say, for readers who meet them for the first time.
_WORDS = {
    "amplitude_coherence": "amplitude coherence: how well the mode evolves as one pole must (1 best)",
    "emac": "emac: extended modal amplitude coherence, over outputs and inputs (1 best)",
    "emaco": "emaco: the same over outputs alone",
    "mpc": "mpc: modal phase collinearity, 1 when all points move in phase or in opposition",
    "cmi": "cmi: consistent mode indicator, emac times mpc",
    "msv": "msv: modal singular value, share of the mode in the response (largest 1)",
    "mpd": "mpd: mean phase deviation of the shape in degrees (0 best)",
}


def summary_section(modes: ModalModel, diagram: StabilizationDiagram, fit: Fit) -> Section:
    """The verdict: how many modes where, how much they explain, and which is the least sure."""
    low, high = band_of(diagram.response)
    count = f"{len(modes)} mode{'' if len(modes) == 1 else 's'}"
    orders = f"orders {diagram.orders[0]} to {diagram.orders[-1]}" if diagram.orders else "no order"
    verdict = f"{count} between {low:.5g} and {high:.5g} Hz, by {cell_label(diagram.method, diagram.domain)}, {orders}."
    if fit is not None and explains_enough(fit[0]):
        verdict += f" {explained(fit[0])}"
    odd = [f"mode {i + 1} is {kind}" for i, kind in enumerate(modes.kinds) if kind != "mode"]
    body = (
        loud(fit)
        + paragraph(verdict, "verdict")
        + "".join(paragraph(text) for text in (_least_sure(modes), "; ".join(odd)) if text)
    )
    return Section("summary", "Summary", body)


def fit_of(modes: ModalModel, response: Response) -> Fit:
    """Return what the modes leave of the data, in all and per channel; None when they cannot be rebuilt."""
    return None if modes.participation is None else fit_error(response.values, rebuilt(response, modes))


def loud(fit: Fit) -> str:
    """Return the warning that the modes explain too little, set off; nothing where they explain enough."""
    return "" if fit is None or explains_enough(fit[0]) else paragraph(explained(fit[0]), "loud")


def _least_sure(modes: ModalModel) -> str:
    """Name the mode whose damping scatters most over the orders, relative to its value."""
    spread, zeta = modes.damping_ratios_spread, modes.damping_ratios
    if spread is None or not len(modes):
        return ""
    share = np.divide(spread, np.abs(zeta), out=np.full(len(modes), np.nan), where=zeta != 0)
    if not np.any(np.isfinite(share)):
        return ""
    worst = int(np.nanargmax(share))
    where = f"mode {worst + 1} at {frequency(modes.frequencies[worst])}"
    return f"Least sure is {where}: its damping scatters by {percent(share[worst], 2)} of its value over the orders."


def band_of(response: Response) -> tuple[float, float]:
    """Return the lowest and the highest frequency of the data."""
    return response.span


def modes_section(modes: ModalModel) -> Section:
    """The table of modes: frequency, damping, spreads, standard deviations, indicators."""
    digits = decimals(modes.frequencies)
    columns: dict[str, list[str]] = {"mode": [str(i + 1) for i in range(len(modes))]}
    for name, title, scale, places in (
        ("frequencies", "frequency [Hz]", 1.0, digits),
        ("damping_ratios", "damping [%]", 100.0, 3),
    ):
        columns[title] = [f"{scale * v:.{places}f}" for v in getattr(modes, name)]
        for suffix, word in (
            ("spread", "spread"),
            ("std", "± noise"),
            ("repeatability", "± repeatability"),
        ):
            found = getattr(modes, f"{name}_{suffix}")
            if found is not None:
                columns[f"{word} {title[title.index('[') :]}{' ' * (name == 'damping_ratios')}"] = [
                    told(scale * v) for v in found
                ]
    if any(kind != "mode" for kind in modes.kinds):
        columns["kind"] = list(modes.kinds)
    for name, values in modes.indicators.items():
        columns[name.replace("_", " ")] = [f"{v:.3f}" if np.isfinite(v) else "–" for v in values]
    known = [_WORDS[name] for name in modes.indicators if name in _WORDS]
    words = [i for i, name in enumerate(columns) if name == "kind"]
    body = table([name.strip() for name in columns], zip(*columns.values(), strict=True), words=words)
    if modes.frequencies_spread is not None:
        known = ["spread: standard deviation over the orders at which the mode was found", *known]
    body += paragraph(f"{'; '.join(known)}.", "muted") if known else ""
    return Section("modes", "Modes", body)


def stabilization_section(diagram: StabilizationDiagram, modes: ModalModel) -> Section:
    """Draw the diagram with the selected modes, and the singular values behind it."""
    limits = ", ".join(f"{name} {value(name, limit)}" for name, limit in diagram.tolerances.items())
    caption = "Poles of every order over the mode indicator of the data; the selected modes are marked."
    if limits:
        caption += f" Stable: agrees with a pole of the order before within {limits} (relative; shape as 1 - MAC)."
    body = picture(
        stabilization_svg(diagram, modes), f"Stabilization diagram with {len(modes)} selected modes", caption
    )
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


def mode_pictures(modes: ModalModel, response: Response, fit: Fit) -> Iterator[Section]:
    """Give shapes, their MAC and the rebuilt responses, whatever of them there is."""
    if len(modes):
        yield shapes_section(modes)
    if len(modes) > 1:
        yield mac_section(modes)
    yield responses_section(modes, response, fit)


def shapes_section(modes: ModalModel) -> Section:
    """Draw every mode shape."""
    pictures = [
        picture(shape_svg(modes, i), f"Shape of mode {i + 1}, {frequency(f)}") for i, f in enumerate(modes.frequencies)
    ]
    lead = paragraph(
        f"Each turned to its best phase; MPC 1 means that this hides nothing. Scaling: {modes.scaling}.", "muted"
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
        body += table(["mode", "frequency [Hz]", *(heading(key) for key in keys)], rows)
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
        words = f"Output {response.output_dofs[i]}, input {response.columns[j]}, measured and rebuilt"
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
        return table(["output \\ input", *response.columns], rows, words=[0], shades=shades, caption=caption)
    if len(ranked) > _ROWS:
        caption += f"; the worst {_ROWS} of {len(ranked)}"
    rows = [[response.output_dofs[i], response.columns[j], f"{100 * errors[i, j]:.3g}"] for i, j in ranked[:_ROWS]]
    return table(["output", "input", "fit error [%]"], rows, words=[0, 1], caption=caption)
