"""Observers of records that make them fail: redundant channels, narrow inputs, short exact records, responses that grow."""

import numpy as np
import pytest
from scipy import signal

import modalscope as ms
from modalscope.data import Signals, StateSpace
from modalscope.signals.preprocess import estimate_markov, observer_regression
from modalscope.signals.preprocess.observer_regression import regression
from tests.support import match_poles, random_system, refused, relative


def record(model, samples, seed=0, noise=0.0, inputs=None, start=False):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples, model.B.shape[1])) if inputs is None else inputs
    y = model.simulate(u, rng.standard_normal(model.order) if start else None)
    y = y + noise * y.std(axis=0) * rng.standard_normal(y.shape)
    return Signals(outputs=y, inputs=u, sampling_rate=1.0)


def redundant(seed=0, outputs=14, modes=4):
    """Many more outputs than states."""
    rng = np.random.default_rng(seed)
    return random_system(rng, outputs=outputs, inputs=2, modes=modes, damping=(0.002, 0.01), direct=True)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3, 1e-2])
def test_redundant_outputs_give_a_response_that_decays(noise):
    """Fourteen outputs of eight states: from 1e-5 of noise on, plain least squares fits the noise of six outputs, and may grow."""
    model = redundant()
    found = estimate_markov(record(model, 3000, noise=noise), samples=400)
    # 3000 samples average the noise of some tens of directions: an error of a few times the noise
    assert relative(found.values, model.markov_parameters(400)) < max(5 * noise, 1e-9)


@pytest.mark.parametrize("noise", [1e-4, 1e-2])
def test_only_the_directions_that_signal_excites_are_kept(noise):
    model = redundant()
    data = record(model, 4000, noise=noise)
    level = data.outputs / data.outputs.std(axis=0), data.inputs / data.inputs.std(axis=0)
    for p in (2, 5, 10):
        found = regression(level[0][None], level[1][None], p)
        rank, _ = found.cross_validated(found.unknowns(p))
        # the state p samples ago and the inputs since: what there is; the grid of ranks is 10 % coarse, and noise adds a few
        true = model.order + 2 * (p + 1)
        assert 0.7 * true <= rank <= 1.6 * true < found.unknowns(p)


def test_the_error_of_cross_validation_is_that_of_predicting_every_quarter_from_the_others():
    """Plain definition: regressors written out, one least squares a quarter, all directions."""
    rng = np.random.default_rng(1)
    y, u = rng.standard_normal((203, 2)), rng.standard_normal((203, 1))
    p = 3
    X = np.array([np.concatenate([u[k], *(np.r_[u[k - i], y[k - i]] for i in range(1, p + 1))]) for k in range(p, 203)])
    error = np.zeros(2)
    for part in np.array_split(np.arange(len(X)), 4):
        rest = np.setdiff1d(np.arange(len(X)), part)
        theta = np.linalg.lstsq(X[rest], y[p:][rest], rcond=None)[0]
        error += np.sum((y[p:][part] - X[part] @ theta) ** 2, axis=0)
    found = regression(y[None], u[None], p)
    total = found.errors(10, np.array([10]))[0]
    assert total.shape == (2,)
    assert np.allclose(total, error, rtol=1e-10)
    assert np.isclose(found.mean_log_share(total), np.mean(np.log(error / np.sum(y[p:] ** 2, axis=0))))


@pytest.mark.parametrize(("least", "quick"), [(1.01e-5, True), (0.99e-5, False)])
def test_directions_come_from_products_where_these_tell_the_weakest_one(least, quick, monkeypatch):
    """The same predictions as by singular vectors, to what the eigenvalues of the Gram matrix are known to."""
    rng = np.random.default_rng(0)
    U, V = (np.linalg.qr(rng.standard_normal((6, 6)))[0] for _ in range(2))
    square = np.linalg.qr(U * np.geomspace(1, least, 6) @ V)[1]
    R, Y = np.vstack([square, np.zeros((2, 6))]), rng.standard_normal((8, 2))
    exact, Wt = observer_regression._directions(R, Y)
    monkeypatch.setattr(observer_regression, "_directions", lambda R, Y: "by singular vectors")
    found = observer_regression._quick_directions(R, Y)
    assert (found != "by singular vectors") == quick
    if quick:
        for rank in range(1, 7):
            expected = Wt[:rank].T @ exact[:rank]
            assert relative(found[1][:rank].T @ found[0][:rank], expected) < 1e-5


@pytest.mark.parametrize("seed", range(6))
def test_short_exact_records_get_their_order_right(seed):
    """As many samples as identification needs at all, from any state: the response is exact, and the order the least one."""
    rng = np.random.default_rng(seed)
    modes, l = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    model = random_system(rng, outputs=l, inputs=1, modes=modes, direct=True)
    least = -(-2 * modes // l)
    # unknowns 1 + p (1 + l) an output, of rank 2 modes + p + 1, and a quarter more equations
    samples = least + int(1.25 * (2 * modes + least + 1)) + 2
    found = estimate_markov(record(model, samples, seed, start=True), samples=60)
    assert f"an observer of order {least} " in found.processing[-1]
    assert relative(found.values, model.markov_parameters(60)) < 1e-5  # rounding over the spread of the states


def test_an_input_without_power_in_half_of_the_band():
    """The response is known where there was force; what the rest of the band would be is not made up of noise."""
    model = random_system(np.random.default_rng(4), outputs=3, inputs=1, modes=2, damping=(0.01, 0.03))
    low = StateSpace(A=model.A, B=model.B, C=model.C, D=model.D, dt=model.dt)
    force = signal.sosfilt(signal.cheby2(10, 120, 0.6, output="sos"), np.random.default_rng(0).standard_normal(6000))
    found = estimate_markov(record(low, 6000, noise=1e-3, inputs=force[:, None]), samples=2000)
    f = np.linspace(0.01, 0.25, 50)
    assert np.abs(found.values).max() < 3 * np.abs(model.markov_parameters(2000)).max()
    lines = _lines(found, f)
    assert relative(lines, model.frequency_response(f).values) < 0.02


def _lines(response, f):
    z = np.exp(-2j * np.pi * np.outer(f, np.arange(1, response.samples + 1)))
    return response.feedthrough + np.einsum("fk,klm->flm", z, response.values)


def test_units_make_no_difference():
    model = redundant()
    data = record(model, 1500, noise=1e-3)
    scaled = Signals(
        outputs=data.outputs * 10.0 ** np.arange(-7, 7), inputs=data.inputs * [1e-4, 1e5], sampling_rate=1.0
    )
    a, b = (estimate_markov(each, samples=100, observer_order=6) for each in (data, scaled))
    back = b.values / (10.0 ** np.arange(-7, 7))[:, None] * [1e-4, 1e5]
    assert relative(back, a.values) < 1e-8


def test_a_response_that_grows_is_an_error_in_plain_words():
    growing = StateSpace(A=[[1.02]], B=[[1.0]], C=[[1.0]], dt=1.0)
    data = record(growing, 400)
    error = refused("it grows: noise hides the damping", estimate_markov, data)
    assert "NaN" not in str(error)
    refused("with order 3 it grows", estimate_markov, data, observer_order=3, samples=20)


def test_a_free_body_moves_away_and_does_not_grow():
    """A double integrator's response rises with time: no pole is outside the unit circle."""
    free = StateSpace(A=[[1.0, 1.0], [0.0, 1.0]], B=[[0.5], [1.0]], C=[[1.0, 0.0]], dt=1.0)
    found = estimate_markov(record(free, 200), samples=50)
    assert relative(found.values, free.markov_parameters(50)) < 1e-6


@pytest.mark.study("inputs")
def test_thirty_random_records_with_redundant_outputs(study):
    """Poles within five deviations or a per cent, no response that grows, 40 dB, from 6 to 20 outputs of 2 to 6 modes."""
    errors = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        modes = int(rng.integers(2, 7))
        model = random_system(
            rng, outputs=int(rng.integers(6, 21)), inputs=2, modes=modes, damping=(0.003, 0.05), direct=True
        )
        response = estimate_markov(record(model, 4000, seed, noise=0.01))
        found = ms.identify(response, method="era", order=2 * modes)
        errors.append(match_poles(found.poles, np.log(model.poles)))
    f, zeta = (np.array([getattr(e, name) for e in errors]) for name in ("frequency_error", "damping_error"))
    table = study("observer, 6 to 20 outputs of 2 to 6 modes, 40 dB", "30 random systems, seeds 0 to 29")
    for name, values, most in (("f", f, 3e-4), ("zeta", zeta, 0.02)):
        table.row(f"relative error of the worst mode, median, {name}", np.median(values), most=most, form=".1e")
        table.row(f"relative error of the worst mode, largest, {name}", values.max(), form=".1e")
    assert not table.missed
