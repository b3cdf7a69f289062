"""What is made of the peaks of thousands of outputs is of the size of the data, not of the outputs squared."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from modalscope.data import FrequencyResponse
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.selection.likelihood.matched import (
    _side_by_side,
    explained_by_channel,
    grid_of,
    line_filters,
    residues_by_channel,
    strongest_peaks,
)

LINES, OUTPUTS, INPUTS = 60, 5000, 2


def test_the_peaks_of_five_thousand_outputs_stay_below_100_mb() -> None:
    """The left vectors of one residue of full size alone take 400 MB."""
    rng = np.random.default_rng(0)
    f = np.linspace(10, 20, LINES)
    light = FrequencyResponse(values=np.full((LINES, 1, 1), 1j), frequencies=f)
    pole = 2 * np.pi * 15 * (-0.01 + 1j)
    shape, sides = rng.standard_normal((2, max(OUTPUTS, INPUTS)))
    H = (1 / (2j * np.pi * f - pole))[:, None, None] * np.outer(shape[:OUTPUTS], sides[:INPUTS])
    left = np.concatenate([H.real, H.imag])
    del H
    tracemalloc.start()
    (found,) = strongest_peaks(light, left, np.ones(2 * LINES), np.zeros(0, complex), 1.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100e6
    assert found.pole.imag == pytest.approx(pole.imag, rel=0.02)
    assert abs(found.shape.conj() @ shape) == pytest.approx(np.linalg.norm(shape), rel=1e-9)
    assert found.participation.shape == (INPUTS,)


def test_what_poles_explain_in_five_thousand_outputs_stays_below_100_mb() -> None:
    """The residues of all poles in all channels alone take 70 MB; each is that of sums over its lines, for every channel by itself."""
    rng = np.random.default_rng(0)
    f = np.linspace(10, 60, 400)
    light = FrequencyResponse(values=np.full((f.size, 1, 1), 1j), frequencies=f)
    left = rng.standard_normal((2 * f.size, OUTPUTS, INPUTS))
    variance = rng.uniform(1, 3, (f.size, OUTPUTS, INPUTS))
    rows, poles = np.tile(rng.uniform(1, 2, f.size), 2), grid_of(light)[::3]
    tracemalloc.start()
    explained = explained_by_channel(light, left, variance, rows, poles)
    residues = [residues_by_channel(light, left, variance, rows, poles[k]) for k in (401, 7)]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100e6
    for k, R in zip((401, 7), residues, strict=True):
        ((near, together),) = [(some, used) for some, used, *_ in _side_by_side(light, poles, len(left)) if k in some]
        assert len(near) > 1
        ((_, alone, *_),) = _side_by_side(light, poles[[k]], len(left))

        def plain(used: slice, k: int = k) -> tuple[ComplexArray, RealArray]:
            g = line_filters(f[used], None, poles[[k]])[0][0]
            e = np.stack([left[: f.size], left[f.size :]])[:, used] / rows[: f.size][used, None, None]
            weights = 2 / variance[used]
            size = np.einsum("gif,gif,fol->ol", g, g, weights / rows[: f.size][used, None, None] ** 2) / 2
            return np.einsum("if,fol,ifol->ol", g[0] + 1j * g[1], weights, e) / size, size

        np.testing.assert_allclose(R, plain(alone)[0], rtol=1e-9, atol=1e-12 * abs(R).max())
        of_neighbours, size = plain(together)
        assert explained[k] == pytest.approx(np.sum(abs(of_neighbours) ** 2 * size), rel=1e-9)
