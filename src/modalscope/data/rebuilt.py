"""Rebuild responses from modes, and compute the unexplained part and the contribution of each pole."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.response import Response, output_scale
from modalscope.data.results import StabilizationDiagram
from modalscope.data.shown import percent
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError

#: Neighbouring lines over which power and variance are averaged.
_AVERAGED_LINES = 9

#: Minimum ratio of the averaged power to its noise. Noise alone reaches it in one case of a thousand, with variances from three averages
#: of one channel (F with 18 and 36 degrees of freedom: 3.0).
_MIN_SIGNAL_TO_NOISE = 3.0

#: Minimum share of the lines of noise in the measured mean square from which they are left out: below, they change nothing.
_MIN_SHARE_OF_NOISE_LINES = 0.01


def heard_lines(response: Response) -> Array:
    """Return which lines or samples tell how much modes explain, (K,) of bool.

    Where no force goes in, above the filter of a recorder say, a frequency response is noise over noise, as large as it likes. No mode
    explains that, and its variance says so: with p = mean over channels of sum |H|^2 / sum var(H), both sums over nine neighbouring
    lines, lines with p < 3 are left out. All lines count where no variance is known, where none holds more than noise, and where the
    lines of noise hold less than a hundredth of the measured mean square.

    Examples
    --------
    >>> import modalscope as ms
    >>> lines = np.arange(1.0, 41.0)
    >>> values, variance = np.full((40, 1, 1), 1j), np.full((40, 1, 1), 1e-4)
    >>> values[20:], variance[20:] = 10j, 100.0
    >>> response = ms.FrequencyResponse(values=values, frequencies=lines, quantity="displacement", variance=variance)
    >>> int(heard_lines(response).sum())  # four lines beside the loud ones go with them
    16
    """
    from scipy.ndimage import uniform_filter1d

    every = np.ones(len(response.values), dtype=bool)
    variance = response.variance
    if variance is None or not np.iscomplexobj(response.values):
        return every
    power = np.abs(response.values) ** 2
    own, noise = (uniform_filter1d(each, _AVERAGED_LINES, axis=0, mode="nearest") for each in (power, variance))
    known = noise > 0
    times = np.divide(own, noise, out=np.full(own.shape, np.inf), where=known)
    heard = np.asarray(times.mean(axis=(1, 2)) >= _MIN_SIGNAL_TO_NOISE)
    by_line = power.sum(axis=(1, 2))
    if not heard.any() or by_line[~heard].sum() < _MIN_SHARE_OF_NOISE_LINES * by_line.sum():
        return every
    return heard


def of_noise(response: Response) -> tuple[Note, ...]:
    """Return a note on the lines of noise that do not count in the explained part; nothing where all lines count."""
    heard = heard_lines(response)
    if heard.all():
        return ()
    lines = np.asarray(response.spectrum()[0])[~heard]
    low, high = float(lines[0]), float(lines[-1])
    facts = {"lines": float(lines.size), "lowest_hz": low, "highest_hz": high}
    text = (
        f"{lines.size} of {heard.size} lines, between {low:.5g} and {high:.5g} Hz, contain only noise by their variance: "
        "they do not count in the explained part"
    )
    return (Note("lines of noise", facts, text),)


#: Share of the measured mean square below which modes leave out too much to be relied on.
ENOUGH = 0.7


def share_explained(fit_error: float) -> float:
    """Return 1 - (fit error)^2, the share of the measured mean square that rebuilt responses explain; at least 0."""
    return max(1 - float(fit_error) ** 2, 0.0) if np.isfinite(fit_error) else 0.0


def explains_enough(fit_error: float) -> bool:
    """Whether at least 70 % of the measured mean square is explained."""
    return share_explained(fit_error) >= ENOUGH


def unexplained(fit_error: float) -> str:
    """Return a sentence on the unexplained part; where more than 30 % of the mean square is unexplained, a warning with remedies.

    Parameters
    ----------
    fit_error : float
        norm(measured - rebuilt) / norm(measured).

    Examples
    --------
    >>> print(unexplained(0.1))
    Unexplained: 10 % of the response.
    >>> print(unexplained(0.72))
    WARNING: 72 % of the response is unexplained. Modes are missing, or something else was measured: raise \
the largest order, choose a narrower band, or look for channels and lines that no mode explains.
    """
    share = f"{percent(fit_error)} of the response"
    if explains_enough(fit_error):
        return f"Unexplained: {share}."
    return (
        f"WARNING: {share} is unexplained. Modes are missing, or something else was measured: "
        "raise the largest order, choose a narrower band, or look for channels and lines that no mode explains."
    )


def fit_error(measured: Array, rebuilt: Array) -> tuple[float, RealArray]:
    """Return norm(measured - rebuilt) / norm(measured), in all and per channel (l, m)."""
    return fit_error_of([(measured, rebuilt)])


def fit_error_of(pieces: Iterable[tuple[Array, Array]]) -> tuple[float, RealArray]:
    """Return the fit error of measured and rebuilt values that come some lines or samples after the other: sums of squares add up."""
    left: Array | float = 0.0
    all_: Array | float = 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for measured, rebuilt in pieces:
            left = left + _squares(measured - rebuilt)
            all_ = all_ + _squares(measured)
            del rebuilt  # before the next piece is made
        whole = np.sqrt(np.sum(left) / np.sum(all_))
        channel = np.sqrt(left / all_)
    return float(whole), np.asarray(channel)


def _squares(values: Array) -> RealArray:
    """Return the sum of the squares of every channel, without an array of the values' size."""
    parts = (values.real, values.imag) if np.iscomplexobj(values) else (values,)
    return np.asarray(sum(np.einsum("k...,k...->...", part, part) for part in parts))


def rebuilt(response: Response, modes: ModalModel) -> Array:
    """Return the responses that the modes give on the lines or samples of the data, in the shape of its values.

    Raises `DataError`: modes with other channels than the data, or without participation.
    """
    added, part = response.added_damping, modes.known_participation("a rebuilt response")
    (outputs, inputs), (l, m) = (len(modes.shapes), part.shape[1]), (response.values.shape[1], len(response.input_dofs))
    if (outputs, inputs) != (l, m):
        raise DataError(
            "measured against rebuilt responses:",
            f"the data have {l} outputs and {m} inputs, the modes {outputs} and {inputs}",
            "Give the data that the modes were identified from, or select the same channels in both.",
        )
    if added:
        terms = tuple(each.shifted(-added) for each in modes.residual_terms)
        modes = replace(modes, poles=modes.poles - added, residual_terms=terms)
    return response.of_modes(modes)


def asked_ends(diagram: StabilizationDiagram) -> tuple[float, float]:
    """Return the chosen band within the span of the data, Hz; by default the span."""
    low, high = diagram.response.span
    band = diagram.settings.get("band")
    return (low, high) if band is None else (max(low, band[0]), min(high, band[1]))


def band_of(diagram: StabilizationDiagram, bands: int) -> tuple[float, float]:
    """Return the limits of the modes of a diagram, Hz: of several bands the chosen one, which its data may exceed."""
    return asked_ends(diagram) if bands > 1 else diagram.response.span


def inside(modes: ModalModel, diagram: StabilizationDiagram, bands: int) -> ModalModel:
    """Return the modes of a band: of several bands those inside."""
    if bands == 1:
        return modes
    low, high = band_of(diagram, bands)
    return modes.take((modes.frequencies >= low) & (modes.frequencies <= high))


def of_band(modes: ModalModel, diagram: StabilizationDiagram, bands: int) -> ModalModel:
    """Return what the response of a diagram is rebuilt from: on lines all modes, whose tails reach inside.

    Samples of one of several bands are at a rate of their own: they hold its modes, and the terms that were fitted to them.
    """
    if bands == 1 or diagram.response.grid is not None:
        return modes
    terms = tuple(each for each in modes.residual_terms if each.band == asked_ends(diagram))
    return replace(inside(modes, diagram, bands), residual_terms=terms)


def fit_of(modes: ModalModel, response: Response) -> float:
    """Return norm(measured - rebuilt from the modes) / norm(measured) over all channels; lines of noise alone count not (`heard_lines`)."""
    return fit_error_heard(response, rebuilt(response, modes))[0]


def fit_error_heard(response: Response, fitted: Array) -> tuple[float, RealArray]:
    """Return the fit error of rebuilt values, in all and per channel (l, m), over the lines that hold more than noise."""
    heard = heard_lines(response)
    if heard.all():
        return fit_error(response.values, fitted)
    return fit_error(response.values[heard], fitted[heard])


def contributions(response: Response, poles: Array, shapes: Array, participation: Array) -> RealArray:
    """Return norm(the pole's own term) / norm(measured) of every pole, without building the terms.

    On lines the integral of |R / (j w - s)|^2 over w is pi |R|^2 / |Re s|, lines lying `step` apart in w. The sum over samples of
    |2 Re R exp(s t)|^2 is about |R|^2 fs / |Re s|, over no more than the samples there are.

    `poles` (p,): rad/s, with a window's damping taken off. `shapes` (p, l). `participation` (p, m): referred to the impulse itself.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> modes = chain5().modes()
    >>> response = modes.take([0]).impulse_response(2000, 20.0)
    >>> part = contributions(response, modes.poles[:1], modes.shapes.T[:1], modes.participation[:1])
    >>> bool(abs(part[0] - 1) < 0.1)
    True
    """
    size, decay = _in_the_data(response, poles, shapes, participation)
    total = np.linalg.norm(response.values / output_scale(response)[:, None])
    return size * np.sqrt(response.energy(decay)) / total


def of_diagram(diagram: StabilizationDiagram) -> RealArray:
    """Return the contributions of all poles of a diagram to its response, (p,)."""
    return contributions(diagram.response, diagram.poles, diagram.shapes.T, diagram.participation)


def peak_sizes(response: Response, poles: Array, shapes: Array, participation: Array) -> RealArray:
    """Return |R| / |Re s| of every pole: the size of its own term at its frequency, outputs brought level; see `contributions`."""
    size, decay = _in_the_data(response, poles, shapes, participation)
    return size / decay


def _in_the_data(response: Response, poles: Array, shapes: Array, participation: Array) -> tuple[RealArray, RealArray]:
    """Return of every pole |R exp(s t_0)|, outputs brought level, and |Re s|, s as the data have it: with a window's damping."""
    own = poles - response.added_damping
    t0 = response.steps_late / (response.sampling_rate or 1.0)
    driven = response.driven(own, participation)
    parts, weights = np.ascontiguousarray(shapes).view(np.float64), np.repeat(output_scale(response) ** -2.0, 2)
    level = np.sqrt(np.einsum("pl,pl,l->p", parts, parts, weights))  # of many poles and outputs shapes are large
    size = level * driven * np.exp(own.real * t0)
    return size, np.maximum(np.abs(own.real), 1e-12 * np.abs(own))
