"""Random structures measured in every way, with the truth that an interval of 95 % should hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter, resample

import modalscope as ms
from modalscope.functions.poles import poles_from
from modalscope.numerics.checks import ComplexArray, RealArray
from tests.judging.hard import QUANTITIES, impulse_response, random_structure

RATE, FASTER, HIGHEST, BESIDE = 100.0, 8, 38.0, 20.0

#: Data, true poles (rad/s).
Case = tuple[object, ComplexArray]


class Kind(NamedTuple):
    """Records of one kind, by seed; the least coverage asked of its complete lists, and whether a case takes less than three seconds."""

    name: str
    make: Callable[[int], Case]
    options: dict[str, object]
    least: float = 93.0
    swift: bool = False


def noise(shape: tuple[int, int], colour: str, rng: np.random.Generator) -> RealArray:
    """Return noise of variance one in every column: white, AR(.95) or 1/f."""
    if colour == "1/f":
        f = np.fft.rfftfreq(4 * shape[0])
        spectrum = np.fft.rfft(rng.standard_normal((4 * shape[0], shape[1])), axis=0)
        e = np.fft.irfft(spectrum / np.sqrt(np.maximum(f, f[1]))[:, None], axis=0)[: shape[0]]
    else:
        memory = {"white": 0.0, "AR(.95)": 0.95}[colour]
        e = lfilter([1], [1, -memory], rng.standard_normal((shape[0] + 2000, shape[1])), axis=0)[2000:]
    return np.asarray(e / e.std(axis=0))


def record(
    seed: int,
    colour: str = "white",
    seconds: float = 82.0,
    unmeasured: float = 0.0,
    drift: float = 0.0,
    hits: bool = False,
) -> Case:
    """Return a record at 100 Hz under forces that are not held between samples, noise 40 dB below the outputs.

    `unmeasured`: amplitude of one more force of its own at every mode, by that of a measured one. `drift`: part of the frequencies that
    they change by over the record. `hits`: every eight seconds instead of forces that go on.
    """
    structure = random_structure([seed, 400])
    p = QUANTITIES.index(structure.quantity)
    s = structure.poles * (HIGHEST / structure.top)
    R = structure.residues / (structure.poles**p)[:, None, None]
    rng = np.random.default_rng([seed, 401])
    samples, beside = round(seconds * RATE), round(BESIDE * RATE)
    u = rng.standard_normal((samples + 2 * beside, R.shape[2]))
    if hits:
        u[:] = 0
        for k in range(beside + 20, beside + samples, 800):
            u[k + int(rng.integers(0, 60)), int(rng.integers(R.shape[2]))] = 20 * (1 + 0.3 * rng.standard_normal())
    if unmeasured:
        own = np.einsum("no,n->no", R[:, :, 0], rng.standard_normal(len(s)))
        R = np.concatenate([R, own[:, :, None]], axis=2)
        u = np.hstack([u, unmeasured * rng.standard_normal((len(u), 1))])
    fast = resample(u, len(u) * FASTER, axis=0)
    y = _drifting(fast, s, R, drift, p) if drift else _steady(fast, s, R, p)
    y = y[::FASTER][beside : beside + samples]
    y = y + noise(y.shape, colour, rng) * y.std(axis=0) * 0.01
    measured = u[beside : beside + samples, : structure.residues.shape[2]]
    return ms.Signals(outputs=y, inputs=measured, sampling_rate=RATE), s


def _steady(u: RealArray, s: ComplexArray, R: ComplexArray, p: int) -> RealArray:
    U = np.fft.rfft(u, axis=0)
    x = 2j * np.pi * np.fft.rfftfreq(len(u), 1 / (RATE * FASTER))
    Y, low = np.zeros((x.size, R.shape[1]), complex), x.imag <= np.pi * RATE
    for pole, residue in zip(s, R, strict=True):
        for each, r in ((pole, residue), (pole.conj(), residue.conj())):
            Y[low] += (x[low] ** p / (x[low] - each))[:, None] * (U[low] @ r.T)
    return np.asarray(np.fft.irfft(Y, len(u), axis=0))


def _drifting(u: RealArray, s: ComplexArray, R: ComplexArray, drift: float, p: int) -> RealArray:
    """Return the response of modes whose frequencies change evenly over the record: 1 at its middle; displacements or velocities."""
    dt, y = 1 / (RATE * FASTER), np.zeros((len(u), R.shape[1]))
    inside = len(u) - 2 * round(BESIDE * RATE * FASTER)
    course = 1 + drift * (np.arange(len(u)) - len(u) / 2) / inside
    for pole, residue in zip(s, R, strict=True):
        step = np.exp(pole * course * dt)
        force = u @ residue.T * dt
        phase = np.cumsum(pole * course) * dt
        q, state = np.empty((len(u), R.shape[1]), complex), np.zeros(R.shape[1], complex)
        block = max(int(3 / (abs(pole.real) * dt)), 1)
        for a in range(0, len(u), block):  # exp(phase) is taken back within a block, where it does not fade away
            own = phase[a : a + block] - phase[a]
            grown = np.cumsum(force[a : a + block] * np.exp(-own)[:, None], axis=0) + state * step[a]
            q[a : a + block] = grown * np.exp(own)[:, None]
            state = q[min(a + block, len(u)) - 1]
        y += 2 * (q * (pole * course)[:, None] ** min(p, 1)).real
    return y


def response(seed: int) -> Case:
    """Return impulse responses with white noise of 40 dB."""
    structure = random_structure([seed, 400])
    return impulse_response(structure, 40, seed)[0], structure.poles


def ambient(seed: int, dominant: float = 1.0, gusts: float = 0.0, colour: bool = False) -> Case:
    """Return a record of 2 to 6 outputs and 2 to 4 modes over 5 to 20 minutes at 20 Hz, white forces at all modes, noise of 20 dB."""
    rng = np.random.default_rng([seed, 500])
    n, l = int(rng.integers(2, 5)), int(rng.integers(2, 7))
    while True:
        f = np.sort(rng.uniform(0.7, 7, n))
        if np.all(np.diff(f) > 0.05 * f[:-1]):
            break
    s = poles_from(f, np.exp(rng.uniform(np.log(0.005), np.log(0.02), n)))
    rate, seconds = 20.0, rng.uniform(300, 1200)
    count, before = round(seconds * rate), 4000
    shapes, size = rng.standard_normal((l, n)), np.ones(n)
    size[int(rng.integers(n))] = dominant
    envelope = np.ones(count + before)
    if gusts:
        slow = lfilter([1], [1, -np.exp(-1 / (20 * rate))], rng.standard_normal(count + before))
        envelope = np.exp(gusts * slow / slow.std())
    y = np.zeros((count, l))
    for j, pole in enumerate(s):
        force = rng.standard_normal(count + before) * envelope
        if colour:
            force = lfilter([1], [1, -0.7], force)
        mu = np.exp(pole / rate)
        q = lfilter([1, -mu.real], [1, -2 * mu.real, abs(mu) ** 2], force)[before:]
        y += np.outer(q / q.std() * size[j], shapes[:, j])
    y += 0.1 * y.std(axis=0) * rng.standard_normal(y.shape)
    return ms.Signals(outputs=y, sampling_rate=rate), s


KINDS = (
    Kind("records, white noise", lambda k: record(k), {}),
    Kind("records, noise AR(.95)", lambda k: record(k, "AR(.95)"), {}),
    Kind("records, noise 1/f", lambda k: record(k, "1/f"), {}),
    Kind("records of 15 s", lambda k: record(k, seconds=15.0), {}, swift=True),
    Kind("hits by records on lines", lambda k: record(k, hits=True), {"route": "records"}),
    Kind("unmeasured forces of 10 %", lambda k: record(k, unmeasured=0.1), {}),
    Kind("unmeasured forces of 30 %", lambda k: record(k, unmeasured=0.3), {}),
    Kind("unmeasured forces of 50 %", lambda k: record(k, unmeasured=0.5), {}),
    Kind("frequencies that drift by 1 %", lambda k: record(k, drift=0.01), {}, 90.0),
    Kind("impulse responses", response, {}, swift=True),
    Kind("ambient, white", ambient, {}, 90.0, True),
    Kind("ambient, one mode dominates by ten", lambda k: ambient(k, dominant=10.0), {}, 90.0, True),
    Kind("ambient, coloured forces", lambda k: ambient(k, colour=True), {}, 90.0, True),
    Kind("ambient, gusts", lambda k: ambient(k, gusts=0.7), {}, 90.0, True),
)


class Found(NamedTuple):
    """What intervals hold of the modes found: frequency and damping ratio (modes, 2); modes in all, found, open or without, false."""

    held: RealArray
    true: int
    found: int
    open: int
    false: int


def found(kind: Kind, seed: int) -> Found:
    """Return what the whole program's intervals hold in one case."""
    data, s = kind.make(seed)
    result = ms.analyze(data, **kind.options)
    modes = result.modes
    if not kind.options and isinstance(data, ms.Signals) and not data.input_dofs:
        modes = ms.refine(data, modes) if len(modes) else modes
    f, zeta = np.abs(s) / (2 * np.pi), -s.real / np.abs(s)
    apart = np.abs(modes.poles[:, None] - s)
    j = np.argmin(apart, axis=1) if len(modes) else np.zeros(0, int)
    right = apart.min(axis=1) < np.maximum(-s.real[j], 0.003 * np.abs(s[j])) if len(modes) else np.zeros(0, bool)
    ends = modes.interval() if len(modes) else {}
    known = np.array([np.isfinite(ends[name]).all(axis=1) for name in ("frequency", "damping_ratio")]).all(axis=0)
    good = right & known
    held = [
        (ends[name][:, 0] <= truth[j]) & (truth[j] <= ends[name][:, 1])
        for name, truth in (("frequency", f), ("damping_ratio", zeta))
    ]
    return Found(np.array(held).T[good], len(s), int(right.sum()), int((right & ~known).sum()), int((~right).sum()))
