"""Models of records with inputs: chosen on a part that was held out, stable, in z, and honest about what they explain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.realize import _best, _confidence_set, _folds, _Tried, stabilized
from modalscope.analysis.workflow.simulation import (
    Candidate,
    ModelValidation,
    colour,
    driven_outputs,
    explained,
    free_run,
    validated,
    with_noise,
)
from modalscope.data import StateSpace
from modalscope.data.records import as_records
from modalscope.systems import chain5
from tests.support import measured, random_system, refused, relative


def record(
    samples: int = 1500, noise: float = 0.02, seed: int = 1, inputs: str = "white", **more: object
) -> ms.Signals:
    return chain5().simulate(inputs=inputs, samples=samples, sampling_rate=20.0, noise=noise, seed=seed, **more)


@pytest.mark.slow
def test_the_best_candidate_explains_what_it_was_not_fitted_to_and_has_the_order_of_the_structure() -> None:
    model = ms.realize(record())
    validation = model.validation
    assert model.order == validation.order == 10
    assert validation.free_run.min() > 99.8  # noise of 2 % is .04 % of the variance
    assert validation.one_step.min() > 99.8
    rows = {"n4sid", "records on lines", "OKID and ERA"}
    assert {c.how.partition(",")[0] for c in validation.candidates} == rows
    assert any("prediction errors minimized" in c.how for c in validation.candidates)
    top = max(c.free_run for c in validation.candidates)
    assert np.mean(validation.free_run) > top - 0.5
    fresh = record(800, seed=9)
    assert explained(fresh.outputs, free_run(model, fresh.outputs, fresh.inputs).outputs).min() > 99.8
    assert model.gain is not None
    assert "n4sid" in validation.table()


@pytest.mark.slow
def test_the_held_out_part_is_not_fitted() -> None:
    """Noise put on the last quarter alone leaves the candidates as they are, and their score falls."""
    clean = record()
    loud = np.array(clean.outputs)
    loud[1125:] += clean.outputs.std() * np.random.default_rng(0).standard_normal(loud[1125:].shape)
    louder = replace(clean, outputs=loud)
    a, b = (ms.realize(data, method="n4sid", order=10).validation for data in (clean, louder))
    assert a.free_run.min() > 99.8
    assert np.all(b.free_run < 90)


@pytest.mark.parametrize("dt", [None, 0.1])
def test_growing_poles_are_mirrored_and_the_rest_fitted_again(dt: float | None) -> None:
    model = random_system(np.random.default_rng(7), outputs=3, inputs=2, modes=4, direct=True, sampled=False)
    values, T = np.linalg.eig(model.A)
    values = np.where(np.abs(values.imag) == np.abs(values.imag).max(), -values.real + 1j * values.imag, values)
    grows = StateSpace(A=(T @ np.diag(values) @ np.linalg.inv(T)).real, B=2 * model.B, C=model.C, D=model.D)
    grows = grows if dt is None else grows.to_discrete(dt)
    truth = model if dt is None else model.to_discrete(dt)
    response = truth.frequency_response(np.linspace(0.01, 0.6, 120))
    made, count, notes = stabilized(grows, response)
    assert count == 2
    assert "2 unstable poles were mirrored" in str(notes[0])
    assert relative(np.sort_complex(made.poles), np.sort_complex(truth.poles)) < 1e-8
    assert relative(made.frequency_response(response.frequencies).values, response.values) < 1e-8
    if dt is not None:
        samples, _, _ = stabilized(grows, truth.impulse_response(200))
        assert relative(samples.markov_parameters(50), truth.markov_parameters(50)) < 1e-6
        np.testing.assert_array_equal(samples.D, grows.D)
    same, none, said = stabilized(truth, response)
    assert same is truth
    assert (none, said) == (0, ())


def test_a_model_that_grows_is_kept_where_that_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """A structure that is excited by its own motion: the truth grows, and the stable model says what it leaves."""
    model = chain5().state_space(dt=0.05)
    values, T = np.linalg.eig(model.A)
    values[np.abs(values) == np.abs(values).max()] *= 1.003 / np.abs(values).max()
    unstable = StateSpace(A=(T @ np.diag(values) @ np.linalg.inv(T)).real, B=model.B, C=model.C, D=model.D, dt=0.05)
    u = np.random.default_rng(0).standard_normal((1200, 2))
    data = ms.Signals(outputs=unstable.simulate(u), inputs=u, sampling_rate=20.0)
    kept, mirrored = (ms.realize(data, method="n4sid", order=10, stable=stable) for stable in (False, True))
    assert np.abs(kept.poles).max() > 1
    assert np.abs(mirrored.poles).max() < 1
    assert any("mirrored" in str(note) for note in mirrored.notes)
    assert not any("mirrored" in str(note) for note in kept.notes)


def test_z_is_z_by_frequency_responses_too_and_a_poor_fit_is_said() -> None:
    noisy = record(1500, noise=0.0, inputs="white")
    model = ms.realize(noisy, route="frf", domain="z", method="alternate", order=10)
    assert model.dt == 1 / 20
    assert np.abs(model.poles).max() < 1
    poor = [str(note) for note in model.notes if note.kind == "explains little"]
    assert (np.mean(model.validation.free_run) < 90) == bool(poor)
    assert all("omit route" in text for text in poor)
    assert poor, "a random record of fifteen hundred samples leaks"


@pytest.mark.slow
def test_hits_are_held_out_as_whole_runs_and_a_single_transient_not_at_all() -> None:
    forces = np.zeros((4, 800, 1))
    forces[:, 20] = 1.0
    hits = chain5().simulate(inputs=forces, at=[0], sampling_rate=20.0, noise=0.01, seed=0)
    assert ms.realize(hits, order=10).validation.held_out == "the first and the last 1 of 4 runs"
    one = chain5().simulate(inputs=forces[0], at=[0], sampling_rate=20.0, noise=0.01, seed=0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "modalscope.analysis.workflow.realize.identify", None
        )  # what is fitted to all is not fitted again
        found = ms.realize(one, order=10)
    assert "one transient" in found.validation.held_out


def test_a_part_without_its_share_of_the_forces_is_not_held_out() -> None:
    u = np.random.default_rng(0).standard_normal((400, 1))
    run = ms.Signals(outputs=np.zeros((400, 1)), inputs=u, sampling_rate=1.0)
    folds, words = _folds(as_records(run), 0.25)
    assert words == "the first and the last 25 %"
    assert [fold.tested.samples for fold in folds] == [(100,), (100,)]
    assert [fold.fitted.samples for fold in folds] == [(300,), (300,)]
    u[300:] = 0
    assert _folds(as_records(replace(run, inputs=u)), 0.25)[1] == "the first 25 %"
    u[:] = 0
    u[200] = 1
    assert "one transient" in _folds(as_records(replace(run, inputs=u)), 0.25)[1]
    u[10] = 0.38  # its square is an eighth of all, half of the quarter that was asked
    assert _folds(as_records(replace(run, inputs=u)), 0.25)[1] == "the first 25 %"
    u[10] = 0.37
    assert "one transient" in _folds(as_records(replace(run, inputs=u)), 0.25)[1]


def _tried(order: int, left: np.ndarray, level: np.ndarray, **more: object) -> _Tried:
    return _Tried(Candidate("a", order, 100 * (1 - left.mean())), {}, blocks=left, levels=level, **more)


def _apart(seed: int) -> np.ndarray:
    """Return twenty numbers of mean 0 and deviation 1, of each of two parts."""
    apart = np.random.default_rng(seed).standard_normal((2, 10))
    return ((apart - apart.mean(axis=1, keepdims=True)) / apart.std(axis=1, keepdims=True)).ravel()


def test_among_candidates_that_simulate_as_well_the_likelihood_decides_and_of_what_was_fitted_itself_first() -> None:
    left = 0.3 * np.exp(0.1 * np.random.default_rng(0).standard_normal(20))
    for shift, wanted in ((0.9, 4), (1.1, 8)):
        levels = 2 + 0.05 * (_apart(1) + shift / np.sqrt(20)), np.full(20, 2.0)
        tried = [_tried(n, left, level) for n, level in zip((4, 8), levels, strict=True)]
        assert _best(tried).candidate.order == wanted
    # nothing held out: eight states simulate better, and their likelihood does not pay for them; a row whose poles grew is no choice
    own = [_tried(4, left, np.full(20, 1.0), own=True), _tried(8, left / 2, np.full(20, 1.1), own=True)]
    assert _best(own).candidate.order == 4
    assert _best([one._replace(own=False) for one in own]).candidate.order == 8
    grew = own[0]._replace(candidate=own[0].candidate._replace(mirrored=2))
    assert _best([grew, own[1]]).candidate.order == 8


def test_what_simulates_worse_by_chance_alone_is_taken_where_it_predicts_better() -> None:
    """Two candidates on twenty stretches, normal: the mean logarithm of their ratio exceeds 1.96 deviations in one of twenty.

    Of four hundred draws that limit is known to .1: 1.96 +- the deviation of a quantile, sqrt(.05 .95 / 400) over the density of .117.
    """
    left = 0.1 * np.exp(0.2 * np.random.default_rng(0).standard_normal(20))
    for shift, wanted in ((1.7, 4), (2.3, 8)):
        worse = left * np.exp(0.05 * (_apart(1) + shift / np.sqrt(20)))
        tried = [_tried(4, worse, np.full(20, 1.0)), _tried(8, left, np.full(20, 2.0))]
        assert _best(tried).candidate.order == wanted


def test_the_likelihood_does_not_decide_between_models_of_which_one_fails_in_one_part() -> None:
    """One fold of two leaves half of what is held out: the deviation of both together hides it, that of each part does not."""
    left = 0.02 * np.exp(0.2 * np.random.default_rng(0).standard_normal(20))
    fails = np.where(np.arange(20) < 10, 0.5, left)
    others = [_tried(n, left * np.exp(0.1 * _apart(n)), np.full(20, 2.0)) for n in range(8, 60)]
    for level in (1.0, 3.0):
        assert _best([_tried(4, fails, np.full(20, level)), *others]).candidate.order > 4


def test_equal_candidates_are_all_kept_and_the_lowest_of_them_is_taken() -> None:
    left = 0.1 * np.exp(0.2 * np.random.default_rng(0).standard_normal(20))
    tried = [_tried(n, left * (1 + 1e-12 * n), np.zeros(20)) for n in (8, 4, 6)]
    assert _confidence_set(tried) == tried
    assert _confidence_set(tried[:1]) == tried[:1]
    assert _best(tried).candidate.order == 4
    same = [one._replace(blocks=left) for one in tried]
    assert _confidence_set(same) == same


def test_of_candidates_that_predict_as_well_the_one_of_fewest_states_is_taken_that_simulates_as_well() -> None:
    """Breiman's rule on twenty stretches: two orders that differ by less, and by more, than one standard error of the difference."""
    left, level = 0.1 + 0.02 * np.random.default_rng(0).standard_normal(20), np.zeros(20)
    for shift, wanted in ((0.9, 4), (1.1, 8)):
        worse = left + 0.01 * (_apart(1) + shift / np.sqrt(20))
        tried = [_tried(n, e, level) for n, e in ((4, worse), (8, left))]
        assert _best(tried).candidate.order == wanted


def test_first_states_that_are_fitted_to_what_is_held_out_do_not_speak_for_more_states() -> None:
    """Of noise alone forty states at the first sample take a sixth of 250 samples; what they leave says nothing of others."""
    plain, held, levels = ([], []), ([], []), ([], [])
    for seed in range(10):
        y = np.random.default_rng(seed).standard_normal((250, 1))
        for k, modes in enumerate((1, 20)):
            turn = np.exp(1j * np.pi * (np.arange(modes) + 0.5) / modes)
            A = np.kron(np.diag(turn.real), np.eye(2)) + np.kron(np.diag(turn.imag), [[0, 1], [-1, 0]])
            model = StateSpace(A=A, B=np.zeros((2 * modes, 1)), C=np.tile([[1.0, 0.0]], modes), dt=1.0)
            found = free_run(model, y, np.zeros_like(y))
            plain[k].append(np.mean((y - found.outputs) ** 2))
            held[k].append(np.mean(found.squares(y, np.ones(1))))
            levels[k].append(np.mean(found.likelihood(y)))
            assert held[k][-1] == pytest.approx(plain[k][-1] / (1 - (2 * modes + 1) / 250) ** 2)
    assert np.mean(plain[1]) < 0.9 * np.mean(plain[0])
    assert np.mean(held[1]) > np.mean(held[0])
    assert np.mean(levels[1]) > np.mean(levels[0])
    few = free_run(model, y[:40], np.zeros((40, 1)))
    assert np.isinf(few.squares(y[:40], np.ones(1))).all()


@pytest.mark.slow
def test_a_system_of_two_states_whose_noise_is_a_millionth_has_two() -> None:
    model = ms.realize(ms.read(measured("standins", "two_poles", "two.csv")))
    assert model.order == 2
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(model.A)), [-0.5j, 0.5j], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1e-6, 0.1])
def test_a_structure_in_white_noise_has_its_order_or_fewer_states_that_simulate_as_well(noise: float) -> None:
    """Four structures each: the order is no larger, and what the noise leaves uncertain is a small part of the noise.

    A model of p numbers leaves p / N of the variance of the noise, 1500 samples; at four times of it states are missing.
    """
    for seed in range(4):
        rng = np.random.default_rng(seed)
        modes = int(rng.integers(1, 5))
        truth = random_system(rng, outputs=2, inputs=1, modes=modes, damping=(0.005, 0.05), sampled=False).to_discrete(
            1.0
        )
        u, fresh = rng.standard_normal((2, 1500, 1))
        y, other = truth.simulate(u), truth.simulate(fresh)
        y = y + noise * y.std(axis=0) * rng.standard_normal(y.shape)
        model = ms.realize(ms.Signals(outputs=y, inputs=u, sampling_rate=1.0))
        numbers = truth.order * 3 + 2
        left = np.mean(np.var(other - model.simulate(fresh), axis=0) / np.var(other, axis=0))
        assert model.order <= truth.order
        assert left < 4 * noise**2 * numbers / 1500


def test_short_records_are_fitted_at_lower_orders() -> None:
    candidates = ms.realize(record(160)).validation.candidates
    assert {c.how for c in candidates if not c.failure} >= {"n4sid", "records on lines"}
    assert max(c.order for c in candidates if c.how == "n4sid") < 40


def test_simulation_pole_by_pole_is_simulation_and_the_first_state_is_found() -> None:
    model = random_system(np.random.default_rng(3), outputs=2, inputs=2, modes=3, direct=True)
    u = np.random.default_rng(0).standard_normal((300, 2))
    assert relative(driven_outputs(model, u), model.simulate(u)) < 1e-10
    first = np.random.default_rng(1).standard_normal(6)
    y = model.simulate(u, first) + np.array([3.0, -2.0])
    simulated = free_run(model, y, u)
    assert relative(simulated.outputs, y) < 1e-6
    assert relative(simulated.first, first) < 1e-4
    assert relative(simulated.offset, [3.0, -2.0]) < 1e-4
    defective = StateSpace(A=[[0.5, 1], [0, 0.5]], B=[[0], [1]], C=[[1, 0]], dt=1.0)
    assert relative(driven_outputs(defective, u[:, :1]), defective.simulate(u[:, :1])) < 1e-10


@pytest.mark.slow
def test_one_step_errors_of_the_true_model_are_white_and_less_than_simulation_leaves() -> None:
    data = record(4000, noise=0.02, process_noise=0.5)
    records = as_records(data)
    free, one, colour = validated(with_noise(ms.realize(data, order=10), records), records)
    assert np.all(one > free)
    assert colour < 4


def test_nothing_is_held_out_where_that_is_asked_and_of_responses() -> None:
    assert ms.realize(record(), order=10, holdout=0).validation is None
    model = ms.realize(chain5().impulse_response(200), order=10)
    assert model.validation is None
    assert any(note.kind == "fit error" for note in model.notes)
    refused("from 0 and below 0.9", ms.realize, record(), holdout=0.9)


@pytest.mark.slow
def test_a_model_is_validated_on_another_record() -> None:
    model, fresh = ms.realize(record(), order=10), record(800, seed=5)
    seen = ms.validate(model, fresh)
    assert seen.free_run.min() > 99.8
    assert seen.one_step.min() > 99.8
    assert ms.validate(replace(model, B=0 * model.B, D=0 * model.D), fresh).free_run.max() < 50
    assert np.isnan(ms.validate(replace(model, gain=None, innovation_covariance=None), fresh).one_step).all()
    refused("at 20 Hz", ms.validate, model, replace(fresh, sampling_rate=10.0))
    # either order, by type; a continuous model is sampled at the record's rate
    for seen in (ms.validate(fresh, model), ms.validate(model.to_continuous(), fresh)):
        np.testing.assert_allclose(seen.free_run, ms.validate(model, fresh).free_run, atol=1e-6)


def test_errors_are_called_coloured_beyond_what_a_twentieth_of_white_records_shows() -> None:
    """Correlations of white noise at a lag are normal, of deviation 1 / sqrt(N): of ten lags the largest exceeds 2.81 in 5 of 100."""
    calls = []
    for seed in range(200):
        error = np.random.default_rng(seed).standard_normal((2000, 1))
        whiteness = colour(error)
        calls.append(
            ModelValidation(free_run=np.ones(1), one_step=np.ones(1), whiteness=whiteness, order=1, method="a").white
        )
    assert 0.9 <= np.mean(calls) <= 0.99  # .95 and three deviations of 200
    limit = 2.807 / 2
    for whiteness, white in ((limit - 1e-3, True), (limit + 1e-3, False)):
        one = ModelValidation(free_run=np.ones(1), one_step=np.ones(1), whiteness=whiteness, order=1, method="a")
        assert one.white is white


@pytest.mark.slow
def test_channels_and_delays_are_taken_out_before_the_parts() -> None:
    whole = record(1500)
    late = replace(whole, outputs=whole.outputs[:-12], inputs=whole.inputs[12:])
    names = whole.output_dofs
    kept = [str(name) for name in names if name != names[2]]
    for delays in (None, dict.fromkeys(kept, 12)):
        model = ms.realize(late, order=10, delays=delays, exclude=[names[2]])
        assert model.C.shape[0] == len(kept)
        assert model.validation.free_run.min() > 99
    assert ms.realize(late, order=10, delays={}, exclude=[names[2]]).validation.free_run.min() < 99


@pytest.mark.parametrize(("growth", "bound"), [(1e-5, np.exp(-1 / 200)), (0.02, 0.9803)])
def test_a_mirrored_pole_decays_within_the_length_of_the_data(growth: float, bound: float) -> None:
    """One that hardly grows to exp(-1 / N), one that grows faster to its reciprocal."""
    turn = 0.3
    A = (1 + growth) * np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    grows = StateSpace(A=A, B=[[1.0], [0.0]], C=[[1.0, 0.0]], D=[[0.0]], dt=0.1)
    made, count, _ = stabilized(grows, grows.impulse_response(200))
    assert count == 2
    assert np.abs(made.poles).max() == pytest.approx(bound, abs=1e-4)
