"""Tell which files of a test were driven at one place: those whose whole responses agree in sign, phase and amplitude.

Files of a roving test often name all their drive points alike. Taken for one place they would be averaged, and the shape lost; one place
taken for two stands in the shape twice. Therefore every file is a place of its own, unless its responses a agree with those of all others
of a place, b, in every block of neighbouring lines of every output:

    sum |a - b|^2 <= q sum (var a + var b) + t^2 (mean over the files of sum |H|^2),

with q from the distribution of F, and t what a hit on one place is repeated to. Mirrored places of a symmetric structure differ in the
sign of every second mode, places of one amplitude in one mode differ in another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy import fft, special

from modalscope.data.channels import AUTO
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.preprocess.bands import USEFUL_POWER
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.plans import plan_hits

#: Lines of a block, and neighbouring lines that the windows make one.
_BLOCK_LINES, _DEPENDENT_LINES = 16, 3.0

#: Probability that the noise of two files of one place differs by more in one of the blocks.
_FALSE_ALARM = 1e-4

#: Hits on one place agree to this part of the usual amplitude, and what differs by less than the second number may be one place. The study:
#: in 200 roving tests of 5 to 30 places files of one place differ by .064 at most, by .089 where hits miss their place by 1 % of the
#: distance of two, and files of two places by .103 at least.
_REPEATED, _ALIKE = 0.08, 0.2

#: What the exponential window falls to at the end of a hit, so that vibration which goes on beyond does not depend on the length of the
#: pulse; samples ahead of a hit, and how many of them are quiet.
_END_OF_WINDOW, _BEFORE, _QUIET = 0.05, 20, 15

#: As many degrees of freedom as infinitely many.
_MANY = 1e9

#: Maximum number of samples of a run of random forces that are compared, and its segments.
_MAX_SAMPLES, _SEGMENTS = 1 << 16, 8


class Compared(NamedTuple):
    """Responses of every file, (files, lines, outputs), with their variances and the degrees of freedom of these (files,)."""

    values: ComplexArray
    variance: RealArray
    freedom: RealArray


def label_by_place(parts: Sequence[Any], names: Sequence[str]) -> tuple[list[Any], tuple[Note, ...]]:
    """Label the input of each part of a test by its place when parts of one input label were driven at several places.

    The parts are returned unchanged, without a note, if they have several inputs or different labels, or if there is one place only.

    Parameters
    ----------
    parts : sequence of data objects
        Records or responses of one test.
    names : sequence of str
        Names of their files, for the note.
    """
    if not _one_input(parts):
        return list(parts), ()
    difference = _differences(parts)
    place = _places(difference)
    count = max(place) + 1
    if count == 1:
        return list(parts), ()
    files = [", ".join(name for name, p in zip(names, place, strict=True) if p == k) for k in range(count)]
    listed = "; ".join(f"place {k + 1} ({listing})" for k, listing in enumerate(files))
    text = (
        f"{len(parts)} files look like {count} drive points, all labelled {parts[0].input_dofs[0]!r}. Inputs are named {listed}; "
        f"check with --input-dofs{_doubt(difference, place, names)}"
    )
    named = [replace(part, input_dofs=[f"place {k + 1}"], groups=AUTO) for part, k in zip(parts, place, strict=True)]
    return named, (Note("places", {"places": float(count)}, text),)


def _doubt(difference: RealArray, place: Sequence[int], names: Sequence[str]) -> str:
    """Return a question about the most similar files that are taken for two places, in words; empty where no two are alike."""
    apart = np.where(np.not_equal.outer(place, place), difference, np.inf)
    i, j = divmod(int(np.argmin(apart)), len(names))
    if apart[i, j] >= _ALIKE:
        return ""
    return (
        f". Are {names[i]} and {names[j]} one place? They differ by {100 * apart[i, j]:.2g} %: if so, name them alike"
    )


def _one_input(parts: Sequence[Any]) -> bool:
    """Whether parts are records, or responses on one set of lines, of the same outputs and one input."""
    first = parts[0]
    if len(parts) < 2 or not isinstance(first, Signals | FrequencyResponse) or len(first.input_dofs) != 1:
        return False
    alike = all(
        type(part) is type(first) and part.input_dofs == first.input_dofs and part.output_dofs == first.output_dofs
        for part in parts
    )
    if not alike or isinstance(first, Signals):
        return alike and len({part.sampling_rate for part in parts}) == 1
    return all(np.array_equal(part.frequencies, first.frequencies) for part in parts)


def places_of(parts: Sequence[Any]) -> list[int]:
    """Return the number of the place of every part, from 0 in the order of appearance.

    All parts have the same outputs and lines, or sampling rate, and one input each.
    """
    return _places(_differences(parts))


def _places(difference: RealArray) -> list[int]:
    """Return the number of the place of every file: a file joins the place with all of whose files it agrees."""
    places: list[list[int]] = []
    number = []
    for i, row in enumerate(difference):
        agrees = [k for k, files in enumerate(places) if row[files].max() <= _REPEATED]
        if agrees:
            k = min(agrees, key=lambda k: float(row[places[k]].max()))
        else:
            k = len(places)
            places.append([])
        places[k].append(i)
        number.append(k)
    return number


def _differences(parts: Sequence[Any]) -> RealArray:
    """Return by how much the responses of two files differ beyond their noise, as a part of the usual amplitude, in the worst block."""
    if isinstance(parts[0], FrequencyResponse):
        return differences(_of_responses(parts))
    try:
        if all(find_excitation(part) == "impact" for part in parts):
            return differences(_of_hits(parts))
        count = min(_MAX_SAMPLES, *(part.samples for part in parts))
        return differences(_of_responses([_response(part, count) for part in parts]))
    except DataError:  # no usable hit: nothing can be compared, and a file is a place
        return np.where(np.eye(len(parts)) > 0, 0.0, np.inf)


def _response(part: Signals, count: int) -> FrequencyResponse:
    """Return the response of the first `count` samples of every run."""
    y, u = part.by_run()
    assert u is not None
    cut = replace(part, outputs=y[:, :count], inputs=u[:, :count])
    return estimate_frf(cut, segment=count // _SEGMENTS if find_excitation(cut) == "random" else None)


def _of_responses(parts: Sequence[FrequencyResponse]) -> Compared:
    """Return responses with the variances that they state; without any their noise is not known, and all that differs counts."""
    lines = set.intersection(*(set(part.frequencies.tolist()) for part in parts))
    parts = [part.at_lines(np.isin(part.frequencies, list(lines))) for part in parts]
    values = np.stack([part.values[:, :, 0] for part in parts])
    variance = [np.zeros(values.shape[1:]) if part.variance is None else part.variance[:, :, 0] for part in parts]
    return Compared(values, np.stack(variance), np.full(len(parts), np.inf))


def _of_hits(parts: Sequence[Signals]) -> Compared:
    """Return the responses of hammer hits on the lines that all hits reach, each hit cut to the same length.

    The noise of the outputs is what hits of one file differ by: a level of every file times a spectrum of all. Of a file of one hit it is
    that of the samples ahead of the hit.
    """
    plans = [plan_hits(part, None, "good", _BEFORE, None) for part in parts]
    count = min(plan.outputs.shape[1] for plan in plans)
    window = _END_OF_WINDOW ** (np.arange(count) / count)
    powers, values, noise = [], [], []
    for plan in plans:
        y, u = plan.outputs[:, :count] * window[:, None], plan.inputs[:, :count, 0] * window
        Y, U = (fft.rfft(x, axis=1)[:, 1:-1] for x in (y, u))
        powers.append(np.sum(np.abs(U) ** 2, axis=0))
        H = np.einsum("kfi,kf->fi", Y, U.conj()) / np.maximum(powers[-1], np.finfo(float).tiny)[:, None]
        values.append(H)
        noise.append(_noise(plan.outputs, Y, H * U[:, :, None], float(np.sum(window**2))))
    power = np.stack(powers)
    useful = np.all(power >= USEFUL_POWER * power.max(axis=1, keepdims=True), axis=0)
    level, hits = np.stack(noise)[:, useful], np.array([len(plan.outputs) for plan in plans])
    several = hits > 1
    if several.any():
        own = np.maximum(level[several].mean(axis=1, keepdims=True), np.finfo(float).tiny)
        level[several] = own * (level[several] / own).mean(axis=0)
    freedom = np.where(several, 2 * (hits - 1) * np.sum(useful) / _DEPENDENT_LINES, _QUIET - 1)
    return Compared(np.stack(values)[:, useful], level / power[:, useful, None], np.maximum(freedom, 1.0))


def _noise(outputs: RealArray, Y: ComplexArray, predicted: ComplexArray, energy: float) -> RealArray:
    """Return the noise power of outputs on lines (F, l) by what several hits differ by, or one hit's quiet samples vary by."""
    if len(Y) > 1:
        return np.asarray(np.sum(np.abs(Y - predicted) ** 2, axis=0) / (len(Y) - 1))
    return np.broadcast_to(np.var(outputs[0, :_QUIET], axis=0, ddof=1) * energy, Y.shape[1:])


def differences(compared: Compared) -> RealArray:
    """Return by how much responses differ beyond their noise, as a part of the usual amplitude, in the worst block (files, files).

    Infinite where no block of the two stands out of their noise: files that show nothing agree in nothing.
    """
    files, lines, outputs = compared.values.shape
    size = min(_BLOCK_LINES, lines)
    blocks = lines // size

    def in_blocks(x: Array) -> RealArray:
        return np.asarray(x[..., : blocks * size, :].reshape(*x.shape[:-2], blocks, size, outputs).sum(axis=-2))

    noise = in_blocks(compared.variance)
    usual = np.maximum(in_blocks(np.abs(compared.values) ** 2).mean(axis=0), np.finfo(float).tiny)
    chance, independent = _FALSE_ALARM / (blocks * outputs), 2 * size / _DEPENDENT_LINES
    found = np.zeros((files, files))
    for i in range(1, files):
        freedom = np.minimum(np.minimum(compared.freedom[i], compared.freedom[:i]), _MANY)
        limit = special.fdtri(independent, freedom, 1 - chance)[:, None, None] * (noise[i] + noise[:i])
        apart = in_blocks(np.abs(compared.values[i] - compared.values[:i]) ** 2)
        beyond = np.max((apart - limit) / usual, axis=(1, 2))
        hidden = np.all(limit >= usual, axis=(1, 2))
        found[i, :i] = np.where(hidden, np.inf, np.sqrt(np.maximum(beyond, 0.0)))
    return found + found.T
