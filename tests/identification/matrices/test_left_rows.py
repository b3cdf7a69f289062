"""Pencils of rows of a left factor on lines: the recurrence is multiplication by x there."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.identification.matrices.full import pencil_of
from modalscope.identification.matrices.line_columns import line_pencil
from modalscope.identification.matrices.matrix import RowShift
from modalscope.numerics.functions.polynomials import both_sums, orthogonal_basis
from tests.support import relative

DEGREE, OUTPUTS = 9, 3


@pytest.mark.parametrize("circle", [False, True])
@pytest.mark.parametrize("lines", [np.arange(40), np.array([3, 4, 17, 38])])
def test_pencils_on_lines_are_those_of_the_recurrence(circle: bool, lines: np.ndarray) -> None:
    rng, angles = np.random.default_rng(0), np.linspace(0.2, 2.0, 40)
    points = np.exp(1j * angles) if circle else 1j * angles
    basis, recurrence = orthogonal_basis(points, DEGREE)
    shape = 4, DEGREE, OUTPUTS
    F, scale = rng.standard_normal(shape) + 1j * rng.standard_normal(shape), rng.uniform(1, 2, OUTPUTS)
    values = 0.9 * np.exp(1j * rng.uniform(0.3, 1.5, 4))
    rows = pencil_of(RowShift(block=OUTPUTS, recurrence=recurrence), F.reshape(4, -1), values, OUTPUTS * (DEGREE + 1))
    expected = both_sums(basis[lines], rows.reshape(4, -1, OUTPUTS) / scale)
    found = line_pencil(basis[:, :DEGREE], points, F / scale, values).on(lines)
    for own, its in zip(found, expected, strict=True):
        assert relative(own, its) < 1e-12
