"""Gram matrices of windows by structure, and the triangle of a projection by either way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from modalscope import Signals, stabilize
from modalscope.identification.fast.window_gram import triangle_of, window_gram
from modalscope.identification.matrices import projections as module
from modalscope.identification.matrices.projections import projection
from tests.support import relative

ROUNDING = 1e-12


def ambient(noise: float, runs: int = 2, samples: int = 1500) -> Signals:
    """Return runs of four outputs of two modes under white forces, with noise on the outputs."""
    rng = np.random.default_rng(0)
    y = np.zeros((runs, samples, 4))
    for z, shape in ((0.98 * np.exp(0.6j), [1, 2, 3, 1]), (0.97 * np.exp(1.4j), [2, -1, 1, -2])):
        q = lfilter([0, 1], [1, -2 * z.real, abs(z) ** 2], rng.standard_normal((runs, samples)), axis=1)
        y += q[:, :, None] * np.array(shape)
    return Signals(outputs=y + noise * rng.standard_normal(y.shape), sampling_rate=10.0)


@pytest.mark.parametrize("blocks", [1, 2, 9])
def test_the_recursion_gives_the_gram_matrix_of_the_windows(blocks: int) -> None:
    y = np.random.default_rng(0).standard_normal((60, 3))
    windows = np.lib.stride_tricks.sliding_window_view(y, blocks, axis=0).transpose(0, 2, 1).reshape(-1, 3 * blocks)
    assert relative(window_gram(y, blocks), windows.T @ windows) < ROUNDING


def test_a_triangle_is_given_where_it_has_digits() -> None:
    X = np.random.default_rng(1).standard_normal((50, 6))
    sizes = 10.0 ** np.arange(-6, 6, 2)  # units do not count
    gram = (X * sizes).T @ (X * sizes)
    L = triangle_of(gram)
    assert L is not None
    assert relative(L @ L.T, gram) < ROUNDING
    assert triangle_of(np.ones((2, 2))) is None
    assert triangle_of(np.diag([1.0, 0.0])) is None
    near = X.copy()
    near[:, 5] = near[:, 4] + 1e-5 * near[:, 5]
    assert triangle_of(near.T @ near) is None


def test_both_ways_to_a_projection_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the Gram matrix of the windows and by orthogonalizing the windows: equal to nine digits, and so are the poles."""
    found = []
    for way in (triangle_of, lambda gram: None):
        monkeypatch.setattr(module, "triangle_of", way)
        matrix = projection(ambient(0.3), [2, 0], block_rows=6, block_columns=8)
        diagram = stabilize(
            ambient(0.3), method="ssi-data", orders=[4, 6, 8], block_rows=6, block_columns=8, deviations=False
        )
        found.append((matrix.future @ matrix.future.T, matrix.triangle @ matrix.triangle.T, diagram.poles))
    for ours, theirs in zip(*found, strict=True):
        assert relative(ours, theirs) < 1e-9


def test_records_without_noise_are_orthogonalized() -> None:
    """A free decay: its windows have the rank of the model, and no Gram matrix has digits for the rest."""
    k = np.arange(400)[:, None]
    decay = Signals(outputs=np.real(np.exp((-0.01 + 0.5j) * k) * np.array([[1, 2]])), sampling_rate=1.0)
    matrix = projection(decay, None, block_rows=4, block_columns=4)
    assert triangle_of(matrix._gram()) is None
    d = np.linalg.svd(matrix.triangle, compute_uv=False)
    assert d[3] < 1e-8 * d[0]  # two states, and the mean that was taken off
