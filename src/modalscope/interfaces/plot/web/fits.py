"""Compare the measured responses with those that the modes rebuild, band by band."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from modalscope.data import DataError, ImpulseResponse, ModalModel, StabilizationDiagram
from modalscope.data.rebuilt import band_of, fit_error, fit_error_heard, heard_lines, of_band, rebuilt
from modalscope.data.response import Response
from modalscope.data.results import Result
from modalscope.interfaces.plot.picture import unit_of
from modalscope.interfaces.plot.responses import coherence_of
from modalscope.interfaces.plot.web.blob import pack, parts_of
from modalscope.numerics.checks import Array, RealArray

#: Maximum points of a drawn response: more than a screen has.
_MAX_POINTS = 200_000

#: Fit error in all and per channel (l, m), or None if the modes cannot be rebuilt.
Fit = tuple[float, Array] | None


def cut_to_band(lines: tuple[Array, ...], diagram: StabilizationDiagram, bands: int) -> tuple[Array, ...]:
    """Return lines and their values, of several bands those inside: neighbours may overlap, and a curve never runs back."""
    if bands == 1:
        return lines
    low, high = band_of(diagram, bands)
    kept = (lines[0] >= low) & (lines[0] <= high)
    return tuple(values[kept] for values in lines)


class Lines(NamedTuple):
    """Lines (F,) in Hz with measured and rebuilt values (F, l, m)."""

    frequencies: Array
    measured: Array
    rebuilt: Array


def lines_of(modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> Lines:
    """Return the lines of all bands, one after the other."""
    parts = [rebuilt_lines(modes, diagram, len(diagrams)) for diagram in diagrams]
    return Lines(*(np.concatenate(side) for side in zip(*parts, strict=True)))


def rebuilt_lines(modes: ModalModel, diagram: StabilizationDiagram, bands: int, *, falling: bool = True) -> Lines:
    """Return lines (F,), measured and rebuilt values (F, l, m) of one of several bands, rebuilt from the modes of all.

    `falling`: as in `lines_of_response`.
    """
    lines = lines_of_response(of_band(modes, diagram, bands), diagram.response, falling=falling)
    return Lines(*cut_to_band(lines, diagram, bands))


def lines_of_response(modes: ModalModel, response: Response, *, falling: bool = True) -> Lines:
    """Return the lines of a response; samples are transformed.

    `falling`: correlations, which are truncated before they decay, are first multiplied by the falling half of a Hann window. Without it
    their transform swings about the spectrum.
    """
    response = response.picture()
    fitted = rebuilt(response, modes)
    if not isinstance(response, ImpulseResponse):
        f, measured = response.spectrum()
        return Lines(np.asarray(f), measured, fitted)
    f, measured = transformed(response, response.values, falling=falling)
    return Lines(f, measured, transformed(response, fitted, falling=falling)[1])


def transformed(
    response: ImpulseResponse, values: Array, length: int = 0, *, falling: bool = True
) -> tuple[RealArray, Array]:
    """Return lines (F,) and the transform (F, ...) of samples (N, ...) of a response, zero-padded to `length`, eightfold by default.

    `falling`: see `lines_of_response`.
    """
    count, rate = response.samples, response.sampling_rate
    length = length or 8 * count
    fall = 0.5 + 0.5 * np.cos(np.pi * np.arange(count) / count) if falling and response.ambient else np.ones(count)
    windowed = values * fall.reshape(-1, *[1] * (values.ndim - 1))
    lines = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=float)
    return lines, np.asarray(np.fft.rfft(windowed, n=length, axis=0) / rate)


def fit_of(modes: ModalModel, response: Response) -> Fit:
    """Return the fit error of the modes, in all and per channel; None if they cannot be rebuilt."""
    return None if modes.participation is None else fit_error_heard(response, rebuilt(response, modes))


def fit_of_bands(modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> Fit:
    """Return the fit error of all bands together, each on the lines above its noise, rebuilt from all modes."""
    if len(diagrams) == 1 or modes.participation is None:
        return fit_of(modes, diagrams[0].response)
    parts = []
    for diagram in diagrams:
        lines, measured, fitted = rebuilt_lines(modes, diagram, len(diagrams), falling=False)
        heard = heard_lines(diagram.response)
        kept = ... if heard.all() else np.isin(lines, np.asarray(diagram.response.spectrum()[0])[heard])
        parts.append((measured[kept], fitted[kept]))
    measured, fitted = (np.concatenate(side) for side in zip(*parts, strict=True))
    return fit_error(measured, fitted)


def fit_of_result(result: Result) -> Fit:
    """Return the fit error of a result; None where its modes cannot be rebuilt: none, or setups identified apart."""
    rebuildable = len(result.modes) > 0 and not result.analysis.apart
    return fit_of_bands(result.modes, result.diagrams) if rebuildable else None


def channel_blob(
    diagrams: Sequence[StabilizationDiagram], modes: ModalModel, output: int | None, column: int | None
) -> bytes:
    """Return one channel on the lines of all bands, measured and rebuilt from the modes, with its coherence where that is known.

    Without an output and a column it is the sum of the magnitudes of all channels, and their mean coherence.

    Between two bands stands a line without values: curves do not join there.
    """
    pair = None if output is None or column is None else (output, column)
    parts = []
    for diagram in diagrams:
        response = diagram.response
        outputs, columns = response.values.shape[1:]
        if pair and not (0 <= pair[0] < outputs and 0 <= pair[1] < columns):
            counts = f"there are {outputs} outputs and {columns} inputs"
            raise DataError(f"channel {output}, {column}:", counts, "Choose one of these.")
        chosen = of_band(modes, diagram, len(diagrams))
        curves = _channel_lines(response, chosen, pair)
        parts.append(cut_to_band(curves, diagram, len(diagrams)))
    joined = [_apart(side) for side in zip(*parts, strict=True)]
    every = max(1, -(-len(joined[0]) // _MAX_POINTS))
    f, measured, fitted, coherence = (side[::every] for side in joined)
    first = diagrams[0].response
    names = (first.output_dofs[pair[0]], list(first.columns)[pair[1]]) if pair else ("", "")
    unit = unit_of(first.picture(), output, column).strip(" []")
    arrays = {"lines": f, **parts_of(measured=measured, rebuilt=fitted)}
    arrays |= {"coherence": coherence} if np.isfinite(coherence).any() else {}
    return pack({"output": names[0], "input": names[1], "all": not pair, "unit": unit}, arrays, exact=("lines",))


def _apart(bands: Sequence[Array]) -> Array:
    """Return the values of all bands with NaN between two; frequencies have their mean there."""
    first, *others = bands
    joined = [first]
    for band in others:
        rising = np.isrealobj(band) and np.isfinite(band).all() and band[0] > joined[-1][-1]
        joined += [np.array([(joined[-1][-1] + band[0]) / 2 if rising else np.nan]), band]
    return np.concatenate(joined)


def _channel_lines(response: Response, modes: ModalModel, pair: tuple[int, int] | None) -> tuple[Array, ...]:
    """Return lines, measured and rebuilt values and coherence of one channel; samples are transformed, and have no coherence.

    Without a pair of output and column these are of all channels together: sums of magnitudes, and the mean coherence.
    """
    complete, shown = len(modes) and modes.participation is not None, response.picture()
    fitted = rebuilt(shown, modes) if complete else np.full_like(shown.values, np.nan)
    sides = [side[:, pair[0], pair[1]] if pair else side for side in (shown.values, fitted)]
    if isinstance(shown, ImpulseResponse):
        (f, first), (_, second) = (transformed(shown, side) for side in sides)
        sides = [first, second]
    else:
        f = np.asarray(shown.spectrum()[0])
    drawn = [side if pair else np.abs(side).sum(axis=(1, 2)) + 0j for side in sides]
    known = getattr(shown, "coherence", None)
    if known is None or len(known) != len(f):
        return f, *drawn, np.full(len(f), np.nan)
    return f, *drawn, coherence_of(known, *pair) if pair else known.reshape(len(f), -1).mean(axis=1)
