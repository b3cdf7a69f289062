"""The stated scatter: three parts together, and what the noise alone leaves open, against the whole information matrix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from modalscope.comparing.scatter import COVERAGE, EFFICIENCY, noise_floor, stated
from modalscope.model import FrequencyResponse, ImpulseResponse
from modalscope.model.modes import ModalModel
from modalscope.model.poles import poles_from
from tests.comparing.made import group

NONE = np.array([0.0])


def test_the_stated_scatter_is_that_of_methods_orders_and_noise_together() -> None:
    one = group(10, 0.02, frequency_between=0.3, frequency_over_orders=0.4, damping_between=0.02)
    two = group(20, 0.05, damping_over_orders=0.01)
    found = stated((one, two), (np.array([1.2, 0.1]) / EFFICIENCY, np.array([0.0, 0.004])))
    assert np.allclose(found.frequency, [COVERAGE * 1.3, COVERAGE * 0.1])  # 3-4-12-13
    assert np.allclose(found.damping, [COVERAGE * 0.02, COVERAGE * np.hypot(0.01, EFFICIENCY * 0.004)])
    assert np.allclose(found.frequency_noise, np.array([1.2, 0.1]) / EFFICIENCY)
    assert np.allclose(found.damping_noise, [0.0, 0.004])


def test_noise_that_is_not_known_counts_as_none_and_is_said_to_be_unknown() -> None:
    found = stated((group(frequency_between=0.1),), (np.array([np.nan]), np.array([np.nan])))
    assert found.frequency[0] == pytest.approx(COVERAGE * 0.1)
    assert np.isnan(found.frequency_noise[0])


def test_nothing_is_stated_more_exactly_than_rounding_allows() -> None:
    found = stated((group(10, 0.02),), (NONE, NONE))
    assert (found.frequency[0], found.damping[0]) == (pytest.approx(1e-8), pytest.approx(2e-11))


# ------------------------------------------------------------------------------------------- what the noise leaves open

F, ZETA = np.array([3.0, 5.0]), np.array([0.02, 0.05])
RNG = np.random.default_rng(0)
SHAPES = np.array([[1, 2j], [0.5 - 1j, 1]])
PARTS = np.array([[1, 0.5j, 2], [0.3, -1, 0.2 + 1j]])


def model(**more: object) -> ModalModel:
    return ModalModel(poles=poles_from(F, ZETA), shapes=SHAPES, participation=PARTS, **more)  # type: ignore[arg-type]


#: Modal functions over the rows: poles and the residues of one channel (and its direct term) to real rows.
Rows = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


def plain_bound(rows: Rows, direct: bool, poles: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Invert the information of all unknowns together (frequencies, damping, residues of every channel) by differences."""
    n, channels = len(F), [(o, i) for o in range(2) for i in range(3)]
    residues = SHAPES.T[:, :, None] * PARTS[:, None, :]
    added = (model().poles - poles).real
    start = np.concatenate([F, ZETA, *(np.r_[residues[:, o, i].real, residues[:, o, i].imag] for o, i in channels)])
    start = np.r_[start, np.zeros(len(channels) * direct)]

    def everything(x: np.ndarray) -> np.ndarray:
        s = poles_from(x[:n], x[n : 2 * n]) - added
        out = []
        for k, (o, i) in enumerate(channels):
            a = x[2 * n + 2 * n * k : 2 * n + 2 * n * (k + 1)]
            constant = x[len(x) - len(channels) + k] if direct else 0.0
            out.append(rows(s, a[:n] + 1j * a[n:], constant) / np.sqrt(variance[o, i]))
        return np.concatenate(out)

    step = 1e-6
    J = np.stack([(everything(start + e) - everything(start - e)) / (2 * step) for e in step * np.eye(start.size)], 1)
    deviation = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    return deviation[:n], deviation[n : 2 * n]


def left_over(shape: tuple[int, ...], free: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a remainder that differs from channel to channel, and its variance with so many rows beyond those fitted."""
    size = np.array([[1, 2, 3], [4, 5, 6]]) * 0.01
    return size * np.ones(shape), size**2 * shape[0] / free


@pytest.mark.parametrize("added", [0.0, 0.8])
@pytest.mark.parametrize("first", [0, 3])
def test_on_samples_it_is_the_bound_of_the_whole_problem(added: float, first: int) -> None:
    t = (np.arange(80) + first) / 25.0

    def rows(s: np.ndarray, residue: np.ndarray, _: float) -> np.ndarray:
        return np.asarray(2 * (np.exp(np.outer(t, s)) @ residue).real)

    poles = model().poles - added
    clean = np.einsum("kj,oj,ji->koi", np.exp(np.outer(t, poles)), SHAPES, PARTS).real * 2
    left, variance = left_over(clean.shape, 80 - 4)
    response = ImpulseResponse(
        values=clean + left, sampling_rate=25.0, kind="dirac", first_sample=first, added_damping=added
    )
    found = noise_floor(response, model(), clean, None)
    assert np.allclose(found, plain_bound(rows, False, poles, variance), rtol=1e-5)


@pytest.mark.parametrize("added", [0.0, 0.8])
@pytest.mark.parametrize("rate", [None, 25.0])
def test_on_lines_it_is_the_bound_of_the_whole_problem_with_direct_terms(rate: float | None, added: float) -> None:
    f = np.linspace(1, 8, 50)
    x = 2j * np.pi * f if rate is None else np.exp(2j * np.pi * f / rate)

    def rows(s: np.ndarray, residue: np.ndarray, constant: float) -> np.ndarray:
        p = s if rate is None else np.exp(s / rate)
        H = (1 / (x[:, None] - p)) @ residue + (1 / (x[:, None] - p.conj())) @ residue.conj() + constant
        return np.concatenate([H.real, H.imag])

    poles = model().poles - added
    residues = SHAPES.T[:, :, None] * PARTS[:, None, :]
    channels = [[rows(poles, residues[:, o, i], 0.0) for i in range(3)] for o in range(2)]
    both = np.array(channels).transpose(2, 0, 1)
    clean = both[:50] + 1j * both[50:]
    left, variance = left_over(clean.shape, 2 * 50 - 5)
    response = FrequencyResponse(values=clean + left, frequencies=f, sampling_rate=rate, added_damping=added)
    found = noise_floor(response, model(), clean, None)
    assert np.allclose(found, plain_bound(rows, True, poles, variance), rtol=1e-5)


def test_twice_the_noise_leaves_twice_as_much_open() -> None:
    clean = model().impulse_response(80, 25.0)
    left = 0.01 * RNG.standard_normal(clean.values.shape)
    once = noise_floor(replace(clean, values=clean.values + left), model(), clean.values, None)
    twice = noise_floor(replace(clean, values=clean.values + 2 * left), model(), clean.values, None)
    assert np.allclose(twice, 2 * np.array(once), rtol=1e-6)


def test_of_an_ambient_record_it_is_what_au_says_of_its_length() -> None:
    correlation = replace(model().impulse_response(80, 25.0), kind="correlation")
    f, zeta = noise_floor(correlation, model(), correlation.values, 600.0)
    periods = F * 600
    assert np.allclose((f / F) ** 2, ZETA / (2 * np.pi * periods))
    assert np.allclose((zeta / ZETA) ** 2, 1 / (2 * np.pi * ZETA * periods))


def test_of_correlations_without_their_record_it_is_not_known() -> None:
    correlation = replace(model().impulse_response(80, 25.0), kind="correlation")
    assert np.isnan(noise_floor(correlation, model(), correlation.values, None)).all()


def test_no_modes_no_noise() -> None:
    clean = model().impulse_response(80, 25.0)
    assert [part.size for part in noise_floor(clean, model().take([]), clean.values, None)] == [0, 0]
