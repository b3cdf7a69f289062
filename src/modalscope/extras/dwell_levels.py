"""Read frequency and damping against amplitude off dwells: records of one frequency each, whose forces excite one mode.

With F_i and X_i the complex amplitudes at the places of the forces and q that of the mode, the power of the forces is that of the mode:

    sum_i F_i X_i* / |q|^2 = K(|q|) - m w^2 + j w C(|q|)

Of the first harmonic K(|q|) is what a spring of any law has in the mean (harmonic balance). m is the same at all levels.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals
from modalscope.data.shown import figures, percent
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import QUANTITIES, poles_from

#: Powers of the squared amplitude that K has at most, and dwells for each of its unknowns.
_MAX_POWER, _DWELLS_AN_UNKNOWN = 3, 2

#: Relative differences of frequencies that are one.
_ONE_FREQUENCY = 1e-6

#: Harmonics that are fitted, and rounds of its frequency.
_HARMONICS, _ROUNDS = 3, 4

#: Periods of the sine that a dwell needs in its second half.
_MIN_PERIODS = 5.0


def dwell_of(records: Records) -> dict[str, Any]:
    """Return the fields of a `Dwell`: the mode that dwells excite, at the lowest level, and its backbone, by rising amplitude.

    Raises `DataError`: no forces, fewer than four dwells or too short ones, forces at places that are not measured, or dwells so near
    each other that mass and stiffness are not separated.
    """
    w, X, F, places = _measured(records)
    in_phase_with = np.exp(-1j * np.angle(F[np.arange(len(F)), np.abs(F).argmax(axis=1)]))[:, None]
    driven, turned = (F * in_phase_with).real, X * in_phase_with
    _, _, Vh = np.linalg.svd(np.vstack([turned.real, turned.imag]), full_matrices=False)
    shape = Vh[0] / Vh[0][np.abs(Vh[0]).argmax()]
    q = np.abs(X @ shape) / (shape @ shape)
    frequency, damping = _backbone(w, q, np.sum(F * X[:, places].conj(), axis=1) / q**2)
    order = np.argsort(q, kind="stable")
    rows = list(zip(q[order], frequency[order], damping[order], strict=True))
    names = [("amplitude", float), ("frequency", float), ("damping", float)]
    levels = np.array(rows, names).view(np.recarray)
    in_phase = np.sum(turned.real**2, axis=1) / np.sum(np.abs(X) ** 2, axis=1)
    best = int(in_phase.argmin())
    modes = ModalModel(
        poles=poles_from([levels[0].frequency], [levels[0].damping]),
        shapes=shape[:, None].astype(complex),
        quantity=records.quantity,
        output_dofs=records.output_dofs,
        processing=("sine dwells, the lowest level",),
        notes=(_backbone_note(levels),),
        scaling="length 1",
    ).normalized("unit")
    forces = driven[[best]] / np.linalg.norm(driven[[best]], axis=1, keepdims=True)
    of_levels = {"indicator": in_phase[:, None], "frequencies": w / (2 * np.pi), "levels": levels}
    return {"modes": modes, "forces": forces, **of_levels}


def _measured(records: Records) -> tuple[RealArray, ComplexArray, ComplexArray, list[int]]:
    """Return the circular frequencies of dwells, amplitudes of displacements and forces, and which outputs are at the forces."""
    if not records.input_dofs:
        raise DataError("a tuned dwell:", "no forces were measured", "Give the forces of the dwells as inputs.")
    amplitudes = [_amplitudes(run) for run in records.runs]
    w = np.array([each[0] for each in amplitudes])
    quantity = records.quantity
    if quantity is None:
        raise DataError("a tuned dwell:", "the quantity of the outputs is not known", "Give quantities=...")
    X = np.array([each[1] for each in amplitudes]) / ((1j * w) ** QUANTITIES[quantity])[:, None]
    missing = ", ".join(dof for dof in records.input_dofs if dof not in records.output_dofs)
    if missing:
        raise DataError("a tuned dwell:", f"the motion at {missing} is not measured", "Measure it at each force.")
    places = [records.output_dofs.index(dof) for dof in records.input_dofs]
    return w, X, np.array([each[2] for each in amplitudes]), places


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
        have = f"the second half of one has {figures(w * t[-1] / (2 * np.pi), 2)} periods"
        raise DataError("a tuned dwell:", have, f"Dwell for {2 * _MIN_PERIODS:g} periods, or longer.")
    return w, _fitted(w, t, y), _fitted(w, t, u)


def _fitted(w: float, t: RealArray, x: RealArray) -> ComplexArray:
    """Return the amplitude of the first harmonic exp(j w t) of every channel, fitted with the next ones and a constant."""
    angles = w * t[:, None] * np.arange(1, _HARMONICS + 1)
    columns = np.hstack([np.cos(angles), np.sin(angles), np.ones((len(t), 1))])
    found = np.linalg.lstsq(columns, x, rcond=None)[0]
    return np.asarray(found[0] - 1j * found[_HARMONICS])


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
        raise DataError("a tuned dwell:", have, "Step through the resonance, to half of its height at least.")
    natural = np.sqrt(np.maximum((power.real + m * w**2) / m, 0))
    return natural / (2 * np.pi), power.imag / (w * 2 * m * np.maximum(natural, 1e-300))


def _backbone_note(levels: Any) -> Note:
    """Say how frequency and damping go with amplitude."""
    ends = [levels[name][[0, -1]] for name in ("amplitude", "frequency", "damping")]
    change = float(np.abs(levels.frequency / levels.frequency[0] - 1).max())
    text = (
        f"linear within {percent(change, 2)}: amplitudes {figures(ends[0][0])} to {figures(ends[0][1])}, "
        f"{ends[1][0]:.5g} to {ends[1][1]:.5g} Hz, damping {figures(100 * ends[2][0])} to {percent(ends[2][1])}"
    )
    return Note("backbone", {"change": change}, text)
