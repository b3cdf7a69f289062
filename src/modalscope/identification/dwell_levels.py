"""Read frequency and damping against amplitude off dwells: records of one frequency each, whose forces excite one mode.

With F_i and X_i the complex amplitudes at the places of the forces and q that of the mode, the power of the forces is that of the mode:

    sum_i F_i X_i* / |q|^2 = K(|q|) - m w^2 + j w C(|q|)

Of the first harmonic K(|q|) is what a spring of any law has in the mean (harmonic balance). m is the same at all levels.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from modalscope.data.records import Records, Signals
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import QUANTITIES

#: Powers of the squared amplitude that K has at most, and dwells for each of its unknowns.
_MAX_POWER, _DWELLS_AN_UNKNOWN = 3, 2

#: Relative differences of frequencies that are one.
_ONE_FREQUENCY = 1e-6

#: Harmonics that are fitted, and rounds of its frequency.
_HARMONICS, _ROUNDS = 3, 4

#: Periods of the sine that a dwell needs in its second half.
_MIN_PERIODS = 5.0


class Levels(NamedTuple):
    """Amplitudes of the first harmonic at every dwell, and what they say of the mode.

    `dwell` (R,): frequencies, Hz. `shape` (l,): real. `forces` (R, m): of length one. `in_phase` (R,): share of the motion in phase with
    the forces, 0 at resonance. `table`: amplitude of the largest output, frequency, damping ratio, by rising amplitude.
    """

    dwell: RealArray
    shape: RealArray
    forces: RealArray
    in_phase: RealArray
    table: Any


def levels_of(records: Records) -> Levels:
    """Return the backbone of the mode that dwells excite: a level each, by rising amplitude.

    Raises `DataError`: no forces, fewer than four dwells or too short ones, forces at places that are not measured, or dwells so near
    each other that mass and stiffness are not separated.
    """
    if not records.input_dofs:
        raise DataError(
            "a tuned dwell was asked", "no forces were measured", "Give the forces of the dwells as inputs."
        )
    amplitudes = [_amplitudes(run) for run in records.runs]
    w = np.array([each[0] for each in amplitudes])
    quantity = records.quantity
    if quantity is None:
        raise DataError("a tuned dwell was asked", "the quantity of the outputs is not known", "Give quantities=...")
    X = np.array([each[1] for each in amplitudes]) / ((1j * w) ** QUANTITIES[quantity])[:, None]
    F = np.array([each[2] for each in amplitudes])
    shape = _shape(X, F)
    q = np.abs(X @ shape) / (shape @ shape)
    places = [records.output_dofs.index(dof) for dof in records.input_dofs if dof in records.output_dofs]
    if len(places) < len(records.input_dofs):
        missing = ", ".join(dof for dof in records.input_dofs if dof not in records.output_dofs)
        raise DataError(
            "a tuned dwell was asked", f"the motion at {missing} is not measured", "Measure it at each force."
        )
    power = np.sum(F * X[:, places].conj(), axis=1) / q**2
    frequency, damping = _backbone(w, q, power)
    order = np.argsort(q, kind="stable")
    rows = np.array(
        list(zip(q[order], frequency[order], damping[order], strict=True)),
        [("amplitude", float), ("frequency", float), ("damping", float)],
    )
    driven = F * np.exp(-1j * np.angle(_strongest(F)))[:, None]
    turned = X * np.exp(-1j * np.angle(_strongest(F)))[:, None]
    in_phase = np.sum(turned.real**2, axis=1) / np.sum(np.abs(X) ** 2, axis=1)
    size = np.linalg.norm(driven.real, axis=1, keepdims=True)
    return Levels(w / (2 * np.pi), shape, driven.real / size, in_phase, rows.view(np.recarray))


def _amplitudes(run: Signals) -> tuple[float, ComplexArray, ComplexArray]:
    """Return the circular frequency of a dwell, and the amplitudes of outputs and inputs in its second half."""
    assert run.inputs is not None
    half = run.samples // 2
    y, u = np.asarray(run.outputs[half:]), np.asarray(run.inputs[half:])
    t = np.arange(len(y)) / run.sampling_rate
    spectrum = np.abs(np.fft.rfft((u - u.mean(axis=0)) * np.hanning(len(u))[:, None], axis=0)).sum(axis=1)
    w = 2 * np.pi * int(spectrum[1:].argmax() + 1) / t[-1]
    for _ in range(_ROUNDS):  # the phase of one half against the other's tells the frequency
        first, second = (_fitted(w, t[part], u[part]) for part in (slice(None, len(t) // 2), slice(len(t) // 2, None)))
        w += float(np.angle(np.sum(second * first.conj()))) / (t[len(t) // 2] - t[0])
    if w * t[-1] < 2 * np.pi * _MIN_PERIODS:
        have = f"the second half of one has {w * t[-1] / (2 * np.pi):.2g} periods"
        raise DataError("a tuned dwell was asked", have, f"Dwell for {2 * _MIN_PERIODS:g} periods, or longer.")
    return w, _fitted(w, t, y), _fitted(w, t, u)


def _fitted(w: float, t: RealArray, x: RealArray) -> ComplexArray:
    """Return the amplitude of the first harmonic exp(j w t) of every channel, fitted with the next ones and a constant."""
    angles = w * t[:, None] * np.arange(1, _HARMONICS + 1)
    columns = np.hstack([np.cos(angles), np.sin(angles), np.ones((len(t), 1))])
    found = np.linalg.lstsq(columns, x, rcond=None)[0]
    return np.asarray(found[0] - 1j * found[_HARMONICS])


def _strongest(F: ComplexArray) -> ComplexArray:
    """Return the strongest force of every dwell, (R,)."""
    return np.asarray(F[np.arange(len(F)), np.abs(F).argmax(axis=1)])


def _shape(X: ComplexArray, F: ComplexArray) -> RealArray:
    """Return the real shape that all dwells have in common, its largest entry one."""
    turned = X * np.exp(-1j * np.angle(_strongest(F)))[:, None]
    _, _, Vh = np.linalg.svd(np.vstack([turned.real, turned.imag]), full_matrices=False)
    return np.asarray(Vh[0] / Vh[0][np.abs(Vh[0]).argmax()])


def _backbone(w: RealArray, q: RealArray, power: ComplexArray) -> tuple[RealArray, RealArray]:
    """Return frequency (Hz) and damping ratio at every dwell: K = power.real + m w^2, m by least squares over all of them."""
    if len(w) < 2 * _DWELLS_AN_UNKNOWN:
        have = f"there are {len(w)}"
        raise DataError(f"a tuned dwell needs {2 * _DWELLS_AN_UNKNOWN} dwells", have, "Step through the resonance.")
    powers = min(_MAX_POWER, len(w) // _DWELLS_AN_UNKNOWN - 2) if np.ptp(q) > 0 else 0
    a2 = (q / q.max()) ** 2
    columns = np.column_stack([-(w**2), *(a2**k for k in range(powers + 1))])
    size = np.linalg.norm(columns, axis=0)
    found, _, rank, _ = np.linalg.lstsq(columns / size, power.real, rcond=1e-10)
    m = found[0] / size[0]
    if rank < columns.shape[1] or not m > 0:
        f = w / (2 * np.pi)
        where = (
            "at one frequency" if np.ptp(f) <= _ONE_FREQUENCY * f.mean() else f"from {f.min():.6g} to {f.max():.6g} Hz"
        )
        have = f"all dwells are {where}: mass and stiffness are not separated"
        raise DataError("a tuned dwell was asked", have, "Step through the resonance, to half of its height at least.")
    natural = np.sqrt(np.maximum((power.real + m * w**2) / m, 0))
    return natural / (2 * np.pi), power.imag / (w * 2 * m * np.maximum(natural, 1e-300))
