"""Collect the poles and curves that the page draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, ModalModel, StabilizationDiagram
from modalscope.data.response import Response
from modalscope.data.shown import summary_of
from modalscope.functions.poles import frequencies_and_damping
from modalscope.identification.method_names import cell_label
from modalscope.identification.stabilize import stable_against
from modalscope.identification.sweep import Cut, Sweep
from modalscope.io.arrays import plain
from modalscope.modal.rebuilt import fit_error, fit_error_heard, heard_lines, rebuilt
from modalscope.numerics.checks import Array
from modalscope.plot.diagrams import indicator_curves
from modalscope.plot.web.blob import pack
from modalscope.preprocess import decomposition, estimate_frf

#: Curves of an indicator that are drawn, and points of each: more than a screen has.
_CURVES, _POINTS = 3, 200_000


def curves_of(data: Any) -> tuple[Array, Array]:
    """Return lines (F,) and indicator curves (F, k) of data of any kind: CMIF, or the singular values of ambient spectra."""
    runs = getattr(data, "recordings", ())
    if runs:
        longest = max(runs, key=lambda run: run.samples)
        if longest.inputs is None:
            found = decomposition(longest)
            return found.frequencies, np.sqrt(found.singular_values)
        data = estimate_frf(longest)
    return indicator_curves(data.picture())


def overview_blob(data: Any) -> bytes:
    """Return the indicator over all that was measured, with what the data are."""
    try:
        lines, curves = curves_of(data)
    except DataError:  # records that give no response: the diagram shows what there is
        lines, curves = np.zeros(0), np.zeros((0, 1))
    head = {"summary": summary_of(data), "span": [lines[0], lines[-1]] if len(lines) else None}
    lines, level = thinned(lines, curves[:, :_CURVES], _POINTS)
    return pack(head, {"lines": lines, "curves": level}, exact=("lines",))


def cut_view(sweep: Sweep, cut: Cut, before: Cut | None) -> dict[str, Any]:
    """Return the poles of one order as the page takes them while a sweep runs.

    `before`: the order before.
    """
    index = cut.reported
    f, zeta = frequencies_and_damping(cut.modes.poles[index])
    flags = np.zeros((3, index.size), bool) if before is None else stable_against(before, cut)
    return {
        "order": cut.order,
        "frequency": plain(f),
        "damping": plain(zeta),
        "kind": _kinds(np.asarray(cut.modes.kinds)[index], flags).tolist(),
        "done": len(sweep.orders) - len(sweep.remaining),
        "total": len(sweep.orders),
    }


def poles_blob(diagrams: Sequence[StabilizationDiagram]) -> bytes:
    """Return the poles of all orders and bands, with the indicator behind them."""
    first = diagrams[0]
    lines, curves = behind(diagrams, _POINTS)
    head = {
        "label": cell_label(first.method, first.domain),
        "method": first.method,
        "domain": first.domain,
        "orders": sorted({order for d in diagrams for order in d.orders}),
        "bands": [list(band_of(d, len(diagrams))) for d in diagrams],
        "tolerances": dict(first.tolerances),
    }
    return pack(head, {**pole_arrays(diagrams), "lines": lines, "curves": curves}, exact=("frequency", "lines"))


def pole_arrays(diagrams: Sequence[StabilizationDiagram]) -> dict[str, Array]:
    """Return frequency, damping, order, kind and deviations of all poles."""

    def known(values: Array | None, count: int) -> Array:
        return np.full(count, np.nan) if values is None else values

    joined = {
        "frequency": [d.frequencies for d in diagrams],
        "damping": [d.damping_ratios for d in diagrams],
        "order": [np.asarray(d.order_of_pole, dtype=int) for d in diagrams],
        "kind": [
            _kinds(np.asarray(d.kinds), np.stack([d.stable_frequency, d.stable_damping, d.stable_shape]))
            for d in diagrams
        ],
        "std": [known(d.frequencies_std, len(d.poles)) for d in diagrams],
        "damping_std": [known(d.damping_ratios_std, len(d.poles)) for d in diagrams],
    }
    return {name: np.concatenate(parts) for name, parts in joined.items()}


def behind(diagrams: Sequence[StabilizationDiagram], points: int) -> tuple[Array, Array]:
    """Return lines (F,) and indicator curves (k, F) of diagrams; of more points than asked the highest of neighbours."""
    curves = [_cut(curves_of(d.response), d, len(diagrams)) for d in diagrams]
    count = min(_CURVES, *(c.shape[1] for _, c in curves))
    return thinned(np.concatenate([f for f, _ in curves]), np.concatenate([c[:, :count] for _, c in curves]), points)


def thinned(lines: Array, curves: Array, points: int) -> tuple[Array, Array]:
    """Return at most so many lines (P,) and curves (k, P), of each group of neighbours the highest: no peak is lost.

    `lines` (F,). `curves` (F, k).
    """
    every = max(1, -(-len(lines) // points))
    starts = np.arange(0, len(lines), every)
    if every == 1 or not len(lines):
        return lines, curves.T
    return lines[starts], np.maximum.reduceat(curves, starts, axis=0).T


def _kinds(kinds: Array, flags: Array) -> Array:
    """Return 0 new, 1 stable in frequency, 2 in frequency and damping, 3 in frequency and shape, 4 in all, 5 no oscillation."""
    frequency, damping, shape = flags
    rank = np.where(frequency, 1 + damping + 2 * shape, 0)
    return np.where(np.isin(kinds, ("mode", "unstable")), rank, 5).astype(int)


def channel_blob(diagrams: Sequence[StabilizationDiagram], modes: ModalModel, output: int, column: int) -> bytes:
    """Return one channel on lines, measured and rebuilt from the modes.

    `diagrams`: several bands stand one behind the other.
    """
    parts = []
    for diagram in diagrams:
        response = diagram.response
        outputs, columns = response.values.shape[1:]
        if not (0 <= output < outputs and 0 <= column < columns):
            raise DataError(
                f"channel {output}, {column} was asked",
                f"there are {outputs} outputs and {columns} inputs",
                "Choose one of these.",
            )
        own = _lines_of(response, inside(modes, diagram, len(diagrams)), output, column)
        parts.append(_cut(own, diagram, len(diagrams)))
    f, measured, fitted = (np.concatenate(side) for side in zip(*parts, strict=True))
    every = max(1, -(-len(f) // _POINTS))
    first = diagrams[0].response
    head: Mapping[str, Any] = {
        "output": first.output_dofs[output],
        "input": list(first.columns)[column],
        "quantity": first.quantity,
        "fit": float(np.linalg.norm(measured - fitted) / max(float(np.linalg.norm(measured)), 1e-300)),
    }
    sides = {"measured": measured[::every], "rebuilt": fitted[::every]}
    arrays = {f"{name}_{part}": getattr(side, part) for name, side in sides.items() for part in ("real", "imag")}
    return pack(head, {"lines": f[::every], **arrays}, exact=("lines",))


def inside(modes: ModalModel, diagram: StabilizationDiagram, bands: int) -> ModalModel:
    """Return the modes that belong to a band: of several bands those inside."""
    if bands == 1:
        return modes
    low, high = band_of(diagram, bands)
    return modes.take((modes.frequencies >= low) & (modes.frequencies <= high))


def band_of(diagram: StabilizationDiagram, bands: int) -> tuple[float, float]:
    """Return from where to where a diagram reports, Hz: of several bands the one that was chosen, which its data may exceed."""
    return asked_ends(diagram) if bands > 1 else diagram.response.span


def asked_ends(diagram: StabilizationDiagram) -> tuple[float, float]:
    """Return the band that was asked as far as there are data, Hz; all of them where none was."""
    low, high = diagram.response.span
    asked = diagram.settings.get("band")
    return (low, high) if asked is None else (max(low, asked[0]), min(high, asked[1]))


def _cut(lines: tuple[Array, ...], diagram: StabilizationDiagram, bands: int) -> tuple[Array, ...]:
    """Return lines and what stands on them, of several bands those inside: neighbours may overlap, and a curve never runs back."""
    if bands == 1:
        return lines
    low, high = band_of(diagram, bands)
    kept = (lines[0] >= low) & (lines[0] <= high)
    return tuple(values[kept] for values in lines)


def rebuilt_lines(modes: ModalModel, diagram: StabilizationDiagram, bands: int) -> tuple[Array, Array, Array]:
    """Return lines (F,), measured and rebuilt values (F, l, m) of a band by its own modes.

    `bands`: how many there are.
    """
    response = diagram.response.picture()
    f, measured = response.spectrum()
    own = rebuilt(response, inside(modes, diagram, bands))
    if own.shape != measured.shape:
        own = np.fft.rfft(own, n=2 * (len(f) - 1), axis=0) / (2 * f[-1])
    f, measured, own = _cut((np.asarray(f), measured, own), diagram, bands)
    return f, measured, own


def _lines_of(response: Response, modes: ModalModel, output: int, column: int) -> tuple[Array, Array, Array]:
    """Return lines, the measured and the rebuilt values of one channel; samples are transformed."""
    known = len(modes) and modes.participation is not None
    fitted = rebuilt(response, modes) if known else np.full_like(response.values, np.nan)
    if not isinstance(response, FrequencyResponse | ImpulseResponse):
        shown = response.picture()
        f, values = shown.spectrum()
        own = rebuilt(shown, modes) if known else np.full_like(values, np.nan)
        return f, values[:, output, column], own[:, output, column]
    if isinstance(response, FrequencyResponse):
        return response.frequencies, response.values[:, output, column], fitted[:, output, column]
    f, H = response.spectrum()
    G = np.fft.rfft(fitted[:, output, column], n=8 * response.samples) / response.sampling_rate
    return f, H[:, output, column], G


# ---------------------------------------------------------------------------------------------------------------- fits
# What modes leave of the data, by the same rule wherever it is told: reports, the page, what a report holds to zoom and turn.

#: Fit error in all and per channel (l, m), or None when the modes cannot be rebuilt.
Fit = tuple[float, Array] | None


def fit_of(modes: ModalModel, response: Response) -> Fit:
    """Return what the modes leave of the data, in all and per channel; None when they cannot be rebuilt."""
    return None if modes.participation is None else fit_error_heard(response, rebuilt(response, modes))


def fit_of_bands(modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> Fit:
    """Return the same of all bands together, each by its own modes on its own lines."""
    if len(diagrams) == 1 or modes.participation is None:
        return fit_of(modes, diagrams[0].response)
    parts = [_heard_part(modes, diagram, len(diagrams)) for diagram in diagrams]
    measured, own = (np.concatenate(side) for side in zip(*parts, strict=True))
    return fit_error(measured, own)


def _heard_part(modes: ModalModel, diagram: StabilizationDiagram, bands: int) -> tuple[Array, Array]:
    """Return measured and rebuilt values on the lines of a band that hold more than noise."""
    lines, measured, own = rebuilt_lines(modes, diagram, bands)
    heard = heard_lines(diagram.response)
    if heard.all():
        return measured, own
    kept = np.isin(lines, np.asarray(diagram.response.spectrum()[0])[heard])
    return measured[kept], own[kept]
