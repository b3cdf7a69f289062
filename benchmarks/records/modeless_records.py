"""Records that hold no modes: hum of machines, noise, quasi-static motion."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

import modalscope as ms
from modalscope.numerics.checks import RealArray

KINDS = ("transformer", "helicopter", "noise", "static")


def modeless(kind: str, seed: int) -> ms.Signals:
    """Return a record of one of `KINDS`: three to six accelerometers, two to ten minutes."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    channels, seconds = int(rng.integers(3, 7)), float(rng.uniform(120, 600))
    rate = {"transformer": 1000.0, "helicopter": 200.0, "noise": 100.0, "static": 50.0}[kind]
    if kind in ("transformer", "static"):
        seconds /= 4
    t = np.arange(int(seconds * rate)) / rate
    y = {"transformer": _transformer, "helicopter": _helicopter, "noise": _noise, "static": _static}[kind](
        rng, t, channels
    )
    floor = 10 ** (-rng.uniform(20, 50) / 20)
    y = y + floor * y.std() * rng.standard_normal(y.shape)
    if rng.integers(2):
        y = np.round(y / np.abs(y).max() * 2**15) / 2**15
    return ms.Signals(outputs=y, sampling_rate=rate, quantities="acceleration")


def _transformer(rng: np.random.Generator, t: RealArray, channels: int) -> RealArray:
    """Twice the frequency of the mains and its multiples; the mains wander by some hundredths of a hertz, loads by some per cent."""
    mains = float(rng.choice([50.0, 60.0]))
    wander = _slow(rng, t, 20.0)
    phase = 2 * np.pi * (2 * mains * t + 0.04 * np.cumsum(wander) * t[1])
    y = np.zeros((t.size, channels))
    for k in range(1, 5):
        if 2 * mains * k < 0.9 / (2 * t[1]):
            load = 1 + 0.03 * _slow(rng, t, 10.0)
            y += np.outer(load * np.cos(k * phase + rng.uniform(0, 6)), rng.standard_normal(channels)) / k
    return y


def _helicopter(rng: np.random.Generator, t: RealArray, channels: int) -> RealArray:
    """The blades' frequency and its multiples, of a speed held to a part in a thousand, and the rotor's own."""
    rotor, blades = rng.uniform(4, 7), int(rng.integers(2, 6))
    phase = 2 * np.pi * np.cumsum(rotor * (1 + 0.001 * _slow(rng, t, 10.0))) * t[1]
    y = np.zeros((t.size, channels))
    for order in (1, *(blades * np.arange(1, 5))):
        size = (0.2 if order == 1 else 1.0) * rng.uniform(0.3, 1) * (1 + 0.03 * _slow(rng, t, 10.0))
        shape = rng.standard_normal(channels) + 1j * rng.standard_normal(channels)
        y += np.real(np.outer(size * np.exp(1j * order * phase), shape))
    return y


def _noise(rng: np.random.Generator, t: RealArray, channels: int) -> RealArray:
    """White, pink, a random walk held by a high-pass filter, or behind an anti-alias filter; half of it common to all channels."""
    x = rng.standard_normal((t.size, channels))
    if rng.integers(2):
        x += np.outer(rng.standard_normal(t.size), rng.uniform(0.5, 1.5, channels))
    colour = int(rng.integers(4))
    if colour == 1:
        power = np.fft.rfftfreq(t.size, t[1]) + 1 / t[-1]
        x = np.fft.irfft(np.fft.rfft(x, axis=0) / np.sqrt(power)[:, None], n=t.size, axis=0)
    elif colour == 2:
        x = lfilter([1.0, -1.0], [1.0, -0.9], np.cumsum(x, axis=0), axis=0)
    elif colour == 3:
        x = sosfilt(butter(4, 0.4 / t[1], fs=1 / t[1], output="sos"), x, axis=0)
    return np.asarray(x)


def _static(rng: np.random.Generator, t: RealArray, channels: int) -> RealArray:
    """What follows slow loads at once: temperature, tides of traffic, vehicles that creep over."""
    load = np.cumsum(rng.standard_normal(t.size)) * np.sqrt(t[1])
    vehicles = np.zeros(t.size)
    for at in rng.uniform(0, t[-1], int(t[-1] / 15)):
        vehicles += rng.uniform(0.5, 2) * np.exp(-0.5 * ((t - at) / rng.uniform(2, 6)) ** 2)
    both = np.stack([load / load.std(), vehicles / max(vehicles.std(), 1e-9)], axis=1)
    return both @ rng.standard_normal((2, channels))


def _slow(rng: np.random.Generator, t: RealArray, constant: float) -> RealArray:
    """Return a random process of variance one with this time constant in s."""
    a = np.exp(-t[1] / constant)
    x = lfilter([np.sqrt(1 - a**2)], [1.0, -a], rng.standard_normal(t.size))
    return np.asarray(x / max(float(x.std()), 1e-12))
