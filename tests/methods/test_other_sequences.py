"""Free decays and ambient correlations go through the same rows; what their columns mean is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import ImpulseResponse, Signals
from modalscope.identification.identify import identify
from tests.support import FIVE, match_poles, relative

CHAIN = FIVE["chain5"]()
TRUTH = np.linalg.eigvals(CHAIN.state_space().A)
METHODS = ["era", "alternate", "least_squares", "polyreference", "prce"]


@pytest.mark.parametrize("method", METHODS)
def test_a_free_decay_is_a_sequence_with_the_initial_state_for_b(method):
    """x_0 in modal coordinates is the participation: shapes and participation rebuild the decay."""
    rng = np.random.default_rng(0)
    decay = CHAIN.free_decay(200, displacement=rng.standard_normal(5), velocity=rng.standard_normal(5))
    order = 10 if method != "prce" else 24
    found = identify(decay, method=method, order=order, block_rows=24, block_columns=40)
    assert match_poles(found.modes.poles, TRUTH).frequency_error < 1e-9
    assert relative(found.rebuild().values, decay.values) < 1e-7
    assert found.response.kind == "free decay"
    assert any("amplitude of each mode in each initial state" in str(note) for note in found.notes)


def test_a_record_that_starts_late_refers_participation_to_the_impulse():
    """Leaving the first samples out changes neither shapes nor residues, and EMAC stays one."""
    whole = CHAIN.impulse_response(200)
    late = replace(whole, values=whole.values[7:], first_sample=7)
    options = {"method": "era", "order": 10, "block_rows": 12, "block_columns": 40}
    a, b = (identify(x, **options).modes for x in (whole, late))
    residues = [m.shapes.T[:, :, None] * m.participation[:, None, :] for m in (a, b)]
    assert relative(residues[1], residues[0]) < 1e-7
    np.testing.assert_allclose(b.indicators["emac"], 1, atol=1e-6)
    np.testing.assert_allclose(b.indicators["amplitude_coherence"], 1, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_correlations_of_white_noise_response_have_the_poles_of_the_structure(method):
    """R(k) = C A^(k-1) G, k >= 1: exact correlations, made from the stationary covariance, in any row of the table."""
    import scipy.linalg as sla

    model = CHAIN.state_space(quantity="acceleration", dt=CHAIN.dt)
    covariance = sla.solve_discrete_lyapunov(model.A, model.B @ model.B.T)
    G = model.A @ covariance @ model.C.T + model.B @ model.D.T
    values, state = np.empty((150, 4, 4)), G
    for k in range(150):
        values[k] = model.C @ state
        state = model.A @ state
    response = ImpulseResponse(values=values, sampling_rate=1 / CHAIN.dt, kind="correlation")
    order = 10 if method != "prce" else 40
    found = identify(response, method=method, order=order, block_rows=14, block_columns=30)
    assert match_poles(found.modes.poles, TRUTH).frequency_error < 1e-8
    assert relative(found.rebuild().values, found.response.values) < 1e-6


def test_records_without_inputs_become_correlations_and_say_so():
    rng = np.random.default_rng(2)
    model = CHAIN.state_space(quantity="acceleration", dt=CHAIN.dt)
    y, x = np.empty((20_000, 4)), np.zeros(10)
    for k, u in enumerate(rng.standard_normal((20_000, 2))):
        y[k] = model.C @ x + model.D @ u
        x = model.A @ x + model.B @ u
    found = identify(Signals(outputs=y, sampling_rate=1 / CHAIN.dt), method="era", order=14)
    assert found.response.kind == "correlation"
    assert any("correlations" in str(note) for note in found.notes)
    assert any("reference channel" in str(note) for note in found.notes)
    # 20 000 samples are 1000 s; the first mode at 1 Hz or so is then known to within a percent
    assert match_poles(found.modes.poles, TRUTH).frequency_error < 0.02
