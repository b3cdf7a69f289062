"""Records: exact simulation, stationary starts, and noise of the size that was asked."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope import systems
from modalscope.systems.records import _stationary_root
from tests.support import add_noise, relative


def test_the_same_seed_gives_the_same_record() -> None:
    chain = systems.chain5()
    a, b, c = (chain.simulate(samples=50, noise=0.1, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(a.outputs, b.outputs)
    assert not np.array_equal(a.outputs, c.outputs)


def test_a_record_of_own_forces_is_the_convolution_with_the_pulse_response() -> None:
    chain, forces = systems.chain5(), np.random.default_rng(0).standard_normal((60, 2))
    record = chain.simulate(inputs=forces)
    Y = chain.impulse_response(60, quantity="acceleration")
    assert Y.feedthrough is not None
    direct = forces @ Y.feedthrough.T
    past = np.stack(
        [sum((Y.values[j] @ forces[k - 1 - j] for j in range(k)), np.zeros(4)) for k in range(60)]
    )  # y(k) = D u(k) + sum Y(j) u(k-1-j) (Eq. 78 with Y(0) = C B)
    np.testing.assert_allclose(record.outputs, direct + past, atol=1e-12)
    np.testing.assert_array_equal(record.inputs, forces)
    assert record.input_dofs == ("2:+X", "5:+X")


def test_an_ambient_record_keeps_its_forces_to_itself_and_is_stationary_from_the_first_sample() -> None:
    chain = systems.spring_chain(2, damping_ratio=0.1)
    record = chain.simulate(inputs="ambient", samples=20, runs=4000, quantity="displacement", sampling_rate=10, seed=1)
    assert record.inputs is None
    assert record.input_dofs == ()
    model = chain.state_space(dt=0.1)
    P = sla.solve_discrete_lyapunov(model.A, model.B @ model.B.T)
    expected = np.diag(model.C @ P @ model.C.T)
    # 4000 independent runs: a variance scatters by sqrt(2 / 4000) = 2.2 %; four times that, at the first and last sample
    for sample in (0, -1):
        np.testing.assert_allclose(record.outputs[:, sample].var(axis=0), expected, rtol=0.09)


def test_a_stationary_start_is_stationary_however_fast_it_is_sampled() -> None:
    """P = A P A' + B B', with the lowest pole of the beam within 2e-6 of the circle.

    Velocities are up to 4e5 times as large as displacements, so that half of the digits of these are lost; 3e-8 were seen.
    """
    beam = systems.clamped_beam()
    model = beam.state_space(dt=1 / (2.56 * beam.modes().frequencies.max()))
    root = _stationary_root(model, np.ones(model.B.shape[1]))
    C, A, B = model.C, model.A, model.B
    now = C @ root
    later = np.concatenate([C @ A @ root, C @ B], axis=1)
    np.testing.assert_allclose(np.sum(later**2, axis=1), np.sum(now**2, axis=1), rtol=1e-6)


def test_noise_has_the_size_that_was_asked_on_every_channel() -> None:
    chain = systems.chain5()
    clean, noisy = (chain.simulate(samples=4000, noise=noise, input_noise=noise, seed=0) for noise in (0, 0.1))
    assert clean.inputs is not None
    assert noisy.inputs is not None
    for a, b in ((clean.outputs, noisy.outputs), (clean.inputs, noisy.inputs)):
        ratio = (b - a).std(axis=0) / np.sqrt((a**2).mean(axis=0))
        np.testing.assert_allclose(ratio, 0.1, rtol=0.05)  # scatter of a deviation over 4000 samples: 1.1 %


def test_process_noise_moves_the_structure_but_not_the_recorded_forces() -> None:
    chain = systems.chain5()
    quiet, shaken = (chain.simulate(samples=100, process_noise=level, seed=0) for level in (0, 0.1))
    np.testing.assert_array_equal(quiet.inputs, shaken.inputs)
    assert relative(shaken.outputs, quiet.outputs) > 0.01


def test_frequency_response_noise_is_circular_and_40_db_below() -> None:
    chain, f = systems.spring_chain(), np.linspace(0.1, 10, 2000)
    clean, noisy = chain.frequency_response(f), add_noise(chain.frequency_response(f), 40.0)
    noise = noisy.values - clean.values
    level = np.sqrt((np.abs(noise) ** 2).mean(axis=0) / (np.abs(clean.values) ** 2).mean(axis=0))
    np.testing.assert_allclose(level, 0.01, rtol=0.1)  # 2000 lines: 1.6 %
    np.testing.assert_allclose(noise.real.std() / noise.imag.std(), 1, rtol=0.05)


def test_runs_and_durations_shape_the_record() -> None:
    record = systems.chain5().simulate(duration=5, sampling_rate=40, runs=3)
    assert (record.runs, record.samples, record.sampling_rate, record.duration) == (3, 200, 40, 5)
    assert record.quantity == "acceleration"
    assert record.processing[0] == "simulated: chain5"
