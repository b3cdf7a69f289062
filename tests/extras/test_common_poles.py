"""AAA and vector fitting against the formulas of their papers, by NumPy alone, and their place beside LSCF and Loewner matrices."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla

import modalscope as ms
from modalscope.data import FrequencyResponse, StateSpace
from modalscope.extras.common_poles import Interpolant, VectorFitting, aaa, partial_fractions, vector_fitting, zeros
from modalscope.identification.matrices.fraction import fraction
from modalscope.identification.matrices.loewner import CauchyProducts, Points
from tests.support import FIVE, add_noise, match_poles, random_system, refused, relative

LINES = np.linspace(0.2, 8, 101)


def noisy(decibel: float = 40.0, lines: np.ndarray = LINES) -> FrequencyResponse:
    return add_noise(FIVE["chain5"]().frequency_response(lines, quantity="acceleration"), decibel)


def poles(matrix: Interpolant | VectorFitting, order: int) -> np.ndarray:
    return np.linalg.eigvals(zeros(matrix, matrix.factors).triple(order).A)


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Return the largest distance from a pole to the nearest of the others, relative to poles beyond 1."""
    distance = abs(np.subtract.outer(a, b)) / np.maximum(abs(a), 1)[:, None]
    return float(max(distance.min(axis=1).max(), distance.min(axis=0).max()))


# -------------------------------------------------------------------------------------------------------------------- AAA
def plain_aaa(at: np.ndarray, values: np.ndarray, count: int) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Return lines, weights and poles of an interpolant through `count` lines and their conjugates; at (F,), values (F, c)."""
    x, H, F = np.concatenate([at, at.conj()]), np.concatenate([values, values.conj()]), at.size
    rebuilt, chosen = np.broadcast_to(values.mean(axis=0), values.shape), []
    for _ in range(count):
        worst = abs(values - rebuilt).max(axis=1)
        worst[chosen] = -1
        chosen.append(int(np.argmax(worst)))
        support = np.array([*chosen, *(F + k for k in chosen)])
        rest = np.setdiff1d(np.arange(2 * F), support)
        L = np.array([(H[k] - H[support]).T / (x[k] - x[support]) for k in rest]).reshape(-1, support.size)
        w = np.linalg.svd(L)[2][-1].conj()
        cauchy = w / (x[rest, None] - x[support])
        full = np.array(H)
        full[rest] = cauchy @ H[support] / cauchy.sum(axis=1)[:, None]
        rebuilt = full[:F]
    arrow = np.block([[np.zeros((1, 1)), w[None]], [np.ones((w.size, 1)), np.diag(x[support])]])
    found = sla.eigvals(arrow, np.diag([0.0, *np.ones(w.size)]))
    return chosen, w, found[np.isfinite(found) & (abs(found) < 1e6)]


@pytest.mark.parametrize("count", [1, 4, pytest.param(8, marks=pytest.mark.slow)])
def test_aaa_is_the_null_vector_and_the_arrow_pencil_of_its_paper(count: int) -> None:
    matrix = aaa(noisy(), domain="s", order=count)
    chosen, _, plain = plain_aaa(matrix.at, matrix.channels, count)
    assert list(matrix.step(count).lines) == chosen
    assert apart(poles(matrix, count), plain) < 1e-9
    assert plain.size == 2 * count - 1


def test_its_matrix_is_the_loewner_matrix_of_all_channels_as_rows_and_one_input() -> None:
    matrix = aaa(noisy(), domain="s", order=5)
    step = matrix.step(5)
    rest = np.setdiff1d(np.arange(LINES.size), step.lines)
    rows, columns = (
        Points(index, matrix.at[index], np.ones(index.size), matrix.channels[index][:, :, None])
        for index in (rest, step.lines)
    )
    plain = CauchyProducts(rows, columns, np.zeros((2 * step.lines.size, 0))).dense()
    assert (
        relative(np.linalg.svd(plain, compute_uv=False) / 2, step.singular_values) < 1e-12
    )  # its columns and rows are longer by sqrt 2


def test_a_line_at_0_hz_is_one_point_and_the_model_goes_through_its_lines() -> None:
    response = random_system(np.random.default_rng(3), outputs=2, inputs=1, modes=3, direct=True).frequency_response(
        np.linspace(0, 0.5, 60)
    )
    matrix = aaa(response, domain="z", order=7)
    step = matrix._steps[-1] if matrix.step(7).error < 1e-12 else matrix.step(7)
    assert step.error < 1e-12
    values = matrix._evaluated(step.lines, step.sigma)
    assert relative(values, matrix.channels) < 1e-12
    at_zero = partial_fractions(matrix.at[:1], np.array([2.0 + 0j]))
    assert at_zero.shape == (1, 1)
    assert at_zero[0, 0] == 1.0


def test_without_noise_aaa_stops_at_the_order_of_the_system_like_baryrat() -> None:
    baryrat = pytest.importorskip("baryrat")
    response = FIVE["chain5"]().frequency_response(LINES, quantity="displacement").select(outputs=[0], inputs=[0])
    one = FrequencyResponse(values=response.values[:, :1, :1], frequencies=LINES, quantity="displacement")
    found = ms.identify(one, method="aaa", domain="s", order=20)
    s = 2j * np.pi * np.concatenate([LINES, -LINES])
    theirs = baryrat.aaa(s, np.concatenate([one.values[:, 0, 0], one.values[:, 0, 0].conj()])).poles()
    ours = FIVE["chain5"]().modes().poles
    near = [found.poles[np.argmin(abs(found.poles - p))] for p in ours]
    assert max(min(abs(theirs - p)) / abs(p) for p in near) < 1e-10
    assert max(abs(np.array(near) - ours) / abs(ours)) < 1e-10


def test_half_of_the_lines_can_be_interpolated() -> None:
    few = noisy(lines=LINES[:20])
    aaa(few, domain="s", order=10)
    refused("Lower the order to at most 10", aaa, few, domain="s", order=11)


# --------------------------------------------------------------------------------------------------------- vector fitting
def plain_step(matrix: VectorFitting, points: np.ndarray) -> np.ndarray:
    """Return the zeros of sigma by relaxed vector fitting with all numerators as unknowns, complex functions of pairs as in the papers."""
    at = matrix.at[:, None]
    columns = []
    for p in points:
        g, h = (1 / (at - p)).ravel(), (1 / (at - p.conj())).ravel()
        columns += [g + h, 1j * (g - h)] if p.imag else [g]
    phi = np.column_stack([*columns, np.ones(at.size)])
    n, channels = phi.shape[1], matrix.channels.T
    rows = [np.hstack([np.kron(np.eye(len(channels))[[k]], phi), -h[:, None] * phi]) for k, h in enumerate(channels)]
    A = np.concatenate(rows)
    real = np.concatenate([A.real, A.imag])
    # exact constraint: the mean of Re sigma is 1
    mean = np.concatenate([np.zeros(n * len(channels)), phi.real.mean(axis=0)])
    Z = sla.null_space(mean[None])
    first = mean / (mean @ mean)
    u = first - Z @ np.linalg.lstsq(real @ Z, real @ first, rcond=None)[0]
    c = u[-n:]
    L = sla.block_diag(*([[p.real, p.imag], [-p.imag, p.real]] if p.imag else [[p.real]] for p in points))
    b = np.concatenate([[2.0, 0.0] if p.imag else [1.0] for p in points])
    return np.linalg.eigvals(L - np.outer(b, c[:-1]) / c[-1])


@pytest.mark.parametrize("order", [6, 7])
@pytest.mark.parametrize("domain", ["s", "z"])
def test_a_relocation_is_that_of_relaxed_vector_fitting(domain: str, order: int) -> None:
    matrix = vector_fitting(noisy(20.0), domain=domain, order=order)
    start = matrix.start(order)
    ours = np.linalg.eigvals(matrix.relocated(start).zeros_matrix())
    assert apart(ours, plain_step(matrix, start)) < 1e-9


def test_its_linearized_problem_is_that_of_lscf_in_another_basis() -> None:
    """With poles near 0 in z all weights 1 / |prod (z - p)| are one: sigma = a(z) / prod (z - p), and both forms of a are the same."""
    response = random_system(np.random.default_rng(4), outputs=3, inputs=1, modes=3).frequency_response(
        np.linspace(0, 0.5, 80)
    )
    n, response = 4, add_noise(response, 30.0)
    points = 0.05 * np.exp(2j * np.pi * (np.arange(2) + 0.5) / 4)
    R = vector_fitting(response, domain="z", order=n).linearized(points)
    M = fraction(response, degree=n).gram_matrices[n]
    # c, d -> coefficients of a, lowest first
    whole = np.poly(np.concatenate([points, points.conj()]))[::-1].real
    T = [
        np.append(part(np.polydiv(whole[::-1], [1, -p])[0]), 0)[: n + 1]
        for p in points
        for part in (lambda q: np.pad(q[::-1].real, (0, 0)), lambda q: q[::-1].imag)
    ]
    change = np.column_stack([*T, whole])
    form = change.T @ M @ change
    assert relative(R.T @ R, form) < 1e-4  # |p|^4 = 6e-6


@pytest.mark.parametrize("domain", ["s", "z"])
def test_its_fixed_point_is_stationary_and_one_in_either_plane(domain: str) -> None:
    matrix = vector_fitting(noisy(), domain=domain, order=10)
    found = matrix.sigma(10)
    assert np.max(abs(found.coefficients)) < 1e-6 * np.max(abs(found.points)) * abs(found.direct)
    s = vector_fitting(noisy(), domain="s", order=10)
    assert apart(matrix.to_s(poles(matrix, 10)), s.to_s(poles(s, 10))) < 1e-6


def test_refined_vector_fits_are_refined_modes_of_the_default() -> None:
    data = noisy(lines=np.linspace(0.2, 8, 301))
    ours, theirs = (
        ms.refine(data, ms.identify(data, order=10, **row).modes) for row in ({}, {"method": "vf", "domain": "s"})
    )
    match = match_poles(theirs.poles, ours.poles)
    assert max(match.frequency_error, match.damping_error) < 1e-5


def test_poles_of_an_unstable_response_are_mirrored_before_each_relocation() -> None:
    model = random_system(np.random.default_rng(5), outputs=2, inputs=1, modes=2, sampled=False)
    backwards = StateSpace(A=-model.A, B=model.B, C=model.C).frequency_response(np.linspace(0.01, 0.5, 60))
    matrix = vector_fitting(backwards, domain="s", order=4)
    assert np.all(np.linalg.eigvals(matrix.sigma(4).zeros_matrix()).real > 0)
    assert np.all(matrix.sigma(4).points.real < 0)


def test_too_many_poles_are_refused() -> None:
    few = noisy(lines=LINES[:12])
    matrix = vector_fitting(few, domain="s", order=11)
    refused("Lower the order to at most 11", vector_fitting, few, domain="s", order=12)
    refused("the fraction has orders 1 to 11", zeros(matrix, matrix.factors).triple, 12)
