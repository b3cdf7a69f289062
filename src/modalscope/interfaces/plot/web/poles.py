"""Collect the poles and curves that the page draws."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, Signals, StabilizationDiagram
from modalscope.data.indicators import cmif, mmif
from modalscope.data.rebuilt import asked_ends, band_of
from modalscope.data.response import Response
from modalscope.data.shown import summary_of
from modalscope.identification.method_names import cell_label
from modalscope.identification.stabilize import stable_against
from modalscope.identification.sweep import Cut, Sweep
from modalscope.interfaces.plot.picture import unit_of
from modalscope.interfaces.plot.web.blob import pack
from modalscope.interfaces.plot.web.fits import cut_to_band, transformed
from modalscope.io.arrays import plain
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.signals.preprocess import decomposition, estimate_frf
from modalscope.signals.preprocess.singular_spectra import Decomposition

#: Maximum number of curves of an indicator, and maximum points of each: more than a screen has.
_MAX_CURVES, _MAX_POINTS = 3, 200_000

#: Maximum number of drawn singular values of spectra.
_MAX_SPECTRA = 4


class Kind(NamedTuple):
    """How a pole agrees with one of the previous order: letter, words, mark and ink."""

    letter: str
    words: str
    mark: str
    ink: str


#: Kinds of poles, by the number that `pole_arrays` gives them.
KINDS = (
    Kind("o", "new", "cross", "middle"),
    Kind("f", "frequency", "diamond", "amber"),
    Kind("d", "frequency, damping", "triangle", "green"),
    Kind("v", "frequency, shape", "square", "purple"),
    Kind("s", "stable", "dot", "blue"),
)

#: Minimum lines of a spectrum of samples, so that peaks are drawn smooth.
_MIN_LINES = 4096


def indicator_curves(response: Response, kind: str = "cmif") -> tuple[RealArray, RealArray]:
    """Return lines in Hz, (F,), and the curves of the mode indicator, (F, k).

    `cmif` gives the singular values of H at each line, `sum` the sum of the magnitudes. Impulse responses are zero-padded and transformed
    by FFT; correlations, which are truncated before they decay, are first multiplied by the falling half of a Hann window.
    """
    response = response.picture()
    if isinstance(response, FrequencyResponse):
        lines, values = response.frequencies, response.values
    else:
        assert isinstance(response, ImpulseResponse)
        lines, values = transformed(response, response.values, max(response.samples, 2 * _MIN_LINES))
    curves = cmif(values) if kind == "cmif" else np.abs(values).sum(axis=(1, 2))[:, None]
    return lines, curves


def curves_of(data: Any, kind: str = "cmif", spectra: Decomposition | None = None) -> tuple[Array, Array]:
    """Return lines (F,) and indicator curves (F, k) of any data: CMIF, or singular values of the spectra of ambient records.

    `kind`: of responses, as in `indicator_curves`, or "mmif". `spectra`: those of `spectra_of`, if they are known.
    """
    spectra = spectra_of(data) if spectra is None else spectra
    if spectra is not None:
        return spectra.frequencies, np.sqrt(spectra.singular_values)
    longest = longest_of(data)
    data = data if longest is None else estimate_frf(longest)
    picture = data.picture()
    return (picture.frequencies, mmif(picture)[0]) if kind == "mmif" else indicator_curves(picture, kind)


def spectra_of(data: Any) -> Decomposition | None:
    """Return the singular values of the spectra of an ambient record, of runs the longest; None of other data."""
    longest = longest_of(data)
    return None if longest is None or longest.inputs is not None else decomposition(longest)


def longest_of(data: Any) -> Signals | None:
    """Return the longest recording of a test; None of responses."""
    return max(getattr(data, "recordings", ()), key=lambda run: run.samples, default=None)


def overview_blob(data: Any, spectra: Decomposition | None = None, findings: Any = ()) -> bytes:
    """Return the indicator over the full range, with a summary of the data and its findings; `spectra`: those of `spectra_of`."""
    try:
        lines, curves = curves_of(data, spectra=spectra)
    except DataError:  # no response can be estimated from these records
        lines, curves = np.zeros(0), np.zeros((0, 1))
    span = [lines[0], lines[-1]] if len(lines) else None
    told = {"kinds": [kind._asdict() for kind in KINDS], "findings": [finding._asdict() for finding in findings]}
    head = {"summary": summary_of(data), "span": span, **told}
    lines, level = thinned(lines, curves[:, :_MAX_CURVES], _MAX_POINTS)
    return pack(head, {"lines": lines, "curves": level}, exact=("lines",))


def cut_view(sweep: Sweep, cut: Cut, before: Cut | None) -> dict[str, Any]:
    """Return the poles of one order for the page while a sweep runs.

    `before`: the previous order.
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


#: Curves that can stand behind the poles: name -> words of the choice, label of their axis, whether that is linear.
INDICATORS = {
    "spectra": ("singular values", "singular values of the spectra", False),
    "cmif": ("CMIF", "mode indicator: CMIF", False),
    "mmif": ("MIF", "MIF, 0 at a resonance", True),
    "sum": ("sum", "sum of magnitudes", False),
}


def level_of(name: str, response: Response) -> str:
    """Return the label of the axis of an indicator, with its unit, if all channels share it."""
    has_unit = name in ("cmif", "sum") or (name == "spectra" and response.ambient)
    return INDICATORS[name][1] + (unit_of(response) if has_unit else "")


def first_indicator(
    diagrams: Sequence[StabilizationDiagram], spectra: Decomposition | None, points: int
) -> tuple[str, Array, Array]:
    """Return the curves that stand behind the poles first, at most `points` each: name, lines and values."""
    lines, curves = behind(diagrams, points, spectra)
    return ("cmif", lines, curves) if spectra is None else ("spectra", lines, np.sqrt(curves))


def _indicators(
    diagrams: Sequence[StabilizationDiagram], spectra: Decomposition | None
) -> Iterator[tuple[str, Array, Array]]:
    """Yield the curves that can stand behind the poles: name, lines and values; spectra, where there are, first."""
    if spectra is not None:
        yield first_indicator(diagrams, spectra, _MAX_POINTS)
    responses = [d.response for d in diagrams]
    for name in ("cmif", "mmif", "sum") if all(map(_has_mif, responses)) else ("cmif", "sum"):
        with suppress(DataError):  # too large for another decomposition
            yield name, *behind(diagrams, _MAX_POINTS, kind=name)


def _has_mif(response: Response) -> bool:
    """Whether some forces cannot make a response of fewer outputs fall out of phase everywhere, and the phase at resonance is known."""
    lines = isinstance(response, FrequencyResponse) and response.reciprocal and response.quantity is not None
    return lines and len(response.input_dofs) <= len(response.output_dofs)


def poles_blob(diagrams: Sequence[StabilizationDiagram], spectra: Decomposition | None = None) -> bytes:
    """Return the poles of all orders and bands, with the indicators behind them; `spectra`: those of `spectra_of`."""
    return pack(*poles_parts(diagrams, _indicators(diagrams, spectra)))


def poles_parts(
    diagrams: Sequence[StabilizationDiagram], indicators: Iterable[tuple[str, Array, Array]]
) -> tuple[dict[str, Any], dict[str, Array], tuple[str, ...]]:
    """Return the entries and arrays of poles, and which arrays are exact; `indicators`: name, lines and values of each."""
    first, arrays, listed = diagrams[0], pole_arrays(diagrams), []
    for name, lines, curves in indicators:
        words, _, linear = INDICATORS[name]
        listed.append({"name": name, "words": words, "level": level_of(name, first.response), "linear": linear})
        arrays |= {f"{name}_lines": lines, f"{name}_curves": curves}
    head = {
        "kinds": [kind._asdict() for kind in KINDS],
        "indicators": listed,
        "label": cell_label(first.method, first.domain),
        "orders": sorted({order for d in diagrams for order in d.orders}),
        # spectra have lines where nobody asked for modes
        "bands": [asked_ends(d) if "spectra_lines" in arrays else band_of(d, len(diagrams)) for d in diagrams],
    }
    return head, arrays, ("frequency", *(f"{each['name']}_lines" for each in listed))


def pole_arrays(diagrams: Sequence[StabilizationDiagram]) -> dict[str, Array]:
    """Return frequency, damping, order, kind and standard deviation of the frequency of all poles."""
    joined = {
        "frequency": [d.frequencies for d in diagrams],
        "damping": [d.damping_ratios for d in diagrams],
        "order": [np.asarray(d.order_of_pole, dtype=int) for d in diagrams],
        "kind": [
            _kinds(np.asarray(d.kinds), np.stack([d.stable_frequency, d.stable_damping, d.stable_shape]))
            for d in diagrams
        ],
        "std": [np.full(len(d.poles), np.nan) if d.frequencies_std is None else d.frequencies_std for d in diagrams],
    }
    return {name: np.concatenate(parts) for name, parts in joined.items()}


def behind(
    diagrams: Sequence[StabilizationDiagram], points: int, spectra: Decomposition | None = None, kind: str = "cmif"
) -> tuple[Array, Array]:
    """Return lines (F,) and indicator curves (k, F) of diagrams, thinned to `points`; all of them if that is 0.

    `spectra`: their largest singular values instead of the indicator, in the chosen bands. `kind`: as in `curves_of`.
    """
    if spectra is not None:
        f = spectra.frequencies
        kept = np.any([(low <= f) & (f <= high) for low, high in map(asked_ends, diagrams)], axis=0)
        return thinned(f[kept], spectra.singular_values[kept, :_MAX_SPECTRA], points)
    curves = [cut_to_band(curves_of(d.response, kind), d, len(diagrams)) for d in diagrams]
    count = min(_MAX_CURVES, *(c.shape[1] for _, c in curves))
    return thinned(np.concatenate([f for f, _ in curves]), np.concatenate([c[:, :count] for _, c in curves]), points)


def thinned(lines: Array, curves: Array, points: int) -> tuple[Array, Array]:
    """Return at most `points` lines (P,) and curves (k, P), the maximum of each group of neighbours: no peak is lost.

    `lines` (F,). `curves` (F, k).
    """
    every = max(1, -(-len(lines) // points)) if points else 1
    if every == 1:
        return lines, curves.T
    starts = np.arange(0, len(lines), every)
    return lines[starts], np.maximum.reduceat(curves, starts, axis=0).T


def _kinds(kinds: Array, flags: Array) -> Array:
    """Return 0 new, 1 stable in frequency, 2 in frequency and damping, 3 in frequency and shape, 4 in all, 5 no oscillation."""
    frequency, damping, shape = flags
    rank = np.where(frequency, 1 + damping + 2 * shape, 0)
    return np.where(np.isin(kinds, ("mode", "unstable")), rank, 5).astype(int)
