"""The measurement doctor: what is wrong with records and responses, before anything is identified from them."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import DataError, RealArray, check_kind
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.keywords import named
from modalscope.model.records import Records
from modalscope.model.response import Response
from modalscope.model.signals import Signals
from modalscope.model.sizes import check_size
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.findings import Finding, dead_channels, identical_channels, sides_of
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.record_checks import (
    bad_hits,
    clipped,
    leakage,
    noisy_channels,
    too_short,
    transposed,
    useful_lines,
)
from modalscope.preprocess.response_checks import examine_response
from modalscope.preprocess.sample_checks import frozen, spikes, wrapped
from modalscope.preprocess.spectra import Segments, cross_spectra, window_samples

__all__ = ["examine"]


#: Outputs of single runs, untouched by averaging, are this much like what they were in the others, or more.
_ALIKE = 0.5

#: What is looked for in the response that a record gives; the rest is seen in the record itself.
_SHOWN_BY_RESPONSES = {"low coherence", "reciprocity", "polarity", "swapped", "wrong quantity"}


@named()
def examine(data: Signals | Records | Response) -> tuple[Finding, ...]:
    """Look for what commonly goes wrong in a test: each finding names channels and reason, and says what to do.

    Looked for are overloaded, double and clipped hits, clipped, dead, noisy, duplicate and swapped channels, converters that
    overflowed, values that hold and gaps, spikes, arrays that are transposed, conjugate or without phase, lines that stand alone,
    wrong polarity, leakage, low coherence, responses that are not reciprocal, a quantity that cannot be right, records too short for the
    damping in them. What of these can be seen depends on the data: polarity needs driving points, reciprocity two
    inputs at output dofs.

    Parameters
    ----------
    data : Signals, Records, FrequencyResponse or ImpulseResponse

    Returns
    -------
    tuple of Finding
        Empty for clean data.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((1000, 3))
    >>> y[:, 1] = 0.0
    >>> for finding in examine(Signals(outputs=y, sampling_rate=10.0)):
    ...     print(finding)
    dead: y2: it never changes. Check cable and sensor, or leave it out: exclude=['y2'].
    """
    check_kind("examine", data, (FrequencyResponse, ImpulseResponse, Signals, Records))
    check_size(data)
    if isinstance(data, Response):
        return tuple(examine_response(data.picture()))
    if isinstance(data, Records):
        return tuple(dict.fromkeys(finding for run in data.runs for finding in _examine_record(run)))
    return tuple(_examine_record(data))


def _examine_record(signals: Signals) -> list[Finding]:
    found = transposed(signals)
    if found:  # the others would speak of what are no channels
        return found
    kind = "ambient" if signals.inputs is None else find_excitation(signals)
    alive: dict[str, list[int]] = {}
    for side, flat, labels in sides_of(signals):
        at_rest = dead_channels(flat, labels)
        dead = [finding.channels[0] for finding in at_rest]
        alive[side] = [i for i, dof in enumerate(labels) if dof not in dead]
        found += at_rest + identical_channels(flat, labels)
    overflown = wrapped(signals)
    found += clipped(signals, kind) + overflown + frozen(signals)
    found += spikes(signals, kind, {finding.channels[0] for finding in overflown})
    if not all(alive.values()):
        return found
    moving = signals.select(**{f"{side}s": kept for side, kept in alive.items()})
    forced = signals.inputs is not None and len(alive["input"]) == len(signals.input_dofs)
    if kind == "impact":
        found += bad_hits(signals)
    if kind in ("impact", "burst"):
        found += leakage(moving)
    short = too_short(moving) if kind in ("random", "ambient") else []
    found += short
    changed = _runs(moving) if forced else []
    found += changed
    # what a change between runs does to coherence is no finding of its own
    explained = {dof for finding in changed for dof in finding.channels}
    noisy = [finding for finding in noisy_channels(moving, kind) if finding.channels[0] not in explained]
    found += noisy
    if forced:
        found += _of_response(moving, bool(short), explained | {finding.channels[0] for finding in noisy})
    return found


def _of_response(signals: Signals, short: bool, explained: set[str]) -> list[Finding]:
    """Return what the estimated response shows beyond what its record did."""
    assert signals.inputs is not None
    if signals.runs == 1 and signals.samples < 64 * len(signals.input_dofs):
        return []
    try:
        response = estimate_frf(signals)
    except DataError:  # inputs that cannot be told apart, or no usable hit: an error of its own where it is asked for
        return []
    # a held force comes half a sample late, which turns phases in the upper half of the spectrum
    lines = response.frequencies <= signals.sampling_rate / 4
    if find_excitation(signals) == "impact":
        lines &= useful_lines(signals, response.frequencies)
    response = response.at_lines(lines)
    found = [finding for finding in examine_response(response) if finding.kind in _SHOWN_BY_RESPONSES]
    # coherence falls at resonances that a short record does not resolve, and with noise: one cause, one finding
    found = [f for f in found if not (f.kind == "low coherence" and (short or f.channels[0] in explained))]
    return found


def _runs(signals: Signals) -> list[Finding]:
    """Compare the runs of one test with their mean: an output of other sign, or two that changed places."""
    if signals.runs < 3 or len(signals.input_dofs) > 1:
        return []
    outputs, inputs = signals.by_run()
    assert inputs is not None
    w = window_samples("hann", signals.samples)
    segments = Segments([0], w, w)
    rows = []
    for y, u in zip(outputs, inputs, strict=True):
        S = cross_spectra(y[None], u[None], signals.sampling_rate, segments)
        rows.append(S.cross[:, :, 0] / np.maximum(np.sqrt(S.inputs[:, 0, 0].real), np.finfo(float).tiny)[:, None])
    shape = np.array(rows)
    shape /= np.maximum(np.linalg.norm(shape, axis=1, keepdims=True), np.finfo(float).tiny)
    found = []
    for r in range(signals.runs):
        usual = np.median(np.delete(shape, r, axis=0).real, axis=0) + 1j * np.median(
            np.delete(shape, r, axis=0).imag, axis=0
        )
        size = np.maximum(np.linalg.norm(usual, axis=0), np.finfo(float).tiny)
        likeness = (usual.conj().T @ shape[r]).real / size[:, None]
        found += _changed(likeness, signals, r)
    return found


def _changed(likeness: RealArray, signals: Signals, run: int) -> list[Finding]:
    """Read off the real correlations (usual output, output of this run) what changed in a run."""
    found, own = [], np.diag(likeness)
    for i, dof in enumerate(signals.output_dofs):
        if own[i] < -_ALIKE:
            found.append(
                Finding(
                    "polarity",
                    (dof,),
                    f"in run {run + 1} it has the opposite sign of the other runs",
                    "Turn its sign in that run, or leave the run out.",
                )
            )
        found += [
            Finding(
                "swapped",
                (signals.output_dofs[j], dof),
                f"in run {run + 1} they have changed places",
                "Exchange them in that run, or leave the run out.",
            )
            for j in range(i)
            if min(likeness[i, j], likeness[j, i]) > max(_ALIKE, 2 * own[i], 2 * own[j])
        ]
    return found
