"""The Cramer-Rao bound of a simulated set: how well any unbiased method can know its modes.

Of responses, impulse responses and decays with everything unknown (poles, shapes, participation, terms), of ambient records by Whittle's
likelihood with shapes, noise and correlations unknown. Records with measured forces, and repeated modes, have none here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import modalscope as ms
from modalscope.systems import Structure
from tests.selection.judging.any_ambient import Truth, bound_of, responses
from tests.selection.judging.bound import bound, shape_bound

__all__ = ["of_ambient", "of_response"]

#: Modes nearer to each other than this part are one repeated mode.
_REPEATED = 1e-6


def of_response(built: Structure, data: Any, clean: Any) -> np.ndarray:
    """Return least deviations of frequencies (Hz) and damping ratios, and least means of 1 - MAC, (3, n); noise is what `clean` lacks."""
    modes = built.modes(outputs=data.output_dofs, inputs=data.input_dofs, quantity=data.quantity)
    sampled, s = isinstance(data, ms.ImpulseResponse), modes.poles
    held = (np.exp(s / data.sampling_rate) - 1) / s if sampled and data.kind == "pulse" else np.ones(s.size)
    known = ms.ModalModel(poles=s, shapes=modes.shapes, participation=modes.participation * held[:, None])
    error = np.mean(abs(data.values - clean.values) ** 2, axis=0) / (1 if sampled else 2)
    f, zeta, covariance = bound(data, known, np.sqrt(error))
    return _distinct(modes, np.array([f, zeta, np.sum(shape_bound(known, covariance) ** 2, axis=0)]))


def of_ambient(built: Structure, data: ms.Signals, noise: float) -> np.ndarray:
    """Return the same of a record of accelerations under white forces on all masses; `noise`: a part of the RMS of each channel."""
    modes = built.modes(outputs=data.output_dofs)
    phi = built.undamped_modes()[1]  # modes of length one in the mass matrix
    rows = [modes.output_dofs.index(dof) for dof in data.output_dofs]
    forces = phi.T / (2 * modes.damping_ratios[:, None])
    truth = Truth(
        modes.frequencies, modes.damping_ratios, phi[rows], forces, np.ones(len(rows)), data.sampling_rate, data.samples
    )
    lines = np.arange(1, data.samples // 2) * data.sampling_rate / data.samples
    power = np.mean(np.sum(abs((truth.shapes * responses(truth, lines)[:, None]) @ forces) ** 2, axis=2), axis=0)
    found = bound_of(truth._replace(noise=noise**2 * power))
    return _distinct(modes, np.array([found.frequencies, found.damping_ratios, found.shapes]))


def _distinct(modes: ms.ModalModel, bounds: np.ndarray) -> np.ndarray:
    """Return bounds, NaN where a mode is repeated."""
    f = modes.frequencies
    near = abs(f[:, None] - f) < _REPEATED * f
    return np.where(near.sum(axis=1) > 1, np.nan, bounds)
