"""The measurement doctor: what is wrong with records and responses, before anything is identified from them."""

from __future__ import annotations

import numpy as np

from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_size
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.doctor.delays import delayed, exchanged, late
from modalscope.doctor.findings import Finding, dead_channels, identical_channels, sides_of
from modalscope.doctor.places import same_places
from modalscope.doctor.records import bad_hits, clipped, leakage, noisy_channels, too_short, transposed
from modalscope.doctor.responses import examine_response
from modalscope.doctor.samples import frozen, lone_outputs, slips, spikes, wrapped
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray, check_kind
from modalscope.numerics.errors import DataError
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.excited_band import swept_lines, useful_lines
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.spectra import Segments, cross_spectra, window_samples

__all__ = ["events", "examine"]


# -------------------------------------------------------------------------------------------------------- event checks
# Events in records of random vibration: what is as strong as all the rest leaves nothing of the length that was recorded.

#: Stretches of a record, and the squared coefficient of variation of their power above which it has an event. Were every stretch's power
#: exponential, as that of a mode which outlasts it, 25 of a million records would have so much by chance.
_STRETCHES, _UNEVEN = 40, 4.0

#: A stretch belongs to the event where its power is so many times that of the usual one.
_LOUD = 4.0


def events(signals: Signals) -> list[Finding]:
    """Find an earthquake, a blow or a passage in a record without inputs, one run, that outweighs the rest.

    With p the power of equal stretches, averages over the record scatter as if it lasted T (sum p)^2 / (n sum p^2) = T / (1 + c^2). Every
    channel counts alike, its power over its mean; the median of channels is taken, for faults of single channels are other findings.

    Parameters
    ----------
    signals : Signals
    """
    outputs, inputs = signals.by_run()
    size = outputs.shape[1] // _STRETCHES
    if inputs is not None or len(outputs) != 1 or size < 2:
        return []
    y = outputs[0, : size * _STRETCHES] - outputs[0].mean(axis=0)
    power = np.mean(y.reshape(_STRETCHES, size, -1) ** 2, axis=1)
    each = np.median(power / np.maximum(power.mean(axis=0), np.finfo(float).tiny), axis=1)
    each = each / max(float(each.mean()), np.finfo(float).tiny)
    uneven = float(np.var(each))
    if uneven <= _UNEVEN:
        return []
    loud = each > _LOUD * np.median(each)
    seconds = size / signals.sampling_rate
    first, last = int(np.argmax(each)), int(np.argmax(each)) + 1
    while first > 0 and loud[first - 1]:
        first -= 1
    while last < _STRETCHES and loud[last]:
        last += 1
    share = 100 * float(each[first:last].sum() / each.sum())
    worth = signals.samples / signals.sampling_rate / (1 + uneven)
    return [
        Finding(
            "event",
            signals.output_dofs,
            f"{share:.0f} % of the power lies between {first * seconds:.4g} and {last * seconds:.4g} s: averages over the record are "
            f"worth no more than {worth:.3g} s of steady vibration",
            "Cut the event out, and give the parts before and after it as runs, merge([...]); or identify it by itself. A free decay is "
            "one from its release on: --rows FIRST- --columns \"time=1,decay=2-\", or ImpulseResponse(..., kind='free decay').",
        )
    ]


# ---------------------------------------------------------------------------------------------------------- run checks
# What changed from one run of a test to another.

#: Outputs of single runs, untouched by averaging, are this much like what they were in the others, or more.
_ALIKE = 0.5


def changed_runs(signals: Signals) -> list[Finding]:
    """Compare the runs of one test: forces elsewhere, an output of other sign than usual, or two that changed places.

    Parameters
    ----------
    signals : Signals
        With inputs.
    """
    if signals.runs < 2 or len(signals.input_dofs) > 1:
        return []
    elsewhere = _elsewhere(signals)
    return elsewhere or (_of_channels(signals) if signals.runs > 2 else [])


def _elsewhere(signals: Signals) -> list[Finding]:
    """Say which runs were driven at other places."""
    places = same_places([signals])
    driven = sorted({place for place in places if place is not None})
    if len(driven) < 2:
        return []
    runs = [", ".join(str(k + 1) for k, own in enumerate(places) if own == place) for place in driven]
    return [
        Finding(
            "places",
            signals.input_dofs,
            f"runs {' | '.join(runs)} are as if driven at {len(runs)} places: alike line by line, as wholes not",
            "Give every place a file, or its own label: input_dofs, --input-dofs.",
        )
    ]


def _of_channels(signals: Signals) -> list[Finding]:
    """Compare every run with what is usual."""
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


# ------------------------------------------------------------------------------------------------------------- quality

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
