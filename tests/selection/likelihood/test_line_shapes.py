"""Shapes from the lines of a record, their deviations, and those that stay as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import ModalModel, Signals
from modalscope.data.indicators import mac
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.line_shapes import (
    _CORRELATED,
    _inverse_of_others,
    _Lines,
    _Lobe,
    _overlay,
    line_shapes,
)
from tests.selection.judging.any_ambient import Truth, made
from tests.selection.judging.dominated import hidden_modes

F, ZETA = np.array([1.0, 1.5]), np.array([0.01, 0.01])
SHAPES = np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 0.5]])


def pair(ratio: float) -> Signals:
    rng = np.random.default_rng(5)
    # the error of the weak shape along the strong one is sqrt(S_strong / (S_weak n)): a third at 1 : .05 with 42 lines
    return hidden_modes(rng, F, ZETA, SHAPES, np.array([1.0, ratio]), 20.0).record


def started(bad: float) -> ModalModel:
    shapes = SHAPES.astype(complex)
    shapes[:, 1] += bad * shapes[:, 0]
    return ModalModel(poles=poles_from(F, ZETA), shapes=shapes)


def test_a_shape_that_a_stronger_mode_spoilt_is_found_again() -> None:
    modes = started(2.0)
    before = mac(modes.shapes[:, 1:], SHAPES[:, 1:].astype(complex))[0, 0]
    found = line_shapes(pair(0.05), modes).shapes
    assert before < 0.5
    assert mac(found[:, 1:], SHAPES[:, 1:].astype(complex))[0, 0] > 0.85
    assert mac(found[:, :1], SHAPES[:, :1].astype(complex))[0, 0] > 0.999


def test_a_wrong_shape_of_a_mode_that_stands_apart_is_found_again() -> None:
    found = line_shapes(pair(1.0), started(2.0)).shapes
    assert mac(found[:, 1:], SHAPES[:, 1:].astype(complex))[0, 0] > 0.99


@pytest.mark.parametrize(("part", "stays"), [(0.005, True), (0.02, False)])
def test_what_is_complex_stays_where_others_have_less_than_a_hundredth_of_the_power(part: float, stays: bool) -> None:
    """Its power is known by some twenty lines, to a quarter: both sides of the limit are twice as far."""
    r, z = F[1] / F[0], ZETA[0]
    skirt = (2 * z * r**2) ** 2 / ((1 - r**2) ** 2 + (2 * z * r) ** 2)
    # RMS^2 is the power at the peak times its width, f zeta
    ratio = np.sqrt(skirt / part * F[1] / F[0] * np.sum(SHAPES[:, 0] ** 2) / np.sum(SHAPES[:, 1] ** 2))
    modes = started(0.0)
    turned = replace(modes, shapes=modes.shapes + 0.2j * modes.shapes[::-1])
    assert np.any(line_shapes(pair(float(ratio)), turned).shapes[:, 1].imag) == stays


def test_shapes_stay_where_a_strong_mode_is_missing_in_the_list() -> None:
    weak = started(2.0).take(np.array([1]))
    found = line_shapes(pair(0.02), weak)
    assert mac(found.shapes, weak.shapes)[0, 0] == pytest.approx(1, abs=1e-12)
    assert np.linalg.norm(found.deviations) > 0.3 * np.linalg.norm(found.shapes)  # the lines have another one


def test_a_shape_whose_neighbour_is_unknown_is_known_less_well(monkeypatch: pytest.MonkeyPatch) -> None:
    f, sizes = np.array([1.0, 1.006]), np.ones(2)  # a third of their bandwidths apart
    record = hidden_modes(np.random.default_rng(3), f, ZETA, SHAPES, sizes, 20.0).record
    modes = ModalModel(poles=poles_from(f, ZETA), shapes=SHAPES.astype(complex))
    beside, plain = line_shapes(record, modes).deviations, _Lobe.covariance
    monkeypatch.setattr(_Lobe, "covariance", lambda lobe, at, _, slopes: plain(lobe, at, [], slopes[:, :1]))
    alone = line_shapes(record, modes).deviations
    assert np.all(np.linalg.norm(beside, axis=0) > 1.005 * np.linalg.norm(alone, axis=0))


@pytest.mark.slow
def test_deviations_are_the_scatter_of_shapes() -> None:
    """Errors across a shape are sums of two squares: forty records tell their mean to a sixth."""
    errors, stated = [], []
    for seed in range(40):
        record = hidden_modes(np.random.default_rng(seed), F, ZETA, SHAPES, np.array([1.0, 0.3]), 20.0).record
        found = line_shapes(record, started(0.0))
        shapes, true = found.shapes.real, SHAPES / np.linalg.norm(SHAPES, axis=0)
        length = np.linalg.norm(shapes, axis=0)
        across = shapes / length - true * np.einsum("aj,aj->j", shapes / length, true)
        errors.append(np.sum(across**2, axis=0))
        stated.append(np.sum((found.deviations / length) ** 2, axis=0))
    ratio = np.mean(errors, axis=0) / np.mean(stated, axis=0)
    assert np.all(np.abs(ratio - 1) < 0.5)


def test_forces_that_are_correlated_do_not_bias_a_shape() -> None:
    rng = np.random.default_rng(6)
    forces = np.array([[1.0, 0.0], [0.9, np.sqrt(1 - 0.81)]])
    truth = Truth(np.array([1.0, 1.05]), np.array([0.02, 0.02]), SHAPES, forces, np.zeros(3), 10.0, 60_000)
    y, _ = made(rng, truth, 0.01)
    modes = ModalModel(poles=poles_from(truth.frequencies, truth.damping_ratios), shapes=SHAPES.astype(complex))
    found = line_shapes(Signals(outputs=y, sampling_rate=10.0), modes).shapes
    assert np.all(mac(found, SHAPES.astype(complex)).diagonal() > 0.995)


def test_beside_a_mode_without_power_others_have_all_of_it() -> None:
    lines = _Lines(np.zeros((1, 20, 3), complex), np.arange(20.0), np.ones((2, 20), complex), _CORRELATED[0])
    found = _overlay(lines, started(0.0), np.array([[0.0, 1.0]] * 3))
    assert np.all(np.isfinite(found))
    assert found[0] > 1e12
    assert found[1] == 0


def test_units_of_channels_do_not_matter() -> None:
    record, units = pair(0.02), np.array([1.0, 1e3, 1e-3])
    modes = started(2.0)
    scaled = ModalModel(poles=modes.poles, shapes=modes.shapes * units[:, None])
    one = line_shapes(record, modes).shapes
    two = line_shapes(Signals(outputs=record.outputs * units, sampling_rate=20.0), scaled).shapes
    assert mac(two / units[:, None], one).diagonal() == pytest.approx(1, abs=1e-6)


def test_a_machine_beside_a_mode_is_avoided() -> None:
    record, modes = pair(0.05), started(2.0)
    t = np.arange(record.samples) / 20.0
    loud = record.outputs + np.outer(np.sin(2 * np.pi * 1.51 * t), [1.0, 0.0, 0.0])
    found = line_shapes(Signals(outputs=loud, sampling_rate=20.0), modes, [(1.51, 0.004)]).shapes
    assert mac(found[:, 1:], SHAPES[:, 1:].astype(complex))[0, 0] > 0.85


@pytest.mark.parametrize(("outputs", "modes"), [(6, 3), (3, 5)])
def test_information_and_score_of_a_lobe_are_those_of_the_whole_spectral_matrix(outputs: int, modes: int) -> None:
    """With S formed in full: tr S^-1 dS S^-1 dS, and differences of log det S + y* S^-1 y."""
    rng = np.random.default_rng(outputs)

    def drawn(*shape: int) -> ComplexArray:
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    noise, shapes, forces = rng.uniform(0.1, 0.5, outputs), rng.standard_normal((outputs, modes)), np.eye(modes)
    forces[1, 0] = forces[0, 1] = 0.3
    lobe = _Lobe(drawn(2, 30, outputs), drawn(30, modes), noise, 1, [0, 2])

    def whole(step: RealArray) -> tuple[ComplexArray, float]:
        phi, R = lobe.moved(shapes, forces, step)
        A = phi * lobe.h[:, None]
        S = A @ R @ A.conj().swapaxes(1, 2) + np.diag(noise)
        squares = np.einsum("rfa,fab,rfb->", lobe.Y.conj(), np.linalg.inv(S), lobe.Y).real
        return S, 2 * float(np.linalg.slogdet(S)[1].sum()) + float(squares)

    at = lobe.spectral(shapes, forces)
    assert at is not None
    information, score = lobe.equations(at)
    S, cost = whole(np.zeros(outputs + 2))
    assert at.cost + 2 * 30 * np.log(noise).sum() == pytest.approx(cost, rel=1e-12)
    steps = 1e-5 * np.eye(outputs + 2)
    ahead, behind = ([whole(sign * step) for step in steps] for sign in (1, -1))
    slopes = np.array([a[1] - b[1] for a, b in zip(ahead, behind, strict=True)]) / 2e-5
    assert score == pytest.approx(-slopes, rel=1e-6, abs=1e-5)
    each = [np.linalg.solve(S, (a[0] - b[0]) / 2e-5) for a, b in zip(ahead, behind, strict=True)]
    direct = 2 * np.einsum("pfab,qfba->pq", each, each).real
    assert information == pytest.approx(direct, rel=1e-6, abs=1e-6 * np.abs(direct).max())


@pytest.mark.parametrize("outputs", [3, 6])
def test_the_covariance_of_a_shape_is_that_of_the_whole_information_of_its_neighbours_and_their_poles(
    outputs: int,
) -> None:
    """Second route: derivatives of the whole spectral matrix by differences, by both shapes, both poles and both correlations."""
    rng = np.random.default_rng(outputs)
    shapes, noise, forces = rng.standard_normal((outputs, 3)), rng.uniform(0.1, 0.5, outputs), np.eye(3)
    forces[1, [0, 2]] = forces[[0, 2], 1] = 0.3, -0.2
    h, slopes, Y = (rng.standard_normal((2, *size)) for size in ((30, 3), (30, 2, 2), (2, 30, outputs)))
    h, slopes, Y = (one + 1j * two for one, two in (h, slopes, Y))
    lobe = _Lobe(Y, h, noise, 1, [0, 2])
    at = lobe.spectral(shapes, forces)
    assert at is not None

    def S(x: np.ndarray) -> np.ndarray:
        own, by, R = shapes.copy(), h.copy(), forces.copy()
        own[:, 1] += x[:outputs]
        own[:, 0] += x[outputs : 2 * outputs]
        by[:, [1, 0]] *= np.exp(np.einsum("fme,me->fm", slopes, x[2 * outputs : -2].reshape(2, 2)))
        R[1, [0, 2]] = R[[0, 2], 1] = R[1, [0, 2]] + x[-2:]
        A = own * by[:, None]
        return A @ R @ A.conj().swapaxes(1, 2) + np.diag(noise)

    steps = 1e-5 * np.eye(2 * outputs + 6)
    each = [np.linalg.solve(S(np.zeros(len(steps))), (S(step) - S(-step)) / 2e-5) for step in steps]
    direct = np.linalg.pinv(2 * np.einsum("pfab,qfba->pq", each, each).real, hermitian=True)[:outputs, :outputs]
    assert lobe.covariance(at, [0], slopes) == pytest.approx(direct, rel=1e-5, abs=1e-6 * np.abs(direct).max())


def test_the_inverse_of_others_is_that_of_their_spectral_matrix() -> None:
    rng, own = np.random.default_rng(5), np.arange(20)
    noise = rng.uniform(0.1, 0.5, 4)
    for modes in (1, 3, 7):
        shapes, h = rng.standard_normal((4, modes)), rng.standard_normal((modes, 20)) + 0j
        lines = _Lines(np.zeros((1, 20, 4), complex), np.arange(20.0), h, _CORRELATED[0])
        others = shapes[:, 1:]
        S = np.einsum("ak,kf,bk->fab", others, np.abs(h[1:]) ** 2, others) + np.diag(noise)
        assert np.allclose(_inverse_of_others(lines, shapes, 0, own, noise) @ S, np.eye(4), atol=1e-10)


def test_lines_under_tapers_are_correlated_as_the_program_counts_them() -> None:
    """Second route: the inner products of the tapers themselves, shifted by whole lines, at a length of its own."""
    n = 1500
    at = np.pi * np.arange(1, n + 1) / (n + 1)
    w = np.sqrt(2 / (n + 1)) * np.sin(np.arange(1, 3)[:, None] * at)
    each = [np.abs(np.fft.fft(a * b)) ** 2 for a in w for b in w]
    assert np.sum(each, axis=0)[:3] / 2 == pytest.approx(_CORRELATED[2], abs=1e-3)
    assert np.sum(each, axis=0)[3:9].max() / 2 < 2e-3
    hann = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    assert np.abs(np.fft.fft(hann**2 / np.sum(hann**2)))[:3] ** 2 == pytest.approx(_CORRELATED[0], abs=1e-6)


@pytest.mark.parametrize("bad", [0.0, 2.0])
def test_what_is_imaginary_by_chance_is_left_out_and_what_is_not_stays(bad: float) -> None:
    """A shape whose real part is wrong by more (`bad`) is no witness of an imaginary part."""
    record, modes = pair(0.5), started(bad)
    found = line_shapes(record, modes)
    length = np.linalg.norm(modes.shapes, axis=0)
    spread = found.deviations / np.linalg.norm(found.shapes, axis=0) * length
    for size, stays in ((0.5 * spread, False), (0.3 * length, True)):
        given = modes.shapes + 1j * size * np.array([1.0, -1.0, 1.0])[:, None]
        told = line_shapes(record, replace(modes, shapes=given))
        assert bool(np.any(np.abs(told.shapes.imag[:, 1]) > 0)) == (stays and not bad)
