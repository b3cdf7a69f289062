"""Outputs that come late after the forces: their impulse responses begin with a jump, and after the same lag."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import fft

from modalscope.model.checks import RealArray
from modalscope.model.signals import Signals
from modalscope.preprocess.findings import Finding
from modalscope.preprocess.spectra import Segments, cross_spectra, segment_starts, window_samples

__all__ = ["Lateness", "late", "lateness"]

#: Samples of a run, and runs, that are looked at; segments that impulse responses are averaged over, and their least and greatest length.
_SAMPLES, _RUNS, _SEGMENTS = 1 << 16, 4, 12
_SHORTEST, _LONGEST = 128, 2048

#: Power of the forces on a line below this part of the greatest is made up to it: there is nothing to divide by.
_QUIET = 1e-3

#: A response has begun where it exceeds so many deviations of what is seen before lag 0 (of all outputs together chance is level, and fewer
#: are enough), and this part of its greatest value.
_BEGUN, _TOGETHER, _PART = 6.0, 3.0, 0.2

#: It began with a jump where what came more than two lags before is so many times smaller: motion that grows from rest does not jump.
_JUMP = 4.0

#: Fewer samples are poles at z = 0, which the identification tells itself; of single outputs motion far from the forces may grow so long.
_LEAST, _LEAST_ALONE = 5, 10


class Lateness(NamedTuple):
    """Samples by which outputs come late after the forces.

    Attributes
    ----------
    together : bool
        Whether all outputs come late alike.
    samples : mapping of label to int
        Of every output that does; empty where none does.
    """

    together: bool
    samples: dict[str, int]


def late(signals: Signals) -> list[Finding]:
    """Find outputs whose response to the forces begins some samples late, all of them alike or a few; see `lateness`.

    Parameters
    ----------
    signals : Signals
        With broadband forces.
    """
    found, rate = lateness(signals), signals.sampling_rate
    back = "Modes are identified with that taken out, which moves neither poles nor shapes; delays={} (--delays none) leaves it in."
    if found.together:
        lag = next(iter(found.samples.values()))
        reason = f"all outputs come about {lag} samples, {lag / rate:.4g} s, after the forces"
        return [Finding("delay", signals.output_dofs, reason, back)]
    return [
        Finding(
            "delay", (dof,), f"it comes about {own} samples, {own / rate:.4g} s, after the forces, others do not", back
        )
        for dof, own in found.samples.items()
    ]


def lateness(signals: Signals) -> Lateness:
    """Return by how many samples the responses of outputs to the forces begin late.

    The impulse response of acceleration begins with the direct term at lag 0, that of velocity with the shapes at lag 1; that of
    displacement grows from nothing and says nothing here. Recorders that started apart, and buffers, shift it.

    Parameters
    ----------
    signals : Signals
        With broadband forces.
    """
    outputs, inputs = signals.by_run()
    length = min(signals.samples // (_SEGMENTS // 2 + 1), _LONGEST)
    if inputs is None or length < _SHORTEST:
        return Lateness(False, {})
    y, u = (x[:_RUNS, :_SAMPLES] - x[:_RUNS, :_SAMPLES].mean(axis=1, keepdims=True) for x in (outputs, inputs))
    size = _responses(y, u, length)
    together = np.sqrt(np.mean((size / np.maximum(size.max(axis=0), 1e-300)) ** 2, axis=1))
    lag = _onset(together, _TOGETHER)
    if lag >= _LEAST:
        return Lateness(True, dict.fromkeys(signals.output_dofs, lag))
    if lag < 0:
        return Lateness(False, {})
    alone = {dof: _onset(own, _BEGUN) for dof, own in zip(signals.output_dofs, size.T, strict=True)}
    return Lateness(False, {dof: own for dof, own in alone.items() if own >= _LEAST_ALONE})


def _responses(outputs: RealArray, inputs: RealArray, length: int) -> RealArray:
    """Return the size of the impulse response of every output to all forces, (length, l), negative lags last."""
    w = window_samples("hann", length)
    level = inputs / np.maximum(np.sqrt(np.mean(inputs**2, axis=(0, 1))), 1e-300)
    S = cross_spectra(outputs, level, 1.0, Segments(segment_starts(outputs.shape[1], length, 0.5), w, w))
    power = np.einsum("fii->f", S.inputs).real
    made_up = _QUIET * power.max() * np.eye(S.inputs.shape[1])
    H = np.linalg.solve((S.inputs + made_up).transpose(0, 2, 1), S.cross.transpose(0, 2, 1)).transpose(0, 2, 1)
    return np.asarray(np.linalg.norm(fft.irfft(H, n=length, axis=0), axis=2))


def _onset(size: RealArray, begun: float) -> int:
    """Return the lag at which a response begins with a jump; -1 where it does not, or is not seen."""
    length = len(size)
    after, chance = size[: length // 4], np.sqrt(np.mean(size[-length // 4 : -length // 16] ** 2))
    above = np.flatnonzero(after > max(begun * chance, _PART * after.max()))
    if not above.size:
        return -1
    first = int(above[0])
    earlier = np.concatenate([size[-8:], after[: max(first - 2, 0)]])
    if after[first : first + 2].max() <= _JUMP * earlier.max():
        return -1
    begun_at = np.flatnonzero(after[max(first - 2, 0) : first + 1] > begun * chance)
    return max(first - 2, 0) + int(begun_at[0])
