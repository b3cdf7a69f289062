"""A shaker test as it is measured: two correlated forces on a structure of many light modes, anti-aliasing filters, noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, chirp, fftconvolve, firwin, lfilter

from modalscope.data import Signals
from modalscope.numerics.functions.poles import poles_from

__all__ = ["Shaker", "forces_of", "shaker"]

#: Sampling rate of the simulation over that of the record.
OVER = 8

#: Shape of the anti-aliasing filter's window: 110 dB beyond its stop band, as converters have. What less would fold back of the forces is
#: noise on the inputs.
STOPPED = 11.0


@dataclass(frozen=True, eq=False)
class Shaker:
    """Modes that are known, and the record of a test of them.

    Parameters
    ----------
    frequencies, damping_ratios : array (n,)
    shapes : array (l, n)
        Real.
    signals : Signals
        Accelerations and forces.
    """

    frequencies: np.ndarray
    damping_ratios: np.ndarray
    shapes: np.ndarray
    signals: Signals


def shaker(
    seed: int,
    *,
    modes: int = 12,
    outputs: int = 20,
    seconds: float = 8.0,
    rate: float = 1024.0,
    correlation: float = 0.4,
    noise: float = 0.01,
    forces: np.ndarray | None = None,
    unmeasured: float = 0.0,
    input_noise: float = 0.0,
) -> Shaker:
    """Return a test of a structure of `modes` modes of .1 to .7 % between .04 and .4 of the sampling rate.

    Every mode is simulated exactly at eight times the rate under forces held between those samples; forces and responses go through
    the same anti-aliasing filter before they are decimated. The structure has vibrated for two seconds when the record begins.

    Parameters
    ----------
    forces : array (samples, 2), optional
        At eight times the rate, with two seconds ahead; correlated white noise by default.
    unmeasured : float
        Root mean square of a third force over that of the first two.
    input_noise : float
        Noise on the measured forces over their own root mean square.
    """
    rng = np.random.default_rng(seed)
    steps = np.sort(rng.uniform(0, 1, modes)) * 0.6 + 0.4 * np.arange(modes) / modes
    f = rate * (0.04 + 0.36 * steps)
    zeta = np.exp(rng.uniform(np.log(0.001), np.log(0.007), modes))
    shapes = rng.standard_normal((outputs, modes))
    drive = np.vstack([shapes[:2], rng.standard_normal(modes)])
    high, ahead = OVER * rate, int(2 * OVER * rate)
    total = ahead + int(seconds * high)
    if forces is None:
        forces = rng.standard_normal((total, 2)) @ np.linalg.cholesky([[1, correlation], [correlation, 1]]).T
    size = np.sqrt(np.mean(forces**2))
    third = unmeasured * size * rng.standard_normal(total)
    every = np.column_stack([forces, third])
    accelerations = np.column_stack(
        [_acceleration(s, every @ drive[:, j], high) for j, s in enumerate(poles_from(f, zeta))]
    )
    filtered = fftconvolve(
        np.hstack([accelerations, forces]),
        firwin(1025, 0.45 * rate, fs=high, window=("kaiser", STOPPED))[:, None],
        mode="same",
        axes=0,
    )[ahead::OVER]
    y, u = filtered[:, :modes] @ shapes.T, filtered[:, modes:]
    y = y + noise * np.sqrt(np.mean(y**2, axis=0)) * rng.standard_normal(y.shape)
    u = u + input_noise * np.sqrt(np.mean(u**2, axis=0)) * rng.standard_normal(u.shape)
    record = Signals(outputs=y, inputs=u, sampling_rate=rate, quantities="acceleration")
    return Shaker(f, zeta, shapes, record)


def _acceleration(pole: complex, force: np.ndarray, rate: float) -> np.ndarray:
    """Return q'' of q'' - 2 Re(s) q' + |s|^2 q = p under a force held between samples: p minus what velocity and displacement give."""
    z = np.exp(pole / rate)
    # q = Im(s) part of one complex state x' = s x + p, q' and q follow from it: q = Im x / Im s, q' = Im(s x) / Im s
    x = lfilter([0, (z - 1) / pole], [1, -z], force.astype(complex))
    q, velocity = x.imag / pole.imag, (pole * x).imag / pole.imag
    return force + 2 * pole.real * velocity - abs(pole) ** 2 * q


def forces_of(kind: str, seed: int = 0, *, seconds: float = 8.0, rate: float = 1024.0) -> np.ndarray:
    """Return two forces (samples, 2) at eight times the rate, two seconds ahead of a record: what shakers and nature do.

    "burst": white noise that stops at two fifths of the record; "sweep": one up, one down; "earthquake": noise of a band under the
    envelope of a tremor; "stepped": forty sines one after the other, left and right in turn, none of them settled; "release": one load let
    go at the beginning, another in the middle.
    """
    rng, high = np.random.default_rng(seed), OVER * rate
    t = np.arange(int((seconds + 2) * high)) / high - 2
    noise, on = rng.standard_normal((t.size, 2)), (t > 0)[:, None]
    if kind == "burst":
        return noise * (on & (t < 0.4 * seconds)[:, None])
    if kind == "sweep":
        both = [chirp(t, a, seconds, b) for a, b in ((0.02 * rate, 0.47 * rate), (0.47 * rate, 0.02 * rate))]
        return on * np.column_stack(both)
    if kind == "earthquake":
        band = butter(2, [0.03 * rate, 0.42 * rate], btype="band", fs=high)
        grown = np.maximum(t, 0) / 1.5
        return lfilter(*band, noise, axis=0) * (grown**2 * np.exp(2 - 2 * grown))[:, None]
    if kind == "stepped":
        step = np.clip((t / seconds * 40).astype(int), 0, 39)
        sine = np.sin(2 * np.pi * rate * np.linspace(0.04, 0.42, 40)[step] * t)
        return on * np.column_stack([sine * (step % 2 == 0), sine * (step % 2 == 1)])
    return np.column_stack([t < 0.1, -0.7 * (t < seconds / 2)]).astype(float)
