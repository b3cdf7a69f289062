"""The stages of an identification called one by one: what a diagram of data does at once."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms

ORDERS = range(2, 13, 2)


@pytest.fixture(scope="module")
def data() -> ms.FrequencyResponse:
    return ms.systems.chain5().frequency_response(np.linspace(0.2, 8, 200), noise=0.01, seed=0)


def test_a_diagram_of_a_factored_problem_is_that_of_the_data(data: ms.FrequencyResponse) -> None:
    pipeline = ms.factor(ms.prepare(data, method="alternate", band=(0.5, 7)), max(ORDERS))
    staged, direct = (
        ms.stabilize(pipeline, orders=ORDERS),
        ms.stabilize(data, method="alternate", band=(0.5, 7), orders=ORDERS),
    )
    np.testing.assert_array_equal(staged.poles, direct.poles)
    assert dict(staged.settings) == dict(direct.settings)


def test_a_sweep_over_a_factored_problem_factors_nothing_again(data: ms.FrequencyResponse) -> None:
    pipeline = ms.factor(ms.prepare(data, method="era", domain="z"), 10)
    sweep = ms.sweep(pipeline, orders=[4, 10])
    assert sweep.pipeline is pipeline
    assert [cut.order for cut in sweep] == [4, 10]


@pytest.mark.parametrize("verb", [ms.sweep, ms.stabilize])
def test_a_factored_problem_has_its_method_and_options_already(data: ms.FrequencyResponse, verb) -> None:
    pipeline = ms.factor(ms.prepare(data, method="alternate"), 10)
    with pytest.raises(ms.DataError, match=r"(?s)band=.*factored already.*Give band= to prepare"):
        verb(pipeline, band=(1, 2))


def test_only_a_problem_is_factored(data: ms.FrequencyResponse) -> None:
    with pytest.raises(ms.DataError, match="Problem"):
        ms.factor(data, 10)
