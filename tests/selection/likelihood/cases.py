"""Data of every kind on the five-storey chain, whose errors are compared with the deviations that come with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

import modalscope as ms
from modalscope.systems import chain5

__all__ = ["CASES", "TRUTH", "Case", "errors"]

TRUTH = chain5().modes()

#: 40 dB.
NOISE = 0.01

Errors = tuple[np.ndarray, np.ndarray]


def errors(data: Any, order: int, **row: Any) -> Errors:
    """Return errors of the five frequencies and damping ratios, (2, 5), with their deviations."""
    modes = ms.identify(data, order=order, **row).modes
    near = modes.take([int(np.argmin(np.abs(modes.poles - s))) for s in TRUTH.poles])
    std = np.stack([near.frequencies_std, near.damping_ratios_std])
    apart = np.stack([near.frequencies - TRUTH.frequencies, near.damping_ratios - TRUTH.damping_ratios])
    return apart, std


def samples(seed: int) -> Any:
    return chain5().impulse_response(400, noise=NOISE, seed=seed)


def lines(seed: int, known: bool = True, every: int = 1) -> Any:
    """680 lines (or every n-th of them) of one variance a channel, which comes with them or not."""
    clean = chain5().frequency_response(np.arange(20, 700, every) * 0.01)
    size = NOISE * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=0))
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(clean.values.shape) + 1j * rng.standard_normal(clean.values.shape)
    variance = np.broadcast_to(size**2, clean.values.shape) if known else None
    return replace(clean, values=clean.values + size / np.sqrt(2) * noise, variance=variance)


def unknown(seed: int) -> Any:
    return lines(seed, known=False)


def periodic(seed: int) -> Any:
    """Ten periods of 2048 samples of equal amplitudes and random phases at two inputs in turn, after six of settling (nine decay times)."""
    rng = np.random.default_rng(1000 + seed)
    forces = np.zeros((2, 16 * 2048, 2))
    for run in range(2):
        one = np.fft.irfft(np.exp(2j * np.pi * rng.random(1025)) * np.r_[0, np.ones(1023), 0])
        forces[run, :, run] = np.tile(one / one.std(), 16)
    record = chain5().simulate(inputs=forces, at=[0, 3], sampling_rate=20, noise=NOISE, seed=seed)
    return ms.estimate_frf(record, excitation="periodic", period=2048, settle=6, held=True).band(0.2, 7.0)


def record(seed: int) -> Any:
    return chain5().simulate(at=[0, 3], samples=2000, sampling_rate=20, noise=NOISE, seed=seed)


def loud_record(seed: int) -> Any:
    return chain5().simulate(at=[0, 3], samples=2000, sampling_rate=20, noise=0.1, seed=seed)


def two_records(seed: int) -> Any:
    return chain5().simulate(at=[0, 3], samples=1000, runs=2, sampling_rate=20, noise=NOISE, seed=seed)


def ambient(seed: int) -> Any:
    return chain5().simulate(inputs="ambient", duration=2000, sampling_rate=20, noise=NOISE, seed=seed)


def windowed(seed: int, on_lines: bool = True, decay: float = 0.1, count: int = 600) -> Any:
    """A response under exp(-decay t), whose noise was steady before: as samples, or as the lines of their transform."""
    clean = chain5().impulse_response(count).values
    noise = NOISE * np.sqrt(np.mean(clean**2, axis=0)) * np.random.default_rng(seed).standard_normal(clean.shape)
    values = (clean + noise) * np.exp(-decay * np.arange(1, count + 1) / 20)[:, None, None]
    if not on_lines:
        return ms.ImpulseResponse(values=values, sampling_rate=20.0, added_damping=decay)
    H = np.fft.fft(np.concatenate([np.zeros_like(values[:1]), values]), axis=0)[1 : count // 2]
    f = np.arange(1, count // 2) * 20.0 / (count + 1)
    return ms.FrequencyResponse(values=H, frequencies=f, sampling_rate=20.0, added_damping=decay)


class Asked(NamedTuple):
    """Least and largest ratio of frequencies and of damping ratios, and coverage in %, None where bias or splitting forbid one."""

    frequency: tuple[float, float]
    damping: tuple[float, float]
    coverage: tuple[float, float] | None


@dataclass(frozen=True)
class Case:
    """One row of the table: data, method and order; what is promised where it is less than for the others.

    Parameters
    ----------
    what : str
    data : callable
        Of the seed.
    method, domain : str
    order : int
    seeds : int
    ratios : (float, float, float, float)
        Least and largest ratio of frequencies, then of damping ratios.
    coverage : float
        Least, %; None where bias forbids a promise.
    quantile : float
        Half width of the 95 % interval, in deviations: Student's where they come from parts of a record.
    median : bool
        Whether the typical deviation is the median: above the true order modes may split.
    """

    what: str
    data: Callable[[int], Any]
    method: str
    domain: str
    order: int = 10
    seeds: int = 400
    ratios: tuple[float, float, float, float] = (0.9, 1.1, 0.85, 1.15)
    coverage: float | None = 92
    median: bool = False
    quantile: float = 1.96
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """What the row is called in the table."""
        return f"{self.what} | {self.method} ({self.domain}), {self.order}"

    @property
    def asked(self) -> Asked:
        """What every row of its kind is asked to hold, whatever is promised for this one."""
        if self.method == "lscf":
            return Asked((0.85, 1.2), (0.85, 1.2), None)
        if self.median:
            return Asked((0.85, 1.5), (0.85, 1.5), None)
        return Asked((0.9, 1.1), (0.85, 1.15), (92.0, 98.0))


_IRF, _FRF = "impulse responses, 400 samples, 40 dB", "frequency responses, 680 lines, 40 dB"
_ON = {"route": "records"}
_TWICE = {"median": True, "ratios": (0.85, 1.5, 0.85, 1.5)}

CASES = (
    *(Case(_IRF, samples, row, "time") for row in ("era", "least_squares", "alternate")),
    # its poles are so far off that what they leave is more than the noise: the deviations are too wide, never too small
    Case(_IRF, samples, "polyreference", "time", ratios=(0.75, 1.1, 0.75, 1.15)),
    *(Case(_IRF, samples, row, "time", 20, 200, **_TWICE) for row in ("era", "alternate", "polyreference")),  # type: ignore[arg-type]
    *(Case(f"{_FRF}, variance given", lines, row, "s", seeds=150) for row in ("alternate", "polyreference")),
    Case(f"{_FRF}, variance given", lines, "era", "s", seeds=150, coverage=None),
    *(Case(f"{_FRF}, variance given", lines, row, "z", seeds=100) for row in ("alternate", "polyreference")),
    Case(f"{_FRF}, residual", unknown, "alternate", "s", seeds=150),
    Case(f"{_FRF}, residual", unknown, "lscf", "z", 20, 100, (0.8, 1.2, 0.8, 1.2), None),
    *(Case("periodic test, ten periods", periodic, row, "z", seeds=100) for row in ("alternate", "polyreference")),
    Case("periodic test, ten periods", periodic, "era", "z", seeds=100, coverage=None),
    Case("record of 2000 samples, 40 dB", record, "alternate", "z", seeds=200, options=_ON),
    Case("record of 2000 samples, 40 dB", record, "era", "z", seeds=120, options=_ON),
    Case("record of 2000 samples, 40 dB", record, "alternate", "z", 20, 120, options=_ON, **_TWICE),  # type: ignore[arg-type]
    Case("the same, 20 dB", loud_record, "alternate", "z", seeds=120, options=_ON),
    Case("two runs of 1000 samples, 40 dB", two_records, "alternate", "z", seeds=120, options=_ON),
    *(
        Case("ambient record of 2000 s, 20 parts", ambient, row, "time", seeds=100, quantile=2.093)
        for row in ("alternate", "era", "polyreference")
    ),
    Case("ambient record of 2000 s, 20 parts", ambient, "ssi-data", "time", seeds=40, quantile=2.093),
    Case("samples under a window, 600", lambda k: windowed(k, False), "era", "time", seeds=150, coverage=None),
    Case("lines under a window, 300", windowed, "alternate", "z", seeds=150),
)
