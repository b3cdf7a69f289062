"""Channels whitened and back: residues, units and dependent channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.bands import in_units
from modalscope.data.whitening import Whitening, levelling, whitening_matrix


def covariance(values: list[float], seed: int = 0) -> np.ndarray:
    """A covariance whose normed form has these eigenvalues, up to a common factor: Hadamard vectors have equal squares."""
    H = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) / 2
    return np.asarray(H @ np.diag(values) @ H.T)


def test_components_weaker_than_a_tenth_are_raised_to_it_and_stronger_ones_stay() -> None:
    W = whitening_matrix(covariance([1.0, 0.11, 0.09, 1e-4]))
    raised = np.linalg.eigvalsh(W @ covariance([1.0, 0.11, 0.09, 1e-4]) @ W.T)
    size = raised[-1]
    assert np.sort(raised / size) == pytest.approx([0.1, 0.1, 0.11, 1.0])


def test_components_below_the_least_are_raised_as_much_as_it() -> None:
    S = covariance([1.0, 0.5, 1e-2, 1e-6])
    raised = np.linalg.eigvalsh(whitening_matrix(S, 1e-2) @ S @ whitening_matrix(S, 1e-2).T)
    assert np.sort(raised / raised[-1]) == pytest.approx([1e-5, 0.1, 0.5, 1.0])


def test_units_of_channels_do_not_matter() -> None:
    S, units = covariance([1.0, 0.3, 0.01, 1e-3]), np.array([1.0, 1e3, 1e-3, 7.0])
    assert whitening_matrix(S * np.outer(units, units)) * units == pytest.approx(whitening_matrix(S), rel=1e-6)


def test_dependent_and_dead_channels_give_finite_numbers() -> None:
    y = np.random.default_rng(0).standard_normal((500, 2)) @ np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 1.0, 0.0]])
    W = whitening_matrix(y.T @ y)
    assert np.all(np.isfinite(W))
    assert np.linalg.cond(W) < 1e6


def test_residues_are_the_same_on_the_way_back() -> None:
    rng = np.random.default_rng(1)
    W, V = rng.standard_normal((4, 4)), rng.standard_normal((2, 2))
    whitening = Whitening(W, V)
    shapes, participation = rng.standard_normal((4, 3)), rng.standard_normal((3, 2))
    inside = whitening.of_shapes(shapes) @ whitening.of_participation(participation)
    assert inside == pytest.approx(whitening.of_values(shapes @ participation))
    assert whitening.values_back(inside) == pytest.approx(shapes @ participation)
    assert whitening.outputs_back(whitening.of_shapes(shapes)) == pytest.approx(shapes)
    assert whitening.references_back(whitening.of_participation(participation)) == pytest.approx(participation)


def test_levelled_responses_are_the_same_in_all_units_and_their_diagram_is_back_in_the_units() -> None:
    rng = np.random.default_rng(2)
    response = ms.systems.chain5().impulse_response(200, noise=0.01, seed=0)
    u, v = 10.0 ** rng.uniform(-6, 6, 4), 10.0 ** rng.uniform(-6, 6, 2)
    other = replace(response, values=response.values * u[:, None] * v)
    level, again = levelling(response.values), levelling(other.values)
    even = level.of_response(response)
    assert again.of_response(other).values == pytest.approx(even.values, rel=1e-9)
    power = np.mean(even.values**2, axis=0)
    assert power.mean(axis=0) == pytest.approx(1)
    assert power.mean(axis=1) == pytest.approx(1)
    back = in_units(ms.stabilize(even, orders=[10]), level)
    assert back.response.values == pytest.approx(response.values)
    assert back.whitened().shapes == pytest.approx(ms.stabilize(even, orders=[10]).shapes)
    modes = ms.analyze(response).modes
    there = level.inverse.modes_back(modes)
    assert level.modes_back(there).residues == pytest.approx(modes.residues)
    assert there.unrefined.shapes == pytest.approx(modes.unrefined.shapes / np.sqrt(1 / level.outputs**2)[:, None])
    huge = levelling(1e200 * response.values)
    assert huge.outputs[:, None] * huge.references == pytest.approx(1e-200 * level.outputs[:, None] * level.references)
    dead = levelling(np.concatenate([response.values, 0 * response.values[:, :1]], axis=1))
    assert np.all(np.isfinite(dead.outputs))


def test_a_variance_is_levelled_as_the_squares_are() -> None:
    f = np.linspace(0.5, 7, 50)
    values = np.exp(1j * f)[:, None, None] * np.array([[3.0], [1e-3]])
    response = ms.FrequencyResponse(values=values, frequencies=f, variance=0.01 * np.abs(values) ** 2)
    even = levelling(response.values).of_response(response)
    assert even.variance == pytest.approx(0.01 * np.abs(even.values) ** 2)


@pytest.fixture(scope="module")
def record() -> ms.Signals:
    made = ms.systems.chain5().simulate(inputs="ambient", duration=300.0, sampling_rate=20.0, noise=0.05, seed=1)
    # a sixth channel depends on two others exactly
    y = np.column_stack([made.outputs, made.outputs[:, 0] - made.outputs[:, 1]])
    return ms.Signals(outputs=y, sampling_rate=20.0)


def test_shapes_responses_and_models_are_in_the_units_of_the_channels(record: ms.Signals) -> None:
    units = 10.0 ** np.arange(-2, record.outputs.shape[1] - 2)
    other = ms.Signals(outputs=record.outputs * units, sampling_rate=20.0)
    one, two = (ms.identify(each, order=10) for each in (record, other))
    assert two.modes.frequencies == pytest.approx(one.modes.frequencies, rel=1e-7)
    assert np.diag(ms.indicators.mac(two.modes.shapes / units[:, None], one.modes.shapes)) == pytest.approx(1, abs=1e-6)
    scale = np.outer(units, units)
    assert two.response.values / scale == pytest.approx(
        one.response.values, abs=1e-9 * np.abs(one.response.values).max()
    )
    rebuilt = one.rebuild().values
    assert two.rebuild().values / scale == pytest.approx(rebuilt, abs=1e-5 * np.abs(rebuilt).max())
    assert one.fit_error < 0.5


def test_a_diagram_from_a_file_selects_the_same_modes(record: ms.Signals, tmp_path) -> None:
    diagram = ms.stabilize(record)
    assert diagram.whitening is not None
    ms.write(tmp_path / "diagram.npz", diagram)
    again = ms.read(tmp_path / "diagram.npz")
    one, two = ms.select(diagram), ms.select(again)
    assert np.array_equal(one.poles, two.poles)
    assert np.array_equal(one.shapes, two.shapes)


def test_settings_repeat_the_numbers_to_the_last_bit(record: ms.Signals) -> None:
    one = ms.identify(record, order=10)
    two = ms.identify(record, order=10, method=one.method, domain=one.domain, **one.settings)
    assert np.array_equal(one.modes.poles, two.modes.poles)
    assert np.array_equal(one.modes.shapes, two.modes.shapes)
