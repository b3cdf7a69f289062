"""The Loewner column: its products against the definition, and realizations of the table that it serves."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla

from modalscope.data import FrequencyResponse, StateSpace
from modalscope.identification.identify import identify
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.loewner import Loewner, loewner
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.regression import regression
from modalscope.identification.realizations.shift import shift
from modalscope.signals.preprocess import estimate_correlation
from tests.support import FIVE, add_noise, random_system, refused, relative

LINES = np.linspace(0.2, 8, 61)


def of_structure(quantity: str = "acceleration", lines: np.ndarray = LINES, name: str = "chain5") -> FrequencyResponse:
    return FIVE[name]().frequency_response(lines, quantity=quantity)


def definition(matrix: Loewner) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return weighted complex L and L_s over the points and their conjugates, the values W, and the unitary way to real columns."""
    rows, columns = matrix.rows, matrix.columns
    mu, lam = (np.concatenate([side.at, side.at.conj()]) for side in (rows, columns))
    V, W = (np.concatenate([side.values, side.values.conj()]) for side in (rows, columns))
    root = np.outer(np.tile(rows.root, 2), np.tile(columns.root, 2))[:, None, :, None]
    apart = (mu[:, None] - lam)[:, None, :, None]
    L = root * (V[:, :, None, :] - W.transpose(1, 0, 2)[None]) / apart
    Ls = root * ((mu[:, None, None] * V)[:, :, None] - (lam[:, None, None] * W).transpose(1, 0, 2)[None]) / apart
    size = V.shape[0] * V.shape[1], W.shape[0] * W.shape[2]
    return L.reshape(size), Ls.reshape(size), W, lam


def to_real(points: int, channels: int) -> np.ndarray:
    """Return T with T y real for y at points and their conjugates: (y + y*) / sqrt 2 and (y - y*) / (sqrt 2 j)."""
    one, j = np.eye(points), -1j * np.eye(points)
    return np.kron(np.block([[one, one], [j, -j]]) / np.sqrt(2), np.eye(channels))


@pytest.mark.parametrize("domain", ["s", "z"])
@pytest.mark.parametrize("start", [0, 3], ids=["from 0 Hz", "a band"])
def test_products_are_those_of_the_real_loewner_matrices(domain: str, start: int) -> None:
    response = random_system(np.random.default_rng(1), outputs=3, inputs=2, modes=4, direct=True).frequency_response(
        np.linspace(0, 0.5, 24)[start:]
    )
    if domain == "s":
        response = of_structure(lines=np.linspace(0, 8, 24)[start:])
    matrix = loewner(response, domain=domain)
    L, Ls, _, _ = definition(matrix)
    T = to_real(len(matrix.rows.at), matrix.outputs)
    S = to_real(len(matrix.columns.at), response.values.shape[2])
    inputs = response.values.shape[2]
    off = np.kron(matrix.eliminated, np.eye(inputs))
    rng = np.random.default_rng(0)
    for k, plain in enumerate((L, Ls)):
        real = -T @ plain @ S.T  # columns: (c + c*) / sqrt 2 and (c - c*) / (sqrt 2 j)
        assert abs(real.imag).max() < 1e-12 * abs(real).max()
        expected = real.real @ (np.eye(len(off)) - off @ off.T)
        H = matrix.shifted(k)
        X, Z = rng.standard_normal((H.shape[1], 3)), rng.standard_normal((H.shape[0], 3))
        assert relative(H.dense(), expected) < 1e-12
        assert relative(H.times(X), expected @ X) < 1e-12
        assert relative(H.transposed_times(Z), expected.T @ Z) < 1e-12
        assert relative(H.energy, np.sum(expected**2)) < 1e-9
        assert relative(np.vstack(list(H.row_chunks(5))), expected) < 1e-12
        assert relative(np.vstack(list(H.transposed().row_chunks(5))), expected.T) < 1e-12


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("name", ["chain5", "ring5", "close4", "heavy4", "over4"])
def test_without_noise_the_poles_are_those_of_era_and_of_the_structure(name: str, quantity: str) -> None:
    response = of_structure(quantity, np.linspace(0.05, 8, 81), name)
    order = FIVE[name]().state_space().order
    ours, era = (identify(response, method=m, domain="s", order=order) for m in ("loewner", "era"))
    size = np.abs(era.poles)
    assert np.max(np.abs(np.sort_complex(ours.poles) - np.sort_complex(era.poles)) / np.sort(size)) < 1e-9
    assert ours.fit_error < 1e-9
    assert relative(ours.rebuild().values, response.values) < 1e-9  # B and D


def test_half_spectra_of_an_ambient_record_give_its_modes() -> None:
    """NExT-LF: lines of the positive lags alone, C (z I - A)^-1 G, where the correlation has decayed."""
    record = FIVE["chain5"]().simulate(inputs="ambient", duration=4000.0, sampling_rate=20.0, seed=1)
    correlation = estimate_correlation(record, lags=400)
    half = correlation.as_lines().response
    found, truth = identify(half, method="next-lf", domain="z", order=10), FIVE["chain5"]().modes()
    near = [int(np.argmin(abs(found.poles - s))) for s in truth.poles]
    # an hour of ambient data knows f to about sqrt(zeta f / (pi T)) / f: a thousandth
    assert np.all(abs(found.modes.frequencies[near] / truth.frequencies - 1) < 3e-3)


def test_regression_on_it_has_the_poles_of_balanced_projection_with_noise() -> None:
    matrix = loewner(add_noise(of_structure(), 20.0), domain="s", order=10)
    factors = factorize(matrix.shifted(0), 10)
    a, b = balanced(matrix, factors).triple(10), regression(matrix, factors).triple(10)
    assert relative(np.sort_complex(np.linalg.eigvals(a.A)), np.sort_complex(np.linalg.eigvals(b.A))) < 1e-9


@pytest.mark.parametrize("domain", ["s", "z"])
def test_lines_shift_too_without_the_shifted_matrix(domain: str) -> None:
    """mu_i V_i - V_i A = C at every line: the difference from the common term gives A, the alternate method of this column."""
    response = of_structure()
    matrix = loewner(response, domain=domain, order=10)
    factors = factorize(matrix.tall(), 10)
    model = shift(matrix, factors).triple(10)
    assert relative(np.sort_complex(matrix.to_s(np.linalg.eigvals(model.A))), _both_of_pairs()) < 1e-9
    noisy = loewner(add_noise(response, 20.0), domain=domain, order=10)
    P = factorize(noisy.tall(), 10).P
    V = P.reshape(2, -1, noisy.outputs, 10)
    y = V[0] + 1j * V[1]
    # the definition: least squares over all lines with C as a further unknown
    lines, rows = len(noisy.rows.at), 10 + 2 * 0
    root = noisy.rows.root[:, None, None]
    known = np.concatenate([y, root * np.eye(noisy.outputs)[None].repeat(lines, 0)], axis=2).reshape(
        -1, rows + noisy.outputs
    )
    target = (noisy.rows.at[:, None, None] * y).reshape(-1, 10)
    real = [np.concatenate([part.real, part.imag]) for part in (known, target)]
    real[0][lines * noisy.outputs :, 10:] = 0
    plain = np.linalg.lstsq(*real, rcond=None)[0][:10]
    ours = shift(noisy, factorize(noisy.tall(), 10)).triple(10).A
    assert relative(np.sort_complex(np.linalg.eigvals(ours)), np.sort_complex(np.linalg.eigvals(plain))) < 1e-8


def _both_of_pairs() -> np.ndarray:
    s = FIVE["chain5"]().modes().poles
    return np.sort_complex(np.concatenate([s, s.conj()]))


def test_c_of_the_columns_is_that_of_the_structure() -> None:
    """W R# of the projected columns, in the basis of the model: C and C A give the residues of 1 and x."""
    matrix = loewner(of_structure("displacement"), domain="s", order=10)
    factors = factorize(matrix.shifted(0), 10)
    model = balanced(matrix, factors).triple(10)
    CA = matrix.first_rows(factors.Q / np.sqrt(factors.d), 1)
    assert relative(CA, model.C @ model.A) < 1e-8


def test_quadbt_is_its_balanced_projection() -> None:
    """Gosea, Gugercin and Beattie: S^-1/2 Y' M X S^-1/2 of L = U S Y', M the weighted shifted matrix, here without a direct term."""
    matrix = loewner(add_noise(of_structure("displacement"), 40.0), domain="s", equal_outputs=False)
    off = np.kron(matrix.eliminated, np.eye(2))
    L, M, _, _ = definition(matrix)
    T, S = to_real(len(matrix.rows.at), 4), to_real(len(matrix.columns.at), 2)
    L, M = ((-T @ X @ S.T).real @ (np.eye(len(off)) - off @ off.T) for X in (L, M))
    U, s, Yt = np.linalg.svd(L, full_matrices=False)
    plain = U[:, :10].T @ M @ Yt[:10].T / np.sqrt(np.outer(s[:10], s[:10]))
    model = balanced(matrix, factorize(matrix.shifted(0), 10)).triple(10)
    assert relative(np.sort_complex(np.linalg.eigvals(model.A)), np.sort_complex(np.linalg.eigvals(plain))) < 1e-9


def test_singular_values_approach_those_of_hankel_as_lines_double() -> None:
    """L alone, without the eliminated functions: the trapezoid up to eleven times the highest mode; beyond, 1 % of the energy is left."""
    model = random_system(np.random.default_rng(2), outputs=3, inputs=2, modes=3, damping=(0.1, 0.3), sampled=False)
    wanted = np.sort(hankel_singular_values(model))[::-1]
    errors = []
    for count in (50, 100, 200):
        matrix = loewner(model.frequency_response(np.linspace(0, 5, count)), domain="s", equal_outputs=False)
        errors.append(relative(np.linalg.svd(definition(matrix)[0], compute_uv=False)[: wanted.size], wanted))
    assert errors[1] < errors[0] / 2
    assert errors[2] < errors[1] / 2
    assert errors[2] < 0.02


def hankel_singular_values(model: StateSpace) -> np.ndarray:
    P = sla.solve_continuous_lyapunov(model.A, -model.B @ model.B.T)
    Q = sla.solve_continuous_lyapunov(model.A.T, -model.C.T @ model.C)
    return np.sqrt(np.abs(np.linalg.eigvals(P @ Q)))


def test_too_few_lines_are_refused() -> None:
    few = of_structure(lines=np.linspace(1, 8, 4))
    loewner(few, domain="s", order=4)
    refused("4 lines, 4 outputs and 2 inputs allow at most 4 states", loewner, few, domain="s", order=5)
