"""Modes of records that only orders show which the fit does not need any more are told, with their values."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms

FREQUENCIES = np.array([11.1494, 19.3083, 29.5518, 50.5205, 63.5746])
DAMPING = np.array([0.0106, 0.0094, 0.0058, 0.0058, 0.0121])


def record() -> ms.Signals:
    """Accelerations that a converter of eight bits has rounded: the lowest mode is a hundredth of them."""
    w, phi = 2 * np.pi * FREQUENCIES, np.random.default_rng(7).standard_normal((8, 5))
    A = np.block([[np.zeros((5, 5)), np.eye(5)], [-np.diag(w**2), -np.diag(2 * DAMPING * w)]])
    B = np.vstack([np.zeros((5, 1)), phi[:1].T])
    u = np.random.default_rng(7).standard_normal((8000, 1))
    y = ms.StateSpace(A=A, B=B, C=phi @ A[5:], D=phi @ phi[:1].T).to_discrete(1 / 256).simulate(u)
    y, u = (np.round(x / step) * step for x, step in ((x, np.abs(x).max(axis=0) / 127) for x in (y, u)))
    return ms.Signals(outputs=y, inputs=u, sampling_rate=256.0)


@pytest.mark.slow
def test_a_weak_mode_is_told() -> None:
    modes = ms.select(ms.stabilize(record(), orders=range(2, 81, 2)))
    assert np.allclose(modes.frequencies, FREQUENCIES[1:], rtol=1e-3)
    (weak,) = modes.left_out
    assert abs(weak.frequency / FREQUENCIES[0] - 1) < 0.01
    assert "of 40 orders, but hardly at those sufficient" in weak.reason
    assert "take=11." in weak.remedy.replace("[", "")
