"""The residue of a mode that needs several poles: their sum where they are near, and its own beside modes that shift."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import FrequencyResponse
from modalscope.data.indicators import mac
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.verdict import one_residue

F = np.linspace(8, 13, 500)
POLE = complex(poles_from(10.0, 0.01))
rng = np.random.default_rng(0)
R = rng.standard_normal((3, 2)) + 1j * rng.standard_normal((3, 2))


def light() -> FrequencyResponse:
    return FrequencyResponse(values=np.full((F.size, 1, 1), 1j), frequencies=F)


def test_a_pole_alone_keeps_its_residue() -> None:
    assert np.allclose(one_residue(light(), POLE, np.array([POLE]), R[None]), R, rtol=1e-9)


def test_two_poles_are_one_of_both_residues_to_the_second_order_of_their_distance() -> None:
    # R / 2 (g(s + d) + g(s - d)) = R (g + d^2 g'' / 2 + ...), and g'' is 2 g / h^2 at most
    off = []
    for part in (0.1, 0.2):
        d = -1j * part * POLE.real
        found = one_residue(light(), POLE, np.array([POLE - d, POLE + d]), np.stack([R, R]) / 2)
        off.append(np.linalg.norm(found - R) / np.linalg.norm(R))
    assert off[0] < 0.1**2
    assert off[1] / off[0] == pytest.approx(4, rel=0.1)


def shifting(seed: int = 0) -> tuple[FrequencyResponse, np.ndarray]:
    """Return a strong mode that every input finds at another place, beside a weak and broad one of another shape."""
    own = np.random.default_rng(seed)
    shapes, parts = own.standard_normal((4, 2)), own.standard_normal((2, 3))
    shapes[:, 1] -= shapes[:, 0] * (shapes[:, 0] @ shapes[:, 1]) / (shapes[:, 0] @ shapes[:, 0])
    weak = complex(poles_from(11.0, 0.02))
    x = 2j * np.pi * F
    H = np.zeros((F.size, 4, 3), complex)
    for i, e in enumerate((-1e-3, 0.0, 1.5e-3)):
        for s, size, j in ((POLE * (1 + e), 1.0, 0), (weak, 0.01, 1)):
            r = size * parts[j, i] / 2j * shapes[:, j]
            H[:, :, i] += r / (x[:, None] - s) + r.conj() / (x[:, None] - s.conjugate())
    noise = own.standard_normal(H.shape) + 1j * own.standard_normal(H.shape)
    # an error of a part of the response, common to nine lines: what is left is no white noise
    longer = own.standard_normal((F.size + 8, 4, 3)) / 3
    common = np.stack([longer[k : k + 9].sum(axis=0) for k in range(F.size)])
    return FrequencyResponse(values=H + 1e-5 * noise + 1e-3 * np.abs(H) * common, frequencies=F), shapes


@pytest.mark.slow
def test_a_weak_mode_beside_one_that_shifts_has_its_own_shape() -> None:
    response, shapes = shifting()
    modes = ms.select(ms.stabilize(response))
    assert modes.frequencies == pytest.approx([10, 11], rel=2e-3)
    assert np.all(np.diag(mac(modes.shapes, shapes)) > 0.95)
