"""Projected records: the triangular factor by chunks against the definition, the poles in it, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import modalscope as ms
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.projections import projection
from modalscope.identification.realizations.shift import shift


def noise(runs: int, samples: int, outputs: int, seed: int) -> ms.Signals:
    y = np.random.default_rng(seed).standard_normal((runs, samples, outputs))
    return ms.Signals(outputs=y.cumsum(axis=1) * 0.1 + y, sampling_rate=10.0)


def dense_projection(signals: ms.Signals, references: list[int], q: int, p: int) -> np.ndarray:
    """The future projected on the past, one column a time of every run, written out by the definition."""
    past, future = [], []
    for run in signals.by_run()[0]:
        y = run - run.mean(axis=0)
        for t in range(p, len(y) - q):
            past.append(np.concatenate([y[t - k, references] for k in range(1, p + 1)]))
            future.append(np.concatenate([y[t + k] for k in range(q + 1)]))
    Yp, Yf = np.array(past).T, np.array(future).T
    return Yf @ Yp.T @ np.linalg.solve(Yp @ Yp.T, Yp) / np.sqrt(Yp.shape[1])


@settings(max_examples=15, deadline=None)
@given(
    runs=st.integers(1, 3),
    outputs=st.integers(1, 3),
    q=st.integers(1, 4),
    p=st.integers(1, 5),
    alone=st.booleans(),
    seed=st.integers(0, 99),
)
def test_the_triangular_factor_by_chunks_has_the_gram_matrix_of_the_projection(runs, outputs, q, p, alone, seed):
    # up to 27 rows, 108 times a chunk: several chunks a run, the last one short
    record = noise(runs, 350, outputs, seed)
    chosen = [outputs - 1] if alone else list(range(outputs))
    L = projection(record, chosen, q, p).tall().dense()
    by_definition = dense_projection(record, chosen, q, p)
    expected = by_definition @ by_definition.T
    assert L.shape == (outputs * (q + 1), len(chosen) * p)
    # the normal equations behind the definition square a condition of about 100: 1e-12, with room
    assert np.allclose(L @ L.T, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_the_order_of_the_runs_makes_no_difference():
    record = noise(3, 200, 2, 0)
    turned = ms.Signals(outputs=record.outputs[::-1], sampling_rate=10.0)
    a, b = (projection(s, None, 3, 4).tall().dense() for s in (record, turned))
    assert np.allclose(a @ a.T, b @ b.T, rtol=0, atol=1e-12 * np.abs(a @ a.T).max())


def test_both_shifted_matrices_are_the_blocks_of_the_tall_one():
    matrix = projection(noise(1, 300, 2, 1), ["y2"], 3, 6)
    tall = matrix.tall().dense()
    assert np.array_equal(matrix.shifted(0).dense(), tall[:-2])
    assert np.array_equal(matrix.shifted(1).dense(), tall[2:])
    assert np.array_equal(matrix.first_rows(np.eye(6), 1), tall[2:4])
    assert (matrix.outputs, matrix.block_rows, matrix.columns) == (2, 3, 291)


def test_free_decays_without_noise_give_the_poles_to_rounding():
    chain = ms.systems.chain5()
    decays = chain.state_space(dt=0.05).impulse_response(400).values.transpose(2, 0, 1)
    matrix = projection(ms.Signals(outputs=decays, sampling_rate=20.0), None, 10, 10)
    # ten states, and the mean taken off each run: as many constants, poles z = 1
    order = 10 + len(decays)
    factors = factorize(matrix.tall(), order)
    assert factors.rank == order
    poles = np.linalg.eigvals(shift(matrix, factors).triple(order).A)
    exact = chain.modes().poles
    z = np.concatenate([np.exp(exact * 0.05), np.exp(exact.conj() * 0.05), [1.0]])
    # rounding times the ratio of the first to the last singular value, about 1e4, with room
    assert np.max(np.min(np.abs(z[:, None] - poles), axis=1)) < 1e-9


@pytest.mark.study("ambient")
def test_the_poles_of_white_driven_records_converge_with_their_length(study):
    building = ms.systems.spring_chain()
    modes = building.modes()
    exact, errors = modes.poles, []
    for samples in (3000, 300000):
        away = []
        for seed in range(3):
            record = building.simulate(inputs="ambient", samples=samples, sampling_rate=20.0, seed=seed)
            matrix = projection(record, None, 12, 12)
            found = matrix.to_s(np.linalg.eigvals(shift(matrix, factorize(matrix.tall(), 10)).triple(10).A))
            away.append(np.min(np.abs(exact[:, None] - found), axis=1) / np.abs(exact))
        errors.append(np.sqrt(np.mean(np.square(away))))
    # the scatter falls with the root of the length, by ten, and three records tell it to a factor of two
    table = study(
        "spring chain under white forces, covariance-driven projection, order 10",
        "3 records of each length, seeds 0 to 2",
    )
    table.row("largest ratio of pole errors, 300 000 to 3000 samples", np.max(errors[1] / errors[0]), most=1 / 5)
    # at best frequency and damping have variances zeta / (2 w T) each; without a model of the forces, within thrice that scatter
    best = np.sqrt(np.mean(modes.damping_ratios / np.abs(exact)) / (300000 / 20))
    table.row("pole errors of 300 000 samples over the least possible", errors[1] / best, most=3)
    assert not table.missed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"references": []}, "at least one"),
        ({"references": ["y1", "y1"]}, "Name every reference once"),
        ({"references": ["y7"]}, "y7"),
        ({"block_rows": 0}, "block_rows"),
        ({"block_columns": 40}, "Lower block_rows and block_columns"),
    ],
)
def test_what_cannot_be_projected_is_said_with_what_to_change(change, words):
    with pytest.raises(ms.DataError, match=words):
        projection(noise(1, 100, 2, 0), **{"block_rows": 4, "block_columns": 4, **change})
