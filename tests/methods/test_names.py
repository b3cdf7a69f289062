"""Names of the literature that are cells of the table: each against its own textbook formula, with noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

import modalscope as ms
from modalscope.data import ImpulseResponse
from modalscope.identification.identify import identify
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.projections import projection
from modalscope.identification.realizations.shift import shift
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


@pytest.mark.parametrize(
    ("name", "row"),
    [
        ("dmd", "least_squares"),
        ("exact-dmd", "least_squares"),
        ("Hankel DMD", "least_squares"),
        ("projected-dmd", "era"),
        ("tls-dmd", "alternate"),
        ("subspace-dmd", "ssi-data"),
        ("quadbt", "loewner"),
        ("NExT-LF", "loewner"),
        ("set-valued aaa", "aaa"),
        ("frvf", "vector-fitting"),
    ],
)
def test_names_of_the_literature_are_rows(name: str, row: str) -> None:
    assert {m.name for m in ms.methods(name)} == {row}


def snapshots(response: ImpulseResponse) -> tuple[np.ndarray, np.ndarray]:
    """Return X and Y, each snapshot in Y one sample after its own in X: all that a dynamic mode decomposition is given."""
    values = np.concatenate(list(response.values), axis=1)
    return values[:, :-2], values[:, 2:]


def test_exact_dynamic_mode_decomposition_is_least_squares_of_one_block_row(noisy) -> None:
    """Tu et al. (2014): eigenvalues of Y X#, with truncation of X to rank r those of Y X_r#; projected: U_r' Y V_r S_r^-1."""
    X, Y = snapshots(noisy)
    for r in (2, 4):
        U, s, Vt = np.linalg.svd(X, full_matrices=False)
        exact = np.linalg.eigvals(Y @ Vt[:r].T / s[:r] @ U[:, :r].T)
        exact = exact[np.argsort(-abs(exact))][:r]
        projected = U[:, :r].T @ Y @ Vt[:r].T / s[:r]
        for method in ("exact-dmd", "projected-dmd"):
            A = built(noisy, method=method, order=r, block_rows=1, block_columns=79).triple(r).A
            assert same(A, projected)
            assert same(A, np.diag(exact))


def test_total_least_squares_dynamic_mode_decomposition_is_the_alternate_row(noisy) -> None:
    """Hemati et al. (2017): X and Y projected on the leading right singular vectors of both stacked, then Y X#."""
    X, Y = snapshots(noisy)
    for r in (2, 4):
        V = np.linalg.svd(np.vstack([X, Y]), full_matrices=False)[2][:r].T
        Xp, Yp = X @ V, Y @ V
        textbook = np.linalg.eigvals(Yp @ np.linalg.pinv(Xp))
        textbook = textbook[np.argsort(-abs(textbook))][:r]
        A = built(noisy, method="tls-dmd", order=r, block_rows=1, block_columns=79).triple(r).A
        assert same(A, np.diag(textbook))


def test_subspace_dynamic_mode_decomposition_is_the_projection_of_ssi_data() -> None:
    """Takeishi et al. (2017): O = Y_f P(Y_p), U_q its leading left vectors in halves U1 and U2, A = U1# U2, as in the paper."""
    y = np.random.default_rng(0).standard_normal((500, 3)).cumsum(axis=0) * 0.1
    record = ms.Signals(outputs=y + np.random.default_rng(1).standard_normal((500, 3)), sampling_rate=10.0)
    z = record.outputs - record.outputs.mean(axis=0)
    past = np.vstack([z[1:-2].T, z[:-3].T])
    future = np.vstack([z[2:-1].T, z[3:].T])
    O = future @ np.linalg.pinv(past) @ past
    U = np.linalg.svd(O, full_matrices=False)[0][:, :3]
    textbook = np.linalg.pinv(U[:3]) @ U[3:]
    matrix = projection(record, [0, 1, 2], 1, 2)
    assert same(shift(matrix, factorize(matrix.tall(), 3)).triple(3).A, textbook)


def test_optimized_dynamic_mode_decomposition_is_refinement(noisy) -> None:
    """Askham and Kutz (2018): least squares of sum_j b_j exp(s_j t), amplitudes by linear least squares, are `refine`."""
    decay = FIVE["chain5"]().impulse_response(300, quantity="acceleration", input="dirac", noise=0.01, seed=1)
    decay = decay.select(inputs=decay.input_dofs[:1])
    modes = ms.refine(decay, ms.identify(decay, order=N, method="optimized-dmd").modes)
    assert len(modes) == 5
    assert np.allclose(ms.analyze(decay, method="optimized-dmd").modes.frequencies, modes.frequencies, rtol=1e-6)
    t = np.arange(300) / decay.sampling_rate
    rebuilt = modes.impulse_response(300, decay.sampling_rate).values
    level = (decay.values / np.sqrt(np.mean((decay.values - rebuilt) ** 2, axis=0))).reshape(300, -1)

    def left(x: np.ndarray) -> np.ndarray:
        s = x[:5] + 1j * x[5:]
        g = np.exp(np.outer(t, s))
        basis = np.linalg.qr(np.hstack([g.real, g.imag]))[0]
        return (level - basis @ (basis.T @ level)).ravel()

    found = least_squares(
        left, np.concatenate([modes.poles.real, modes.poles.imag]), x_scale=np.tile(-modes.poles.real, 2), xtol=1e-12
    )
    s = found.x[:5] + 1j * found.x[5:]
    # one decay: residues of rank one are free ones; both stop at the minimum to a hundredth of a standard deviation
    assert np.all(abs(s - modes.poles) < 0.01 * 2 * np.pi * modes.frequencies_std)


@pytest.mark.parametrize(("name", "instead"), [("opt-dmd", r"modalscope\.refine"), ("armax", "use n4sid")])
def test_names_that_are_no_row_say_what_to_use(name: str, instead: str) -> None:
    with pytest.raises(ms.DataError, match=instead):
        ms.methods(name)
