"""The controllable form: models are turned back, and both sides follow the modes wherever the samples begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.identification.matrices.evolved import Evolved, ModalSide
from modalscope.identification.matrices.hankel import TurnedHankel
from tests.support import FIVE, built, relative

WHOLE = FIVE["chain5"]().impulse_response(200)
LATE = replace(WHOLE, values=WHOLE.values[7:], first_sample=7)
OPTIONS = {"form": "controllable", "block_rows": 12, "block_columns": 20}


def evolved(side: ModalSide | None) -> tuple[np.ndarray, np.ndarray]:
    """Return a factor in modal coordinates, and what the modes make of its first block."""
    assert isinstance(side, Evolved)
    return side.blocks @ side.states, side.first * side.evolution[:, None]


@pytest.mark.parametrize("method", ["era", "alternate"])
@pytest.mark.parametrize("response", [WHOLE, LATE], ids=["from the impulse", "seven samples late"])
def test_without_noise_both_factors_run_as_the_modes_do(response, method):  # type: ignore[no-untyped-def]
    pipeline = built(response, 10, method=method, **OPTIONS)
    matrix, model = pipeline.matrix, pipeline.triple(10)
    assert isinstance(matrix, TurnedHankel)
    eigen = model.eigen()
    fit = matrix.fit(model, eigen)
    rows, columns = matrix.row_side(model, eigen, fit), matrix.column_side(model, eigen, fit)
    for side in (rows, columns):
        assert relative(*evolved(side)) < 1e-7
    # the rows start with the shapes, the columns with the participation at the first sample there is
    assert rows is not None
    assert columns is not None
    assert relative(rows.first, fit.shapes) < 1e-12
    at_first = fit.participation * eigen.values[:, None] ** response.first_sample
    assert relative(columns.first, at_first.T) < 1e-12


def test_the_model_is_that_of_the_response_not_of_its_transpose():
    pipeline = built(WHOLE, 10, method="era", **OPTIONS)
    model = pipeline.triple(10)
    assert model.B is not None
    markov = [model.C @ np.linalg.matrix_power(model.A, k) @ model.B for k in range(5)]
    assert relative(markov, WHOLE.values[:5]) < 1e-9
    assert (pipeline.matrix.outputs, pipeline.matrix.block_rows) == (WHOLE.values.shape[1], 12)
    assert pipeline.matrix.judged is WHOLE
