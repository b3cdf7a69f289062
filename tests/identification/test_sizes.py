"""Block sizes where none are given: three times as many rows as states, and what samples, lines and channels allow."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.identification.sizes import default_blocks, default_degree, default_projection, default_shifts
from modalscope.model import FrequencyResponse, ImpulseResponse, Signals


def samples(count: int, outputs: int = 2, inputs: int = 3, kind: str = "dirac") -> ImpulseResponse:
    return ImpulseResponse(values=np.ones((count, outputs, inputs)), sampling_rate=50.0, kind=kind)


def lines(count: int, outputs: int = 2, inputs: int = 3) -> FrequencyResponse:
    return FrequencyResponse(values=1j * np.ones((count, outputs, inputs)), frequencies=np.arange(1.0, count + 1))


@pytest.mark.parametrize(
    ("count", "order", "expected"),
    [
        (1000, 20, (30, 134)),  # 3 x 20 / 2 rows; 20 x 20 / 3 columns, rounded up
        (1000, 21, (32, 140)),  # 63 / 2, rounded up
        (1000, 2, (10, 14)),  # at least ten rows
        (1000, 1, (10, 10)),  # and ten columns
        (100, 20, (30, 70)),  # the rest of the samples
        (40, 20, (20, 20)),  # half of the samples
        (2, 20, (1, 1)),
    ],
)
def test_blocks_of_samples(count: int, order: int, expected: tuple[int, int]) -> None:
    assert default_blocks(samples(count), order, None, None) == expected


def test_no_fewer_columns_than_rows() -> None:
    assert default_blocks(samples(1000, 2, 30), 60, None, None) == (90, 90)


@pytest.mark.parametrize(
    ("count", "order", "expected"), [(1000, 20, (30, 120)), (1000, 2, (10, 80)), (100, 20, (30, 70))]
)
def test_correlations_get_four_times_as_many_columns_as_rows_and_at_least_eighty(
    count: int, order: int, expected: tuple[int, int]
) -> None:
    assert default_blocks(samples(count, kind="correlation"), order, None, None) == expected


def test_what_is_given_is_kept_and_the_other_fitted_to_it() -> None:
    assert default_blocks(samples(100), 20, 7, None) == (7, 93)
    assert default_blocks(samples(100), 20, None, 90) == (10, 90)
    assert default_blocks(samples(100), 20, 8, 9) == (8, 9)


def records(count: int, outputs: int, runs: int | None = None) -> Signals:
    shape = (count, outputs) if runs is None else (runs, count, outputs)
    return Signals(outputs=np.random.default_rng(0).standard_normal(shape), sampling_rate=50.0)


@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (100_000, 75),  # half of the 30 + 120 lags of the correlation
        (5000, 50),  # two rows of the past in a hundred times, two outputs
        (4000, 40),
        (2000, 30),  # the block rows of the correlation
    ],
)
def test_projected_records_get_the_lags_of_their_correlation_as_far_as_there_are_times(
    count: int, expected: int
) -> None:
    correlation = samples(1000, 2, 2, "correlation")
    assert default_projection(records(count, 2), correlation, 20, None, None) == (expected, expected)


def test_runs_count_as_times_and_many_outputs_shorten_the_past() -> None:
    correlation = samples(1000, 2, 2, "correlation")
    assert default_projection(records(1000, 2, runs=5), correlation, 20, None, None) == (50, 50)
    # at most 600 rows of 20 outputs
    many = samples(1000, 20, 20, "correlation")
    assert default_projection(records(100_000, 20), many, 20, None, None) == (30, 30)


def test_of_a_projection_each_side_can_be_given() -> None:
    correlation = samples(1000, 2, 2, "correlation")
    assert default_projection(records(5000, 2), correlation, 20, 7, None) == (7, 50)
    assert default_projection(records(5000, 2), correlation, 20, None, 9) == (50, 9)


@pytest.mark.parametrize(
    ("count", "order", "expected"), [(1000, 20, 30), (1000, 21, 32), (1000, 2, 10), (60, 20, 20), (2, 20, 1)]
)
def test_shifts_of_samples_are_three_times_the_states_up_to_a_third_of_the_samples(
    count: int, order: int, expected: int
) -> None:
    assert default_shifts(samples(count), order) == expected


def test_shifts_of_lines_count_the_lines_of_both_signs() -> None:
    # 2 x 24 - 3 = 45 lines besides those at the ends, a third of which is 15
    assert default_shifts(lines(24), 20) == 15
    assert default_shifts(lines(500), 20) == 30


@pytest.mark.parametrize(
    ("count", "outputs", "inputs", "order", "expected"),
    [
        (1000, 2, 3, 20, 48),
        (100, 2, 3, 20, 25),  # a quarter of the lines
        (1000, 20, 3, 20, 30),  # 600 rows in all
        (1000, 200, 3, 20, 8),  # at least eight
        (1000, 2, 3, 120, 61),  # as many block rows as the order needs, and one more
        (1000, 2, 3, 121, 62),
        (10, 2, 3, 50, 2),  # no more than 2 x 10 - 50 / 3 (rounded up) - 1 carry
        (10, 1, 1, 18, 1),
    ],
)
def test_the_degree_of_lines(count: int, outputs: int, inputs: int, order: int, expected: int) -> None:
    assert default_degree(lines(count, outputs, inputs), order) == expected
