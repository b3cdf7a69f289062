"""The measurement doctor: what is wrong with records and responses, before anything is identified from them."""

from __future__ import annotations

from modalscope.model.checks import DataError, check_kind
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.keywords import named
from modalscope.model.records import Records
from modalscope.model.response import Response
from modalscope.model.setups import Setups
from modalscope.model.signals import Signals
from modalscope.model.sizes import check_size
from modalscope.model.stored import StoredSignals
from modalscope.model.stored_response import StoredResponse
from modalscope.preprocess.causality_checks import delayed, exchanged
from modalscope.preprocess.driven_band import swept_lines, useful_lines
from modalscope.preprocess.event_checks import events
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.findings import Finding, dead_channels, identical_channels, sides_of
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.late_checks import late
from modalscope.preprocess.lone_checks import lone_outputs
from modalscope.preprocess.record_checks import (
    bad_hits,
    clipped,
    leakage,
    noisy_channels,
    too_short,
    transposed,
)
from modalscope.preprocess.response_checks import examine_response
from modalscope.preprocess.run_checks import changed_runs
from modalscope.preprocess.sample_checks import frozen, spikes, wrapped
from modalscope.preprocess.slip_checks import slips

__all__ = ["examine"]


#: What is looked for in the response that a record gives; the rest is seen in the record itself.
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
        Of a stored record a stretch from its middle is looked at, of stored responses some outputs.

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
        return tuple(dict.fromkeys(finding for part in parts for finding in _examine_record(part)))
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
    lone = lone_outputs(signals) if kind in ("random", "ambient") else []
    overflown = wrapped(signals, lone)
    found += clipped(signals, kind) + overflown + frozen(signals)
    found += spikes(signals, kind, {finding.channels[0] for finding in overflown}, lone)
    if not all(alive.values()):
        return found
    moving = signals.select(**{f"{side}s": kept for side, kept in alive.items()})
    found += events(moving) + slips(moving, kind)
    turned = exchanged(moving) if kind != "sweep" else []
    apart = [] if turned else delayed(moving)
    found += turned or apart or (late(moving) if kind in ("random", "burst") else [])
    forced = signals.inputs is not None and len(alive["input"]) == len(signals.input_dofs) and not turned
    if kind == "impact":
        found += bad_hits(signals)
    if kind in ("impact", "burst"):
        found += leakage(moving, kind)
    short = too_short(moving) if kind in ("random", "ambient") else []
    found += short
    changed = changed_runs(moving) if forced else []
    found += changed
    # what a change between runs does to coherence is no finding of its own
    explained = {dof for finding in changed for dof in (*finding.channels, *_all_outputs(finding, moving))}
    noisy = [finding for finding in noisy_channels(moving, kind) if finding.channels[0] not in explained]
    found += noisy
    if forced:
        found += _of_response(moving, bool(short), explained | {finding.channels[0] for finding in noisy})
    return found


def _all_outputs(finding: Finding, signals: Signals) -> tuple[str, ...]:
    """Return the outputs when a finding on the forces concerns every one of them."""
    return signals.output_dofs if finding.kind == "places" else ()


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
    elif find_excitation(signals) in ("sweep", "burst"):
        lines &= swept_lines(signals, response.frequencies)
    response = response.at_lines(lines)
    found = [finding for finding in examine_response(response) if finding.kind in _SHOWN_BY_RESPONSES]
    # coherence falls at resonances that a short record does not resolve, and with noise: one cause, one finding
    found = [f for f in found if not (f.kind == "low coherence" and (short or f.channels[0] in explained))]
    return found
