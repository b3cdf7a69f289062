"""What needs only sums over the left factor goes without it: against the factor itself, and against the dense decomposition."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from modalscope import ImpulseResponse, stabilize
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.hankel import hankel
from modalscope.identification.modal.accuracy import followed
from modalscope.identification.modal.eigenmodes import eigenmodes
from modalscope.identification.realizations.balanced import balanced
from modalscope.numerics.functions.poles import poles_from
from tests.support import relative


def response(outputs: int = 12, inputs: int = 3, samples: int = 160) -> ImpulseResponse:
    rng = np.random.default_rng(3)
    s = poles_from(np.sort(rng.uniform(0.05, 0.4, 5)), rng.uniform(0.005, 0.03, 5))
    C, B = rng.standard_normal((outputs, 5)), rng.standard_normal((5, inputs))
    values = 2 * np.real((C * np.exp(np.arange(samples)[:, None] * s)[:, None]) @ B)
    return ImpulseResponse(values=values + 0.05 * rng.standard_normal(values.shape), sampling_rate=1.0)


def test_models_and_indicators_are_those_of_the_left_factor() -> None:
    matrix = hankel(response(), block_rows=60, block_columns=70)
    lazy = factorize(matrix.shifted(0), 16, "gram")
    assert lazy.unmade
    assert lazy.left.shape == (720, 16)
    made = replace(lazy, left=lazy.P)
    assert not made.unmade
    assert relative(made.P.T @ made.P, np.eye(16)) < 1e-11
    ours, theirs = (balanced(matrix, factors) for factors in (lazy, made))
    assert relative(ours.A, theirs.A) < 1e-10
    for n in (10, 16):
        modes = [eigenmodes(matrix, each.triple(n)) for each in (ours, theirs)]
        assert relative(modes[0].poles, modes[1].poles) < 1e-10
        sides = [matrix.row_side(ours.triple(n), modes[0].eigen, modes[0].fit)]
        sides.append(matrix.row_side(replace(ours.triple(n), factors=made), modes[0].eigen, modes[0].fit))
        assert type(sides[0]) is not type(sides[1])
        for first, second in zip(*(followed(side) for side in sides if side is not None), strict=True):
            np.testing.assert_allclose(first, second, atol=1e-9)


@pytest.mark.parametrize("shape", [(12, 3), (3, 8)])
@pytest.mark.parametrize("method", ["era", "least_squares", "alternate"])
def test_diagrams_are_those_of_the_dense_route(method: str, shape: tuple[int, int]) -> None:
    options: dict[str, Any] = {"orders": [10, 16], "block_rows": 60, "block_columns": 70, "deviations": False}
    found, dense = (
        stabilize(response(*shape), method=method, factorization=way, **options) for way in ("gram", "dense")
    )
    assert relative(found.poles, dense.poles) < 1e-8
    for name, values in dense.indicators.items():
        np.testing.assert_allclose(found.indicators[name], values, atol=1e-7, err_msg=name)
