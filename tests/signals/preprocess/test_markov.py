"""Observers: exact without noise, efficient with it."""

import numpy as np
import pytest
from hypothesis import given, settings

from modalscope.data import DataError, Signals
from modalscope.signals.preprocess import estimate_markov
from tests.support import add_noise, match_poles, random_system, random_systems, relative

#: Poles in rad/s for a sampling rate of 1 Hz.
RATE = 1.0


def record(model, samples=4000, seed=0, runs=None, start=None):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((runs or 1, samples, model.B.shape[1]))
    y = np.stack([model.simulate(run, rng.standard_normal(model.order) if start else None) for run in u])
    return Signals(outputs=y[0] if runs is None else y, inputs=u[0] if runs is None else u, sampling_rate=RATE)


def era_poles(Y, order, rows=40, columns=400):
    """The eigensystem realization algorithm in six lines, so that the test stands on its own."""
    columns = min(columns, Y.shape[0] - rows - 1)
    H = np.block([[Y[i + j] for j in range(columns)] for i in range(rows + 1)])
    l = Y.shape[1]
    P, d, Q = np.linalg.svd(H[: rows * l], full_matrices=False)
    left, right = P[:, :order] / np.sqrt(d[:order]), Q[:order].T / np.sqrt(d[:order])
    return np.log(np.linalg.eigvals(left.T @ H[l:] @ right).astype(complex))


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(model=random_systems(direct=True))
def test_markov_parameters_are_exact_without_noise(model):
    data = record(model, samples=1500, start=True)
    found = estimate_markov(data, samples=200)
    # whatever the state at the start; rounding grows with the spread of the states' sizes
    assert relative(found.values, model.markov_parameters(200)) < 1e-6
    assert relative(found.feedthrough, model.D) < 1e-6


@pytest.mark.slow
def test_poles_of_random_systems_without_noise():
    """Four outputs, two inputs, 20 states, 4000 samples: 1e-9."""
    for seed in range(5):
        model = random_system(np.random.default_rng(seed), outputs=4, inputs=2, modes=10, direct=True)
        found = estimate_markov(record(model, seed=seed))
        assert "an observer of order 5 " in found.processing[-1]  # 5 x 4 outputs are the 20 states
        assert match_poles(era_poles(found.values, 20), np.log(model.poles)).frequency_error < 1e-9


@pytest.mark.study("inputs")
def test_poles_of_twenty_random_systems_at_40_db(study):
    """Median over systems of the worst frequency error; up to 5 % of damping.

    The Cramer-Rao bound's own median is 8.5e-5 there; with modes up to 30 % it is 1.5e-3, and no method can do better.
    """
    for highest, limit in ((0.05, 2e-4), (0.3, 3e-3)):
        errors = []
        for seed in range(20):
            rng = np.random.default_rng(seed)
            model = random_system(rng, outputs=4, inputs=2, modes=10, direct=True, damping=(0.001, highest))
            found = estimate_markov(add_noise(record(model, seed=seed), 40, rng))
            errors.append(match_poles(era_poles(found.values, 20), np.log(model.poles)).frequency_error)
        table = study(
            f"observer and ERA, 10 modes, 40 dB, damping up to {highest:g}", "20 random systems, seeds 0 to 19"
        )
        table.row("relative frequency error of the worst mode, median", np.median(errors), most=limit, form=".1e")
        assert not table.missed


def test_several_runs_are_used_together():
    model = random_system(np.random.default_rng(1), outputs=2, inputs=2, modes=4, direct=True)
    data = record(model, samples=200, runs=5, start=True)
    assert relative(estimate_markov(data, samples=100).values, model.markov_parameters(100)) < 1e-6


def test_a_slow_response_is_not_cut_without_a_word():
    slow = random_system(np.random.default_rng(2), outputs=1, inputs=1, modes=1, damping=(0.0001, 0.0002))
    found = estimate_markov(record(slow, samples=500))
    assert found.samples == 500
    assert "before it has decayed" in found.processing[-1]
    fast = random_system(np.random.default_rng(2), outputs=1, inputs=1, modes=1, damping=(0.1, 0.2))
    found = estimate_markov(record(fast, samples=2000))
    assert "decayed by 80 dB" in found.processing[-1]
    assert np.abs(found.values[-1]).max() < 1e-4 * np.abs(found.values).max()


@pytest.mark.parametrize(
    ("data", "options", "text"),
    [
        (Signals(outputs=np.ones((50, 1)), sampling_rate=1.0), {}, "the record has no inputs"),
        (Signals(outputs=np.eye(20), inputs=np.eye(20), sampling_rate=1.0), {}, "Lower observer_order"),
        (
            Signals(outputs=np.eye(50)[:, :1], inputs=np.eye(50)[:, :1], sampling_rate=1.0),
            {"observer_order": 40},
            "it has 81 unknowns",
        ),
    ],
)
def test_what_cannot_be_estimated_is_said(data, options, text):
    with pytest.raises(DataError, match=text):
        estimate_markov(data, **options)
