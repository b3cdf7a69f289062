"""Block sizes where none are given: a part of the samples or lines, what states need, and what channels allow."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import FrequencyResponse, ImpulseResponse, Signals
from modalscope.identification.matrices.hankel import companion_windows, default_blocks, default_windows
from modalscope.identification.matrices.lines import default_degree
from modalscope.identification.sizes import default_projection, default_shifts


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
    ("count", "outputs", "inputs", "order", "expected"),
    [
        (1200, 2, 3, 20, (200, 1000)),  # a sixth, and the rest
        (120, 2, 3, 20, (30, 90)),  # three times the states
        (
            12_000,
            4,
            1,
            20,
            (2000, 10_000),
        ),  # a randomized range: 18 000 rows and columns, where columns a sixth make 42 000
        (240_000, 4, 2, 20, (8250, 33_500)),  # 33 000 rows, 67 000 columns
        (240_000, 2, 4, 20, (33_500, 8250)),  # twice as precise as 33 000 rows, which are 16 500 blocks
        (2000, 50, 2, 60, (1340, 333)),  # a Gram matrix of 666 columns, not of 3334
        (600, 100, 3, 60, (500, 100)),
        (600, 100, 1, 60, (420, 180)),  # three times the states
        (40, 2, 3, 20, (20, 20)),  # half of the samples
        (2, 2, 3, 20, (1, 1)),
    ],
)
def test_truncations_span_a_sixth_of_the_samples_with_the_side_that_costs_least(
    count: int, outputs: int, inputs: int, order: int, expected: tuple[int, int]
) -> None:
    assert default_windows(samples(count, outputs, inputs), order, None, None) == expected


def test_what_is_given_of_a_truncation_is_kept_and_the_other_reads_the_rest() -> None:
    assert default_windows(samples(1000), 20, 7, None) == (7, 993)
    assert default_windows(samples(1000), 20, None, 990) == (10, 990)
    assert default_windows(samples(1000), 20, None, 100) == (900, 100)
    assert default_windows(samples(1000), 20, 8, 9) == (8, 9)


def test_truncations_of_correlations_keep_their_own_sizes() -> None:
    assert default_windows(samples(1000, kind="correlation"), 20, None, None) == (30, 120)


@pytest.mark.parametrize(("order", "expected"), [(20, (120, 1080)), (100, (150, 1050))])
def test_companion_forms_have_240_states_or_three_times_the_order(order: int, expected: tuple[int, int]) -> None:
    assert companion_windows(samples(1200), order, None, None) == expected


@pytest.mark.parametrize(("parts", "factor"), [(3, 1.125), (6, 1.44), (30, 5.35)])
def test_two_means_have_the_variance_that_the_choice_of_a_sixth_rests_on(parts: int, factor: float) -> None:
    """The pole of one mode that does not fade, to first order: (mean of the last s samples - mean of the first s) / r, r + s = N."""
    N = 3000
    r = N // parts
    s = N - r
    weights = (np.arange(N) >= r) / (r * s) - (np.arange(N) < s) / (r * s)
    # the same whichever side is the shorter: means over r samples that lie s apart
    assert np.allclose(weights, (np.arange(N) >= s) / (r * s) - (np.arange(N) < r) / (r * s))
    time = np.arange(N) - (N - 1) / 2
    least = 1 / np.sum(time**2)  # of the slope of a phase
    assert weights @ time == pytest.approx(1)
    assert weights @ weights / least == pytest.approx(factor, rel=1e-3)


@pytest.mark.parametrize(
    ("count", "order", "truncates", "expected"),
    [
        (1000, 20, True, 166),  # a sixth
        (6000, 20, True, 300),  # 600 rows in all
        (6000, 20, False, 120),  # 240 states
        (6000, 220, True, 330),  # three times the states
        (60, 2, True, 10),
        (60, 20, True, 20),  # a third of the samples
        (2, 20, True, 1),
    ],
)
def test_shifts_of_samples_are_a_sixth_of_them(count: int, order: int, truncates: bool, expected: int) -> None:
    assert default_shifts(samples(count), order, truncates=truncates) == expected


def test_shifts_of_lines_count_the_lines_of_both_signs() -> None:
    # 2 x 24 - 3 = 45 lines besides those at the ends, a third of which is 15
    assert default_shifts(lines(24), 20) == 15
    assert default_shifts(lines(500), 20) == (2 * 500 - 3) // 6


@pytest.mark.parametrize(
    ("count", "outputs", "inputs", "order", "truncates", "expected"),
    [
        (1000, 2, 3, 20, True, 333),  # a third of the lines
        (100, 2, 3, 20, True, 33),
        (1000, 5, 3, 20, True, 160),  # 800 rows in all
        (3000, 5, 3, 20, True, 100),  # 1.5 million rows times lines
        (4400, 7, 6, 20, True, 48),  # but 48 always
        (30_000, 20, 3, 20, True, 30),  # as far as that is 600 rows
        (1000, 200, 3, 20, True, 8),  # at least eight
        (1000, 20, 3, 1000, True, 51),  # as many block rows as the order needs, and one more
        (1000, 20, 3, 1001, True, 52),
        (10, 2, 3, 50, True, 2),  # no more than 2 x 10 - 50 / 3 (rounded up) - 1 carry
        (10, 1, 1, 18, True, 1),
        (1000, 3, 3, 20, False, 80),  # 240 states
        (1000, 10, 3, 20, False, 48),  # or those of a degree of 48
    ],
)
def test_the_degree_of_lines(count: int, outputs: int, inputs: int, order: int, truncates: bool, expected: int) -> None:
    assert default_degree(lines(count, outputs, inputs), order, truncates=truncates) == expected
