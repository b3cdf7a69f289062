"""New inputs simulated by models of slow systems with several inputs, beside two algorithms of the textbooks on the same records."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from modalscope.identification.modal.state_space import from_modes
from tests.studies import Study
from tests.support import relative


def slow_system(seed: int) -> ms.StateSpace:
    """Four to eight states between .002 and .04 of the sampling rate, damping of 2 to 30 %, three inputs, two outputs."""
    rng = np.random.default_rng(seed)
    modes = int(rng.integers(2, 5))
    f, zeta = np.sort(rng.uniform(0.002, 0.04, modes)), rng.uniform(0.02, 0.3, modes)
    s = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))
    A = np.zeros((2 * modes, 2 * modes))
    for i, z in enumerate(np.exp(s)):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[z.real, z.imag], [-z.imag, z.real]]
    return ms.StateSpace(A=A, B=rng.standard_normal((2 * modes, 3)), C=rng.standard_normal((2, 2 * modes)), dt=1.0)


def record(model: ms.StateSpace, seed: int, noise: float = 0.1, samples: int = 1000) -> ms.Signals:
    """White inputs; noise of a tenth of every output."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples, 3))
    y = model.simulate(u)
    return ms.Signals(outputs=y + noise * y.std(axis=0) * rng.standard_normal(y.shape), inputs=u, sampling_rate=1.0)


def windows(x: np.ndarray, blocks: int, first: int = 0) -> np.ndarray:
    """Block Hankel matrix of a record, (blocks channels, times)."""
    count = len(x) - 2 * blocks + 1
    return np.concatenate([x[first + k : first + k + count].T for k in range(blocks)])


def n4sid(data: ms.Signals, n: int, i: int) -> ms.StateSpace:
    """Van Overschee and De Moor, "Subspace Identification for Linear Systems", 1996, algorithm 1 of chapter 4: oblique projections."""
    y, u = data.outputs, data.inputs
    l = y.shape[1]

    def oblique(Yf: np.ndarray, Uf: np.ndarray, Wp: np.ndarray) -> np.ndarray:
        stacked = np.vstack([Wp, Uf])
        return (Yf @ np.linalg.pinv(stacked))[:, : len(Wp)] @ Wp

    Up, Uf, Yp, Yf = windows(u, i), windows(u, i, i), windows(y, i), windows(y, i, i)
    O = oblique(Yf, Uf, np.vstack([Up, Yp]))
    later = oblique(Yf[l:], Uf[3:], np.vstack([Up, Uf[:3], Yp, Yf[:l]]))
    P, d, _ = np.linalg.svd(O, full_matrices=False)
    G = P[:, :n] * np.sqrt(d[:n])
    X, Xn = np.linalg.pinv(G) @ O, np.linalg.pinv(G[:-l]) @ later
    solution = np.vstack([Xn, Yf[:l]]) @ np.linalg.pinv(np.vstack([X, Uf[:3]]))
    return ms.StateSpace(A=solution[:n, :n], B=solution[:n, n:], C=solution[n:, :n], D=solution[n:, n:], dt=1.0)


def srim(data: ms.Signals, n: int, p: int) -> ms.StateSpace:
    """Juang, "System realization using information matrix", J. Guidance 20(3), 1997: shift of the factor; B, D and x(0) from the output."""
    y, u = data.outputs, data.inputs
    l, m, N = y.shape[1], u.shape[1], len(y)
    Y, U = windows(y, p), windows(u, p)
    information = Y @ Y.T - Y @ U.T @ np.linalg.solve(U @ U.T, U @ Y.T)
    P = np.linalg.svd(information)[0][:, :n]
    A, C = np.linalg.pinv(P[:-l]) @ P[l:], P[:l]
    columns = np.zeros((N, l, n + n * m + l * m))
    free, forced = np.eye(n), np.zeros((n, n * m))
    for k in range(N):
        columns[k, :, :n], columns[k, :, n : n + n * m] = C @ free, C @ forced
        columns[k, :, n + n * m :] = np.kron(np.eye(l), u[k])
        free, forced = A @ free, A @ forced + np.kron(np.eye(n), u[k])
    theta = np.linalg.lstsq(columns.reshape(N * l, -1), y.ravel(), rcond=None)[0]
    B, D = theta[n : n + n * m].reshape(n, m), theta[n + n * m :].reshape(l, m)
    return ms.StateSpace(A=A, B=B, C=C, D=D, dt=1.0)


def refined(data: ms.Signals, n: int) -> ms.StateSpace:
    """Records on lines at the true order, refined: how many block rows a model was cut from matters no more."""
    modes = ms.refine(data, ms.identify(data, route="records", order=n).modes)
    return from_modes(np.exp(modes.poles), modes.shapes, modes.participation, modes.feedthrough, 1.0)


@pytest.mark.study("inputs")
@pytest.mark.parametrize("seed", range(3))
def test_new_inputs_are_simulated_no_worse_than_by_the_textbooks(seed: int, study: Callable[[str, str], Study]) -> None:
    """Median over twenty records; ten per cent of slack, where both have come down to what noise allows."""
    model = slow_system(seed)
    n, fresh = model.order, np.random.default_rng(99).standard_normal((1000, 3))
    truth = model.simulate(fresh)
    ways = {
        "n4sid": lambda data: ms.realize(data, method="n4sid", order=n),
        "records on lines": lambda data: ms.realize(data, route="records", order=n),
        "textbook N4SID, 10 blocks": lambda data: n4sid(data, n, 10),
        "textbook N4SID, 20 blocks": lambda data: n4sid(data, n, 20),
        "textbook SRIM, 20 blocks": lambda data: srim(data, n, 20),
        "textbook SRIM, 50 blocks": lambda data: srim(data, n, 50),
        "textbook SRIM, 100 blocks": lambda data: srim(data, n, 100),
        "records on lines, refined": lambda data: refined(data, n),
    }
    errors = {
        name: np.median([_error(way, record(model, k), fresh, truth) for k in range(20)]) for name, way in ways.items()
    }
    table = study(
        f"simulation of new inputs, {n} states, system {seed}",
        f"20 records of 1000 samples, seeds 0 to 19; system {seed}",
    )
    most = 1.1 * min(error for name, error in errors.items() if "textbook" in name)
    for name, error in errors.items():
        limit = most if name == "records on lines, refined" else None
        table.row(f"median relative error, {name}", error, most=limit, form=".4f")
    assert not table.missed


def _error(way, data: ms.Signals, fresh: np.ndarray, truth: np.ndarray) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        error = relative(way(data).simulate(fresh), truth)
    return error if np.isfinite(error) else np.inf
