"""Rows that take records with inputs in time: the projection on past inputs and outputs, as a user meets it."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from tests.support import match_poles, random_system, refused, relative


def record(model, samples=1200, seed=0, noise=0.0, hidden=0):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples, model.B.shape[1]))
    y = model.simulate(u)
    y = y + noise * y.std(axis=0) * rng.standard_normal(y.shape)
    return ms.Signals(outputs=y, inputs=u[:, : u.shape[1] - hidden], sampling_rate=1.0)


MODEL = random_system(np.random.default_rng(5), outputs=3, inputs=2, modes=3, damping=(0.005, 0.03), direct=True)


@pytest.mark.parametrize("name", ["n4sid", "N4SID", "moesp", "PO-MOESP"])
def test_every_name_finds_the_exact_poles(name):
    found = ms.identify(record(MODEL), method=name, order=6)
    assert (found.method, found.domain, found.settings["route"]) == ("n4sid", "time", "subspace")
    assert match_poles(found.poles, np.log(MODEL.poles)).frequency_error < 1e-9
    assert found.fit_error < 1e-8
    assert relative(found.state_space.markov_parameters(50), MODEL.markov_parameters(50)) < 1e-7


def test_the_route_alone_takes_the_row():
    found = ms.identify(record(MODEL), route="subspace", order=6)
    assert found.method == "n4sid"


@pytest.mark.slow
def test_all_orders_come_from_one_factorization_and_the_modes_are_selected():
    diagram = ms.stabilize(record(MODEL, 3000, noise=0.02), method="n4sid")
    modes = ms.select(diagram)
    truth = np.log(MODEL.poles)
    assert len(modes) == 3
    # 2 % of noise on 3000 samples: damping to a few per cent of itself
    assert match_poles(modes.poles, truth).damping_error < 0.05


def test_the_state_space_model_predicts_and_simulates():
    data, fresh = record(MODEL, 2000, 1, noise=0.1), record(MODEL, 1000, 2)
    model = ms.realize(data, method="n4sid", order=6)
    assert relative(model.simulate(fresh.inputs), fresh.outputs) < 0.02
    # white noise on the outputs is new in every sample: its share of a one-step prediction is all there is
    assert np.allclose(np.sqrt(np.diag(model.innovation_covariance)) / data.outputs.std(axis=0), 0.1, rtol=0.1)


def test_responses_and_records_without_inputs_are_refused():
    refused("records with inputs", ms.identify, MODEL.impulse_response(200), method="n4sid", order=6)
    bare = ms.Signals(outputs=record(MODEL).outputs, sampling_rate=1.0)
    refused("inputs", ms.identify, bare, method="n4sid", order=6)
