"""Examine measured data before identification: run all checks of records and responses, and collect their findings."""

from __future__ import annotations

import numpy as np

from modalscope.data.notes import Finding
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_size
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.doctor.delays import delayed, exchanged, late
from modalscope.doctor.findings import dead_channels, finding, identical_channels, sides_of
from modalscope.doctor.places import same_places
from modalscope.doctor.records import bad_hits, clipped, leakage, noisy_channels, too_short, transposed
from modalscope.doctor.responses import examine_response
from modalscope.doctor.samples import frozen, lone_outputs, slips, spikes, wrapped
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_kind
from modalscope.numerics.errors import DataError
from modalscope.preprocess.bands import swept_lines, useful_lines
from modalscope.preprocess.excitation import EVENT, find_excitation, powers_of_stretches
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.spectra import Segments, cross_spectra

# ------------------------------------------------------------------------------------------------------------- examine

#: Findings of responses that are searched in the response estimated from a record; the record itself shows the others.
_SHOWN_BY_RESPONSES = {"low coherence", "reciprocity", "polarity", "swapped", "wrong quantity"}


@named()
def examine(data: Signals | StoredSignals | StoredResponse | Records | Setups | Response) -> tuple[Finding, ...]:
    """Look for what commonly goes wrong in a test: each finding names channels and reason, and says what to do.

    Looked for are overloaded, double and clipped hits, clipped, dead, noisy, duplicate and swapped channels, converters that
    overflowed, values that hold and gaps, missing samples, spikes, outputs that come late, forces taken for responses, arrays that
    are transposed, conjugate, without phase, or levels and angles instead of complex values, lines that stand alone, events that
    outweigh a record without inputs, wrong polarity, leakage, low coherence, responses that are not reciprocal, a quantity that cannot
    be right, records too short for the damping in them. What of these can be seen depends on the data: polarity needs driving points,
    reciprocity two inputs at output dofs.

    Parameters
    ----------
    data : Signals, StoredSignals, StoredResponse, Records, Setups, FrequencyResponse or ImpulseResponse
        Of a stored record a stretch from its middle is examined, of stored responses some outputs.

    Returns
    -------
    tuple of Finding
        Empty for clean data.

    Examples
    --------
    >>> import numpy as np
    >>> y = np.random.default_rng(0).standard_normal((1000, 3))
    >>> y[:, 1] = 0.0
    >>> for finding in examine(Signals(outputs=y, sampling_rate=10.0)):
    ...     print(finding)
    dead: y2: it never changes. Check cable and sensor, or leave it out: exclude=['y2'].
    """
    kinds = (FrequencyResponse, ImpulseResponse, Signals, StoredSignals, StoredResponse, Records, Setups)
    check_kind("examine", data, kinds)
    if isinstance(data, StoredSignals | StoredResponse):
        data = data.excerpt()
    check_size(data)
    if isinstance(data, Response):
        return tuple(examine_response(data.picture()))
    if isinstance(data, Records | Setups):
        parts = data.stacked() if isinstance(data, Records) else data.parts
        return tuple(dict.fromkeys(each for part in parts for each in _examine_record(part)))
    return tuple(_examine_record(data))


def _examine_record(signals: Signals) -> list[Finding]:
    found = transposed(signals)
    if found:  # all other checks take columns for channels
        return found
    kind = "ambient" if signals.inputs is None else find_excitation(signals)
    moving_channels: dict[str, list[int]] = {}
    for side, columns, labels in sides_of(signals):
        constant = dead_channels(columns, labels)
        dead = {each.channels[0] for each in constant}
        moving_channels[side] = [i for i, dof in enumerate(labels) if dof not in dead]
        found += constant + identical_channels(columns, labels)
    lone = lone_outputs(signals) if kind in ("random", "ambient") else []
    overflows = wrapped(signals, lone)
    found += clipped(signals, kind) + overflows + frozen(signals)
    found += spikes(signals, kind, {each.channels[0] for each in overflows}, lone)
    if not all(moving_channels.values()):
        return found
    moving = signals.select(**{f"{side}s": chosen for side, chosen in moving_channels.items()})
    found += events(moving) + slips(moving, kind)
    turned = exchanged(moving) if kind != "sweep" else []
    found += turned or delayed(moving) or (late(moving) if kind in ("random", "burst") else [])
    if kind == "impact":
        found += bad_hits(signals)
    if kind in ("impact", "burst"):
        found += leakage(moving, kind)
    short = too_short(moving) if kind in ("random", "ambient") else []
    found += short
    forced = signals.inputs is not None and len(moving_channels["input"]) == len(signals.input_dofs) and not turned
    changed = changed_runs(moving) if forced else []
    found += changed
    # a change between runs lowers the coherence too: one cause, one finding; another place of the force changes all outputs
    explained = {dof for each in changed for dof in each.channels}
    if any(each.kind == "places" for each in changed):
        explained.update(moving.output_dofs)
    noisy = [each for each in noisy_channels(moving, kind) if each.channels[0] not in explained]
    found += noisy
    if forced:
        found += _of_response(moving, kind, bool(short), explained | {each.channels[0] for each in noisy})
    return found


def _of_response(signals: Signals, kind: str, short: bool, explained: set[str]) -> list[Finding]:
    """Return what the estimated response shows in addition to the record; low coherence only where nothing else explains it."""
    if signals.runs == 1 and signals.samples < 64 * len(signals.input_dofs):
        return []
    try:
        response = estimate_frf(signals)
    except DataError:  # dependent inputs, or no usable hit: an error where the response is asked for
        return []
    # a zero-order hold delays the force by half a sample, which turns phases in the upper half of the spectrum
    lines = response.frequencies <= signals.sampling_rate / 4
    if kind == "impact":
        lines &= useful_lines(signals, response.frequencies)
    elif kind in ("sweep", "burst"):
        lines &= swept_lines(signals, response.frequencies)
    return [
        each
        for each in examine_response(response.at_lines(lines))
        if each.kind in _SHOWN_BY_RESPONSES
        and not (each.kind == "low coherence" and (short or each.channels[0] in explained))
    ]


# -------------------------------------------------------------------------------------------------------------- events

#: A stretch belongs to the event where its power is so many times that of the median stretch.
_LOUD = 4.0


def events(signals: Signals) -> list[Finding]:
    """Find an earthquake, a blow or a passage that dominates a record without inputs, of one run (see `powers_of_stretches`)."""
    outputs, inputs = signals.by_run()
    if inputs is not None or len(outputs) != 1:
        return []
    each = powers_of_stretches(outputs[0])
    uneven = float(np.var(each))
    if uneven <= EVENT:
        return []
    largest = int(np.argmax(each))
    quiet = np.flatnonzero(each <= _LOUD * np.median(each))
    first = int(np.max(quiet[quiet < largest], initial=-1)) + 1
    last = int(np.min(quiet[quiet > largest], initial=len(each)))
    seconds = signals.samples // len(each) / signals.sampling_rate
    return [
        finding(
            "event",
            *signals.output_dofs,
            share=100 * float(each[first:last].sum() / each.sum()),
            start=first * seconds,
            stop=last * seconds,
            worth=signals.samples / signals.sampling_rate / (1 + uneven),
        )
    ]


# ---------------------------------------------------------------------------------------------------------------- runs
# Changes from one run of a test to another.

#: Real correlation of an output of a single run, without averages, with the same output in the others.
_ALIKE = 0.5


def changed_runs(signals: Signals) -> list[Finding]:
    """Compare the runs of a test with one input: forces at other places, outputs of opposite sign, or two that were exchanged."""
    if signals.runs < 2 or len(signals.input_dofs) > 1:
        return []
    places = same_places([signals])
    driven = sorted({place for place in places if place is not None})
    if len(driven) < 2:
        return _changed_channels(signals) if signals.runs > 2 else []
    runs = [", ".join(str(k + 1) for k, own in enumerate(places) if own == place) for place in driven]
    return [finding("places", *signals.input_dofs, runs=" | ".join(runs), count=len(runs))]


def _changed_channels(signals: Signals) -> list[Finding]:
    """Compare the outputs of every run with the median of the other runs by their real correlations."""
    outputs, inputs = signals.by_run()
    assert inputs is not None
    tiny = np.finfo(float).tiny
    segments = Segments.of(signals.samples, signals.samples)
    rows = []
    for y, u in zip(outputs, inputs, strict=True):
        S = cross_spectra(y[None], u[None], signals.sampling_rate, segments)
        rows.append(S.cross[:, :, 0] / np.maximum(np.sqrt(S.inputs[:, 0, 0].real), tiny)[:, None])
    shape = np.array(rows)
    shape /= np.maximum(np.linalg.norm(shape, axis=1, keepdims=True), tiny)
    found, dofs = [], signals.output_dofs
    for r in range(signals.runs):
        others = np.delete(shape, r, axis=0)
        usual = np.median(others.real, axis=0) + 1j * np.median(others.imag, axis=0)
        # [i, j]: of the median output i with output j of this run
        likeness = (usual.conj().T @ shape[r]).real / np.maximum(np.linalg.norm(usual, axis=0), tiny)[:, None]
        same = np.diag(likeness)
        for i, dof in enumerate(dofs):
            if same[i] < -_ALIKE:
                found.append(finding("polarity: run", dof, run=r + 1))
            found += [
                finding("swapped: run", dofs[j], dof, run=r + 1)
                for j in range(i)
                if min(likeness[i, j], likeness[j, i]) > max(_ALIKE, 2 * same[i], 2 * same[j])
            ]
    return found
