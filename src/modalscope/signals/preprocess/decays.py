"""Take records without forces that are free decays as what they are: from the release on, at the rate that their modes need.

A sensor or a structure that is not linear moves by more than its modes. Of z(t) = A(t) exp(j phase), the strongest tone of a decay, a law
x = z + a z^2 + b z^3 makes tones at two and three times its frequency, whose size goes as A^2 and A^3 and whose phase as twice and thrice
its own; and a stiffness that goes with the size makes ln z = c + s t + e int A^2 dt, whose frequency moves as it decays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.data.shown import percent
from modalscope.data.sizes import check_size
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.damped_tones import decays_of, one_in, without_offset
from modalscope.signals.preprocess.impacts import clipped_samples

#: Periods of the window that parts the multiples of a tone (a Hann window has zeros at all of them), and multiples that are looked at.
_PERIODS, _MAX_MULTIPLE = 4, 4

#: Windows that a decay needs, and the largest share of a tone that the law of a multiple leaves, also relative to what an exponential of
#: its own leaves, which has as many unknowns.
_MIN_WINDOWS, _MAX_LEFT, _TIMES_OWN = 6, 0.4, 1.5

#: A pole belongs to a multiple within this part of its frequency.
_MULTIPLE_REACH = 0.006

#: A frequency moves where one exponential leaves this many times what it leaves with a term of size, and two leave no less.
_MIN_GAIN = 3.0


class Tone(NamedTuple):
    """The strongest tone of a decay, its frequencies in cycles a sample.

    `frequency`, `damping`: at the end. `first`: both at the beginning where they go with the size of the motion, else None. `multiples`:
    those which it makes.
    """

    frequency: float
    damping: float
    first: tuple[float, float] | None
    multiples: tuple[int, ...]

    def holds(self, frequency: float, multiple: int = 1) -> bool:
        """Whether a frequency is that of the tone, at any size, or of its multiple."""
        f, ratio = self.frequency, frequency / multiple / self.frequency - 1
        moved = 0.0 if self.first is None else self.first[0] / f - 1
        reach = _MULTIPLE_REACH if multiple > 1 else 2 * max(self.damping, (self.first or (0.0, 0.0))[1])
        return min(moved, 0.0) - reach < ratio < max(moved, 0.0) + reach


def tone_of(y: RealArray) -> Tone | None:
    """Return the strongest tone of a decay (N, ...), by its largest channel; None where the decay is too short for it.

    Examples
    --------
    >>> t = np.arange(4000) / 200
    >>> x = np.exp(-0.1 * t) * np.cos(2 * np.pi * 8 * t)
    >>> tone = tone_of(x + 0.02 * x**2 + 1e-4 * np.random.default_rng(0).standard_normal(4000))
    >>> round(200 * tone.frequency, 2), tone.first, tone.multiples
    (8.0, None, (2,))
    """
    y = y.reshape(len(y), -1)
    x = y[:, int(np.argmax(np.var(y, axis=0)))]
    x = without_offset(x)
    count = 4 * len(x)
    f = max(int(np.argmax(np.abs(np.fft.rfft(x, count)))), 1) / count
    length, step = round(_PERIODS / f), max(1, int(0.3 / f))
    if len(x) < _MIN_WINDOWS * length:
        return None
    taps, t = np.hanning(length + 2)[1:-1], np.arange(len(x))
    whole = [x * np.exp(-2j * np.pi * k * f * t) for k in range(1, min(_MAX_MULTIPLE, int(0.5 / f)) + 1)]
    z, *others = (scipy.signal.oaconvolve(part, taps / taps.sum(), "valid")[::step] for part in whole)
    law, drift = _exponential(z, np.cumsum(np.abs(z) ** 2) / np.sum(np.abs(z) ** 2))
    turned, fallen = np.diff(np.unwrap(np.angle(law))), -np.diff(np.log(np.abs(law)))
    first, last = (
        (float(f + turned[k] / (2 * np.pi * step)), float(fallen[k] / (2 * np.pi * f * step))) for k in (0, -1)
    )
    moves = drift < min(_exponential(z)[1] / _MIN_GAIN, _TIMES_OWN * _two_exponentials(z))
    leaks = [np.exp(-2j * np.pi * k * f * step * np.arange(len(z))) * z for k in range(1, len(others) + 1)]
    made = [k for k, (other, leak) in enumerate(zip(others, leaks, strict=True), 2) if _follows(other, z**k, leak)]
    return Tone(*last, first if moves else None, tuple(made))


def _follows(x: ComplexArray, power: ComplexArray, leak: ComplexArray) -> bool:
    """Whether x goes as a power of the tone rather than by an exponential of its own, without what leaks of the tone."""
    x = x - leak * (np.vdot(leak, x) / np.vdot(leak, leak))
    return _left(x, power[:, None]) < min(_MAX_LEFT, _TIMES_OWN * _exponential(x)[1])


def _exponential(z: ComplexArray, *more: RealArray) -> tuple[ComplexArray, float]:
    """Return exp of the best combination of 1, t and more for ln z, weighed by its size, and the share of z that it leaves."""
    basis = np.stack([np.ones(len(z)), np.arange(len(z)) / len(z), *more], axis=1)
    size = np.abs(z) + np.finfo(float).tiny
    log = np.log(size) + 1j * np.unwrap(np.angle(z))
    found = np.exp(basis @ np.linalg.lstsq(basis * size[:, None], log * size, rcond=None)[0])
    return found, float(np.sum(np.abs(z - found) ** 2) / np.sum(size**2))


def _two_exponentials(z: ComplexArray) -> float:
    """Return the share of z that two exponentials leave, by the shift of their singular vectors."""
    z = z[:: max(1, len(z) // 300)]
    V = np.linalg.svd(np.lib.stride_tricks.sliding_window_view(z, len(z) // 3), full_matrices=False)[2][:2].T
    poles = np.linalg.eigvals(np.linalg.lstsq(V[:-1], V[1:], rcond=None)[0])
    return _left(z, poles ** np.arange(len(z))[:, None])


def _left(z: ComplexArray, basis: Array) -> float:
    """Return the share of z that no combination of columns explains."""
    basis = basis / np.linalg.norm(basis, axis=0)
    return float(np.sum(np.abs(z - basis @ np.linalg.lstsq(basis, z, rcond=None)[0]) ** 2) / np.sum(np.abs(z) ** 2))


def _after_clipping(run: RealArray) -> int:
    """Return the first sample of a decay (N, l) from which no channel reaches the limit at which it was clipped."""
    limits = [np.isin(x, [x.max(), x.min()]) for x in run.T if clipped_samples(x)]
    return 1 + max((int(np.flatnonzero(at)[-1]) for at in limits), default=-1)


def of_decays(signals: Signals, decays: Sequence[RealArray], what: str, rate: float) -> ImpulseResponse:
    """Return free decays (n, l) of the outputs of a record, at a rate (Hz), a column each, all cut to the shortest."""
    shortest = min(map(len, decays))
    names = {"input_dofs": tuple(f"{what} {k + 1}" for k in range(len(decays))), "units": (signals.units[0], None)}
    fields: dict[str, Any] = {**signals.labelled(), **names, "quantity": signals.quantity, "kind": "free decay"}
    return ImpulseResponse(values=np.stack([y[:shortest] for y in decays], axis=2), sampling_rate=rate, **fields)


def as_free_decay(
    signals: Signals, judged: Signals | None = None
) -> tuple[Signals | ImpulseResponse, tuple[Note, ...]]:
    """Return a record as free decays, one column per run, and notes; unchanged where a run is none, or a force was measured.

    `judged`: the channels that decide it, where others will be excluded.

    The modes of a decay are exponentials themselves. As ambient vibration its correlations would average over what is left of it.
    """
    check_size(signals)
    outputs, inputs = signals.by_run()
    if inputs is not None:
        return signals, ()
    looked = outputs if judged is None else judged.by_run()[0]
    cut = max(map(_after_clipping, looked))
    decays = decays_of(looked[:, cut:]) if cut <= signals.samples // 2 else None
    if cut and decays is None:
        cut, decays = 0, decays_of(looked)
    if decays is None:
        return signals, ()
    outputs = outputs[:, cut:]
    step, start = decays[0].step, (cut + decays[0].first) / signals.sampling_rate
    samples: list[RealArray] = [decay.samples for decay in decays]
    if judged is not None:
        samples = [
            one_in(without_offset(y), step)[decay.first // step :] for y, decay in zip(outputs, decays, strict=True)
        ]
    unexplained = max(decay.unexplained for decay in decays)
    where = f"from {start:.4g} s on" if len(decays) == 1 else f"of {len(decays)} runs, each from its release on"
    text = (
        f"Taken as a free decay {where}{' (clipped before)' if cut else ''}, no force: damped tones explain "
        f"{percent(1 - unexplained)} of it. If it is ambient vibration, say so: --route correlation"
    )
    response = of_decays(signals, samples, "run", signals.sampling_rate / step)
    what = "cut to its free decay" + ("" if step == 1 else f", low-pass filtered, one sample in {step} kept")
    notes = (
        Note("free decay", {"start": start, "step": step}, text),
        *_notes_on(looked[0, cut + decays[0].first :], signals),
    )
    return response.processed(what), notes


def _notes_on(y: RealArray, signals: Signals) -> tuple[Note, ...]:
    """Return what is not linear in a decay (N, l): multiples of its strongest tone, and how far its frequency moves."""
    tone, rate = tone_of(y), signals.sampling_rate
    if tone is None:
        return ()
    notes = []
    if tone.multiples:
        listed = ", ".join(f"{k * tone.frequency * rate:.4g}" for k in tone.multiples)
        text = (
            f"Distortion, no modes: {listed} Hz, multiples of {tone.frequency * rate:.4g} Hz whose size and phase follow from it "
            "(a sensor beyond its range, or large motion; of structures a string alone has modes there)"
        )
        notes.append(Note("multiples", {"hz": tone.frequency * rate}, text))
    if tone.first:
        (low, damped), f = tone.first, tone.frequency
        text = (
            f"One mode that depends on amplitude: {low * rate:.5g} Hz, damping {percent(damped, 2)} at the start, "
            f"{f * rate:.5g} Hz, {percent(tone.damping, 2)} at the end"
        )
        notes.append(Note("goes with size", {"first_hz": low * rate, "last_hz": f * rate}, text))
    return tuple(notes)
