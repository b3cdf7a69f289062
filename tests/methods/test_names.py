"""Names of the literature that are cells of the table: each against its own textbook formula, with noise."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import ImpulseResponse
from modalscope.identification.identify import identify
from tests.support import FIVE, add_noise, built, relative

#: One formula against another on the same numbers: rounding, times the condition of the data at 20 dB.
EXACT = 1e-9

N, ROWS, COLUMNS = 10, 12, 30


@pytest.fixture
def noisy() -> ImpulseResponse:
    return add_noise(FIVE["chain5"]().impulse_response(80, quantity="acceleration", input="dirac"), 20.0)


def blocks(response: ImpulseResponse, rows: int, columns: int, k: int = 0) -> np.ndarray:
    Y = response.values
    return np.block([[Y[i + j + k] for j in range(columns)] for i in range(rows)])


def same(A: np.ndarray, B: np.ndarray) -> bool:
    a, b = np.linalg.eigvals(A), np.linalg.eigvals(B)
    return bool(abs(a[:, None] - b).min(axis=1).max() < EXACT)


def test_era_dc_is_era_with_the_columns_compressed_by_the_matrix_itself(noisy):
    H0, H1 = (blocks(noisy, ROWS, COLUMNS, k) for k in (0, 1))
    P, d, Qt = np.linalg.svd(H0 @ H0.T)
    textbook = P[:, :N].T @ (H1 @ H0.T) @ Qt[:N].T / np.outer(d[:N] ** 0.5, d[:N] ** 0.5)
    found = identify(noisy, method="era", order=N, block_rows=ROWS, block_columns=COLUMNS, column_compression=H0)
    assert same(found.state_space.A, textbook)


def test_kungs_realization_and_least_squares_esprit_are_the_alternate_row(noisy):
    H = blocks(noisy, ROWS + 1, COLUMNS)
    P = np.linalg.svd(H)[0][:, :N]
    textbook = np.linalg.lstsq(P[:-4], P[4:], rcond=None)[0]
    p = built(noisy, method="alternate", order=N, block_rows=ROWS, block_columns=COLUMNS)
    assert same(p.triple(N).A, textbook)


def test_delay_embedded_dynamic_mode_decomposition_is_truncated_least_squares(noisy):
    X, Xs = (blocks(noisy, ROWS, COLUMNS, k) for k in (0, 1))
    U, s, Vt = np.linalg.svd(X, full_matrices=False)
    textbook = U[:, :N].T @ Xs @ Vt[:N].T / s[:N]
    p = built(noisy, method="least_squares", order=N, block_rows=ROWS, block_columns=COLUMNS)
    assert same(p.triple(N).A, textbook)


def test_prony_is_the_complex_exponential_of_one_channel(noisy):
    """y(k + p) + a_1 y(k + p - 1) + ... + a_p y(k) = 0 in the least-squares sense."""
    y = noisy.values[:, 0, 0]
    p, rows = 12, 60
    known = np.array([y[k : k + p] for k in range(rows)])
    a = np.linalg.lstsq(known, y[p : p + rows], rcond=None)[0]
    roots = np.roots(np.concatenate([[1], -a[::-1]]))
    one = ImpulseResponse(values=noisy.values[:, :1, :1], sampling_rate=noisy.sampling_rate, kind="dirac")
    model = built(one, method="prce", order=p, block_rows=rows, block_columns=p).triple(p)
    found = np.linalg.eigvals(model.A)
    # roots of a polynomial of degree 12 lose a few digits on their own
    assert abs(found[:, None] - roots).min(axis=1).max() < 1e-7


def test_polyreference_complex_exponential_solves_its_own_equations(noisy):
    """[Y(k) ... Y(k + p - 1)] a = -Y(k + p) for all k and outputs: the last block column of the controllable companion is -a."""
    p, rows = 8, 40
    known = blocks(noisy, rows, p)
    target = np.vstack([noisy.values[k + p] for k in range(rows)])
    a = -np.linalg.lstsq(known, target, rcond=None)[0]
    model = built(noisy, method="prce", order=16, block_rows=rows, block_columns=p).triple(16)
    assert relative(-model.A[:, -2:], a) < EXACT
