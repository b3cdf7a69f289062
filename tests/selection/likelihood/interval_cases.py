"""Random structures measured in every way, with the truth that an interval of 95 % should hold."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter, resample

import modalscope as ms
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.poles import poles_from
from tests.selection.judging.hard import QUANTITIES, impulse_response, random_structure
from tests.selection.judging.shifted import KINDS as SHIFTS, shifted_response, shifted_structure

RATE, FASTER, HIGHEST, BESIDE = 100.0, 8, 38.0, 20.0

#: Data, true poles (rad/s).
Case = tuple[object, ComplexArray]


class Kind(NamedTuple):
    """Records of one kind, by seed, the least coverage asked of its complete lists, and how many records.

    `draws`: records of one structure, one after the other, whose mean frequency and damping are the truth: what is linear is the
    structure alone, not what a record can tell; 0 where the truth is known.
    """

    name: str
    make: Callable[[int], Case]
    options: Callable[[ComplexArray], dict[str, object]] = lambda _: {}
    least: float = 93.0
    count: int = 100
    draws: int = 0


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


def _drifting(u: RealArray, s: ComplexArray, R: ComplexArray, drift: float, p: int, rate: float = RATE) -> RealArray:
    """Return the response of modes whose frequencies change evenly over the record: 1 at its middle; displacements or velocities."""
    dt, y = 1 / (rate * FASTER), np.zeros((len(u), R.shape[1]))
    inside = len(u) - 2 * round(BESIDE * rate * FASTER)
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


def two_shakers(seed: int) -> Case:
    """Return a draw of 60 s of one structure under two measured and two unmeasured shakers; its 15 frequencies drift by .01 %.

    28 velocities, 5 to 80 Hz, damping .3 to 2 %, all shakers alike, noise 60 dB below the outputs.
    """
    rng, rate, seconds = np.random.default_rng([77, 600]), 256.0, 60.0
    f = 5 * 16 ** ((np.arange(15) + rng.uniform(0.2, 0.8, 15)) / 15)
    s = poles_from(f, np.exp(rng.uniform(np.log(0.003), np.log(0.02), 15)))
    shapes = rng.standard_normal((28, 15))
    R = np.einsum("on,in->noi", shapes, shapes[rng.choice(28, 4, replace=False)]) / (2j * s.imag)[:, None, None]
    rng = np.random.default_rng([seed, 601])
    samples, beside = round(seconds * rate), round(BESIDE * rate)
    u = rng.standard_normal((samples + 2 * beside, 4))
    y = _drifting(resample(u, len(u) * FASTER, axis=0), s, R, 1e-4, 1, rate)[::FASTER][beside : beside + samples]
    y += noise(y.shape, "white", rng) * y.std(axis=0) * 1e-3
    return ms.Signals(outputs=y, inputs=u[beside : beside + samples, :2], sampling_rate=rate), s


#: Draws of forces on each structure whose springs harden.
DRAWS = 20


def hardening(seed: int) -> Case:
    """Return the displacements of a chain of six masses whose springs harden with the cube of their elongation, at 100 Hz.

    At the elongation's standard deviation the cube adds .1 to .5 % to a spring's force. 20 draws of the force on a structure; the poles
    are those without the cube.
    """
    rng = np.random.default_rng([seed // DRAWS, 700])
    n, top, step = 6, 2 * np.pi * HIGHEST, 1 / (RATE * FASTER)
    ends = np.vstack([np.eye(n), np.zeros(n)]) - np.vstack([np.zeros(n), np.eye(n)])  # elongations by displacements
    stiff = rng.uniform(0.6, 1.4, n + 1)
    K = ends.T @ (stiff[:, None] * ends)
    w, modes = np.linalg.eigh(K)
    K, w, stiff = K * top**2 / w[-1], np.sqrt(w / w[-1]) * top, stiff * top**2 / w[-1]
    zeta = np.exp(rng.uniform(np.log(0.004), np.log(0.02), n))
    C = (modes * 2 * zeta * w) @ modes.T
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    drive, share = rng.standard_normal(n), rng.uniform(0.001, 0.005)
    rng = np.random.default_rng([seed, 701])
    samples, beside = round(82 * RATE), round(BESIDE * RATE)
    u = rng.standard_normal(samples + 2 * beside)
    B = np.concatenate([np.zeros(n), drive])
    linear = np.array(_stepped(A, B, ends, 0 * stiff, resample(u[:4000], 4000 * FASTER), step))
    cube = share * stiff / (linear[4000 * FASTER // 4 :] @ ends.T).var(axis=0)
    y = np.array(_stepped(A, B, ends, cube, resample(u, len(u) * FASTER), step))[::FASTER][beside : beside + samples]
    y = y + 0.001 * y.std(axis=0) * rng.standard_normal(y.shape)
    return ms.Signals(outputs=y, inputs=u[beside : beside + samples, None], sampling_rate=RATE), poles_from(
        w / (2 * np.pi), zeta
    )


def _stepped(
    A: RealArray, B: RealArray, ends: RealArray, cube: RealArray, u: RealArray, step: float
) -> list[RealArray]:
    """Return displacements of x' = A x + B u with cubic springs between the masses: exact but for the cube, which is held at half steps."""
    n, x, found = ends.shape[1], np.zeros(len(A)), []
    whole = expm(np.block([[A, B[:, None]], [np.zeros((1, len(A) + 1))]]) * step)
    F, G = whole[:-1, :-1], whole[:-1, -1]
    for force in u:
        found.append(x[:n])
        x = F @ x + G * force
        d = ends @ x[:n]
        x[n:] -= step * (ends.T @ (cube * d**3))
    return found


def response(seed: int) -> Case:
    """Return impulse responses with white noise of 40 dB."""
    structure = random_structure([seed, 400])
    return impulse_response(structure, 40, seed)[0], structure.poles


def shifted(seed: int, kind: str) -> Case:
    """Return responses whose resonances differ from row to row or column to column; the truth is what they scatter around."""
    structure = shifted_structure(seed)
    return shifted_response(structure, SHIFTS[kind], seed), structure.poles


def ambient(seed: int, dominant: float = 1.0, gusts: float = 0.0, colour: bool = False, beyond: float = 0.0) -> Case:
    """Return a record of 2 to 6 outputs and 2 to 4 modes over 5 to 20 minutes at 20 Hz, white forces at all modes, noise of 20 dB.

    `beyond`: amplitude of two more modes, 5 % outside `band_around` the others on either side; they are no modes of the band.
    """
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
    asked = s
    if beyond:
        low, high = band_around(s)["band"]
        s, size = np.append(s, poles_from([0.95 * low, 1.05 * high], [0.01, 0.01])), np.append(size, [beyond] * 2)
        shapes = np.hstack([shapes, rng.standard_normal((l, 2))])
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
    return ms.Signals(outputs=y, sampling_rate=rate), asked


def band_around(s: ComplexArray) -> dict[str, tuple[float, float]]:
    """Return the option of a band from 15 % below the lowest mode to 15 % above the highest."""
    f = np.abs(s) / (2 * np.pi)
    return {"band": (float(0.85 * f.min()), float(1.15 * f.max()))}


#: Which of the kinds of tests that shift are asked.
SHIFTED = ("rows", "columns", "rows and columns", "rows, smooth errors")

KINDS = (
    Kind("records, white noise", record),
    Kind("records, noise AR(.95)", lambda k: record(k, "AR(.95)")),
    Kind("records, noise 1/f", lambda k: record(k, "1/f")),
    Kind("records of 15 s", lambda k: record(k, seconds=15.0)),
    Kind("hits by records on lines", lambda k: record(k, hits=True), lambda _: {"route": "records"}),
    Kind("unmeasured forces of 10 %", lambda k: record(k, unmeasured=0.1)),
    Kind("unmeasured forces of 30 %", lambda k: record(k, unmeasured=0.3)),
    Kind("unmeasured forces of 50 %", lambda k: record(k, unmeasured=0.5)),
    Kind("two measured and two unmeasured shakers", two_shakers, count=40),
    Kind("frequencies that drift by 1 %", lambda k: record(k, drift=0.01), least=90.0),
    Kind("springs that harden", hardening, least=86.0, draws=DRAWS),
    Kind("impulse responses", response),
    *(Kind(f"responses that shift: {kind}", partial(shifted, kind=kind), least=90.0, count=60) for kind in SHIFTED),
    Kind("ambient, white", ambient, least=90.0),
    Kind("ambient, one mode dominates by ten", lambda k: ambient(k, dominant=10.0), least=90.0),
    Kind("ambient, coloured forces", lambda k: ambient(k, colour=True), least=90.0),
    Kind("ambient, gusts", lambda k: ambient(k, gusts=0.7), least=90.0),
    Kind("ambient, strong modes outside the band", lambda k: ambient(k, beyond=10.0), band_around, least=88.5),
)


class Found(NamedTuple):
    """What the whole program says of one case.

    `which` (k,): true modes that were found with an interval. `values`, `ends` (k, 2), (k, 2, 2): frequency and damping ratio, and
    their intervals. `true`: modes in all. `right`, `open`, `false`: modes found, of these open or without, poles that are none.
    """

    which: IntArray
    values: RealArray
    ends: RealArray
    true: int
    right: int
    open: int
    false: int

    @property
    def complete(self) -> bool:
        return self.right == self.true and not self.false

    def held(self, truth: RealArray) -> RealArray:
        """Return whether intervals hold (k, 2) the truth (modes, 2)."""
        asked = truth[self.which]
        return np.asarray((self.ends[..., 0] <= asked) & (asked <= self.ends[..., 1]), dtype=float)


def numbers_of(s: ComplexArray) -> RealArray:
    """Return frequencies and damping ratios, (modes, 2)."""
    return np.stack([np.abs(s) / (2 * np.pi), -s.real / np.abs(s)], axis=1)


def found(kind: Kind, seed: int) -> Found:
    """Return what the whole program finds in one case."""
    data, s = kind.make(seed)
    modes = ms.analyze(data, **kind.options(s)).modes
    if isinstance(data, ms.Signals) and not data.input_dofs and len(modes):
        modes = ms.refine(data, modes)
    if not len(modes):
        return Found(np.zeros(0, int), np.zeros((0, 2)), np.zeros((0, 2, 2)), len(s), 0, 0, 0)
    apart = np.abs(modes.poles[:, None] - s)
    j = np.argmin(apart, axis=1)
    right = apart.min(axis=1) < np.maximum(-s.real[j], 0.003 * np.abs(s[j]))
    ends = np.stack([modes.interval()[name] for name in ("frequency", "damping_ratio")], axis=1)
    known = np.isfinite(ends).all(axis=(1, 2))
    good = right & known
    return Found(
        j[good], numbers_of(modes.poles)[good], ends[good], len(s), int(right.sum()), int((right & ~known).sum()),
        int((~right).sum()),
    )  # fmt: skip
