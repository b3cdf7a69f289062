"""Records projected on past inputs and outputs: the definition, exact poles, what instruments cure, and the noise model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla
from hypothesis import given, settings, strategies as st

from modalscope.data import Records, Signals, StateSpace
from modalscope.identification.matrices.driven import driven_projection, intervals
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.modal.eigenmodes import eigenmodes
from modalscope.identification.modal.state_space import state_space
from modalscope.identification.realizations.shift import shift
from tests.support import match_poles, random_system, refused, relative


def record(model, samples, seed=0, offset=0.0, **channels):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples, model.B.shape[1]))
    y = model.simulate(u, rng.standard_normal(model.order))
    return Signals(outputs=y + offset, inputs=u, sampling_rate=1.0, **channels)


def identified(records, order, q=10, p=10):
    """Model and modes of one order, as the row of the table finds them."""
    matrix = driven_projection(records, q, p)
    triple = shift(matrix, factorize(matrix.tall(), order)).triple(order)
    modes = eigenmodes(matrix, triple)
    return state_space(matrix, triple, modes), modes


@settings(max_examples=10, deadline=None)
@given(l=st.integers(1, 3), m=st.integers(1, 2), q=st.integers(1, 4), p=st.integers(1, 4), seed=st.integers(0, 99))
def test_the_triangle_has_the_gram_matrix_of_the_projection(l, m, q, p, seed):
    """Two runs of noise: what past explains of the future once constants and future inputs are taken out of both."""
    rng = np.random.default_rng(seed)
    runs = [
        Signals(outputs=rng.standard_normal((n, l)), inputs=rng.standard_normal((n, m)), sampling_rate=1.0)
        for n in (150, 210)
    ]
    matrix = driven_projection(Records(runs=tuple(runs)), q, p)
    known, past, future = [], [], []
    for r, run in enumerate(runs):
        for t in range(p, run.samples - q):
            known.append(np.r_[np.eye(2)[r], run.inputs[t : t + q + 1].ravel()])
            past.append(np.r_[tuple(np.r_[run.outputs[t - k], run.inputs[t - k]] for k in range(1, p + 1))])
            future.append(run.outputs[t : t + q + 1].ravel())
    K, P, F = (np.array(rows).T for rows in (known, past, future))
    P, F = (X - X @ np.linalg.pinv(K) @ K for X in (P, F))
    expected = F @ np.linalg.pinv(P) @ P @ F.T / P.shape[1]
    level = np.tile(matrix.scales[0], q + 1)
    L = matrix.mixing @ matrix.tall().dense() * level[:, None]
    assert L.shape == (l * (q + 1), p * (l + m))
    assert np.allclose(L @ L.T, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    # what is left over is what the rows are whitened by
    rest = F @ F.T / P.shape[1] - expected
    noise = matrix.mixing * level[:, None]
    assert np.allclose(noise @ noise.T, rest, rtol=0, atol=1e-9 * np.abs(rest).max())


@pytest.mark.parametrize("seed", range(6))
def test_exact_without_noise_whatever_the_start_and_the_offset(seed):
    rng = np.random.default_rng(seed)
    modes, m = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    model = random_system(rng, outputs=int(rng.integers(2, 5)), inputs=m, modes=modes, direct=True)
    found, own = identified(Records(runs=(record(model, 900, seed, offset=3.0),)), 2 * modes)
    assert match_poles(own.poles, np.log(model.poles)).frequency_error < 1e-9
    assert relative(found.markov_parameters(40), model.markov_parameters(40)) < 1e-7
    assert relative(found.D, model.D) < 1e-7
    assert np.abs(found.innovation_covariance).max() < 1e-15  # nothing is new


def test_a_long_past_in_few_rows_is_exact_too():
    model = random_system(np.random.default_rng(8), outputs=2, inputs=1, modes=3, direct=True)
    matrix = driven_projection(Records(runs=(record(model, 900),)), 12, 60, single=4)
    assert matrix.past == 3 * len(intervals(60, 4)) == 3 * 12  # 4, then 2, 2, 3, 5, 8, 11, 17 and what is left of 60
    triple = shift(matrix, factorize(matrix.tall(), 6)).triple(6)
    assert match_poles(eigenmodes(matrix, triple).poles, np.log(model.poles)).frequency_error < 1e-9


@pytest.mark.parametrize(("samples", "single"), [(1, 1), (5, 9), (9, 9), (60, 4), (120, 1)])
def test_intervals_take_every_sample_once_and_keep_lengths(samples, single):
    T = intervals(samples, single)
    assert np.array_equal(np.count_nonzero(T, axis=0), np.ones(samples))
    assert np.allclose(T @ T.T, np.eye(len(T)))
    kept = min(samples, single)
    assert np.array_equal(T[:kept, :kept], np.eye(kept))


def test_runs_of_unequal_length_and_roving_inputs():
    model = random_system(np.random.default_rng(3), outputs=3, inputs=2, modes=3, direct=True)
    one = record(model, 400, 1, input_dofs=["a", "b"])
    force = np.random.default_rng(9).standard_normal((700, 1))
    y = model.simulate(np.hstack([0 * force, force]), np.ones(6))
    other = Signals(outputs=y, inputs=force, sampling_rate=1.0, input_dofs=["b"])
    found, own = identified(Records(runs=(one, other)), 6)
    assert match_poles(own.poles, np.log(model.poles)).frequency_error < 1e-9
    assert relative(found.markov_parameters(40), model.markov_parameters(40)) < 1e-7


def test_units_of_the_channels_make_no_difference():
    model = random_system(np.random.default_rng(2), outputs=3, inputs=2, modes=3)
    data = record(model, 800)
    noisy = replace(data, outputs=data.outputs + 0.05 * np.random.default_rng(1).standard_normal(data.outputs.shape))
    scaled = replace(noisy, outputs=noisy.outputs * [1e-6, 1.0, 1e5], inputs=noisy.inputs * [1e3, 1e-3])
    a, b = (identified(Records(runs=(each,)), 6)[1].poles for each in (noisy, scaled))
    assert np.allclose(np.sort_complex(a), np.sort_complex(b), rtol=1e-8)


def unmeasured(seed, samples=3000, colour=0.0):
    """Two modes under a measured force and a hidden one of its size, white or coloured, and noise on the outputs."""
    model = random_system(np.random.default_rng(7), outputs=2, inputs=2, modes=2, damping=(0.01, 0.02))
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples + 1000, 2))
    for k in range(1, len(u)):
        u[k, 1] += colour * u[k - 1, 1]
    y = model.simulate(u)[1000:]
    y = y + 0.02 * y.std(axis=0) * rng.standard_normal(y.shape)
    return model, Records(runs=(Signals(outputs=y, inputs=u[1000:, :1], sampling_rate=1.0),))


def damping_bias(seeds, colour, order=4):
    """Mean and deviation over seeds of the relative damping error of every mode."""
    errors = []
    for seed in range(seeds):
        model, records = unmeasured(seed, colour=colour)
        truth = np.log(model.poles)
        truth = truth[truth.imag > 0]
        poles = identified(records, order, 20, 12)[1].poles
        nearest = poles[np.argmin(np.abs(poles - truth[:, None]), axis=1)]
        errors.append((nearest.real / np.abs(nearest)) / (truth.real / np.abs(truth)) - 1)
    return np.mean(errors, axis=0), np.std(errors, axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("colour", [0.0, 0.6])
def test_unmeasured_forces_leave_no_bias(colour):
    """30 seeds: the mean's own deviation is .18 of the scatter, so .5 is nearly three of them; a coloured force is two states more."""
    bias, scatter = damping_bias(30, colour, order=4 if colour == 0 else 6)
    assert np.all(np.abs(bias) < 0.5 * scatter)


@pytest.mark.study("inputs")
@pytest.mark.parametrize("colour", [0.0, 0.6])
def test_unmeasured_forces_leave_no_bias_over_two_hundred_seeds(colour, study):
    bias, scatter = damping_bias(200, colour, order=4 if colour == 0 else 6)
    table = study(f"subspace, force not measured, colour {colour:g}", "200 records, seeds 0 to 199")
    table.row("damping: bias of the modes", 100 * bias, form=".2f", unit=" %")
    table.row("damping: bias over scatter", bias / scatter, least=-0.5, most=0.5, form=".2f")
    assert not table.missed


def test_the_gain_is_that_of_the_riccati_equation():
    """Process and measurement noise: K and the innovations' covariance, and predictions whose errors are white."""
    rng = np.random.default_rng(0)
    model = random_system(rng, outputs=2, inputs=1, modes=1, damping=(0.05, 0.1))
    N, q, r = 40_000, 0.3, 0.5
    u, w, v = rng.standard_normal((N, 1)), q * rng.standard_normal((N, 2)), r * rng.standard_normal((N, 2))
    noisy = StateSpace(A=model.A, B=np.hstack([model.B, np.eye(2)]), C=model.C, dt=1.0)
    data = Signals(outputs=noisy.simulate(np.hstack([u, w])) + v, inputs=u, sampling_rate=1.0)
    found, _ = identified(Records(runs=(data,)), 2)
    P = sla.solve_discrete_are(model.A.T, model.C.T, q**2 * np.eye(2), r**2 * np.eye(2))
    S = model.C @ P @ model.C.T + r**2 * np.eye(2)
    K = model.A @ P @ model.C.T @ np.linalg.inv(S)
    # C A^k K does not depend on coordinates; 40 000 samples give coefficients to 1 / sqrt(N) = .5 % of the noise, ten of them make K
    follows, expected = (
        np.concatenate([C @ np.linalg.matrix_power(A, k) @ G for k in range(8)])
        for A, C, G in ((found.A, found.C, found.gain), (model.A, model.C, K))
    )
    assert relative(follows, expected) < 0.05
    assert relative(found.innovation_covariance, S) < 0.03
    e = data.outputs - found.predict(data)
    e = e[100:]  # the start is unknown
    assert relative(e.T @ e / len(e), S) < 0.03
    lagged = e[1:].T @ e[:-1] / len(e)
    assert np.abs(lagged).max() < 5 * np.abs(S).max() / np.sqrt(N)


def test_what_cannot_be_projected_is_said():
    model = random_system(np.random.default_rng(3), outputs=3, inputs=2, modes=2)
    refused("give 20 times for 96 rows", driven_projection, Records(runs=(record(model, 38),)), 8, 10)
    bare = Signals(outputs=np.random.default_rng(0).standard_normal((100, 2)), sampling_rate=1.0)
    refused("need inputs", driven_projection, Records(runs=(bare,)))
