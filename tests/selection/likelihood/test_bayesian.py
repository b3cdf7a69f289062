"""Three close modes of an ambient record by two routes: ours, and the posterior distribution after Au, by equations of its own.

S.-K. Au, Operational Modal Analysis: Modeling, Bayesian Inference, Uncertainty Laws, Springer 2017, chapters 12 and 13 (several modes).
The lines y_k of a band have, given all parameters, complex normal densities of covariance

    E_k = Phi H_k Phi' + S_e I,   H_k(i, j) = S_ij h_ik conj(h_jk),   h_ik = 1 / (b^2 - 1 + 2 i zeta b),   b = f_i / f_k

With a flat prior the posterior's mean is where -log p = sum log det E_k + y_k* E_k^-1 y_k is least, and its covariance the inverse of the
Hessian there, as far as the posterior is normal.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import chi2

import modalscope as ms
from modalscope.numerics.functions.poles import poles_from
from tests.selection.judging.any_ambient import Truth, made

Array = NDArray[np.float64]

F, ZETA = np.array([0.98, 1.0, 1.02]), np.array([0.008, 0.010, 0.012])
SHAPES = np.array([[1.0, 0.9, 0.5], [0.8, -1.0, 0.6], [0.6, 0.4, -1.0], [0.3, -0.5, 0.9]])
#: Roots of the spectral density of the modal forces: coherences of .29 and .2.
FORCES = np.array([[1.0, 0.0, 0.0], [0.3, 0.95, 0.0], [0.0, 0.2, 0.98]])
BAND = (0.833, 1.173)


class Posterior:
    """-log p of the lines of a record, by [f, zeta, free components of shapes, free root of the spectral density, log S_e]."""

    def __init__(self, record: ms.Signals) -> None:
        y = np.asarray(record.outputs)
        lines = np.fft.rfft(y - y.mean(axis=0), axis=0) / np.sqrt(len(y))
        f = np.fft.rfftfreq(len(y), 1 / record.sampling_rate)
        inside = (f >= BAND[0]) & (f <= BAND[1])
        self.f, self.y = f[inside], lines[inside]
        # columns of Phi and rows of the root share their lengths: the largest component of each shape is held
        self.free = np.arange(len(SHAPES))[:, None] != np.argmax(np.abs(SHAPES), axis=0)
        noise = float(np.log(np.quantile(np.abs(self.y) ** 2, 0.1)))
        forces = [np.full(3, noise / 2 - 3), np.zeros(6)]
        self.start = np.concatenate([F, ZETA, SHAPES[self.free], *forces, [noise]])
        self.scale = np.concatenate(
            [
                1e-3 * F,
                0.1 * ZETA,
                np.full(self.free.sum(), 0.1),
                np.full(3, 0.2),
                np.full(6, np.exp(noise / 2 - 4)),
                [0.1],
            ]
        )

    def spectrum(self, theta: Array) -> NDArray[np.complex128]:
        """Return E of all lines, (k, l, l)."""
        n, count = len(F), int(self.free.sum())
        f, zeta = theta[:n], theta[n : 2 * n]
        phi, rest = SHAPES.copy(), theta[2 * n + count :]
        phi[self.free] = theta[2 * n : 2 * n + count]
        root = np.diag(np.exp(rest[:n])).astype(complex)
        root[np.tril_indices(n, -1)] = rest[3:6] + 1j * rest[6:9]
        b = f / self.f[:, None]
        A = (phi / (b**2 - 1 + 2j * zeta * b)[:, None, :]) @ root
        return np.asarray(A @ A.conj().swapaxes(1, 2) + np.exp(rest[9]) * np.eye(len(phi)))

    def cost(self, x: Array) -> tuple[float, Array]:
        """Return -log p and its gradient, sum tr (E^-1 - E^-1 y y* E^-1) dE, by theta = start + scale x."""
        theta = self.start + self.scale * x
        E = self.spectrum(theta)
        inverse = np.linalg.inv(E)
        q = (inverse @ self.y[:, :, None])[:, :, 0]
        left = inverse - q[:, :, None] * q[:, None, :].conj()
        steps = 1e-5 * np.diag(self.scale)
        slopes = [self.spectrum(theta + step) - self.spectrum(theta - step) for step in steps]
        gradient = np.array([np.einsum("kab,kba->", left, slope).real / 2e-5 for slope in slopes])
        logs = np.linalg.slogdet(E)[1].sum()
        return float(logs + np.einsum("ka,ka->", self.y.conj(), q).real), gradient

    def mean_and_deviations(self) -> tuple[Array, Array]:
        """Return the mean of frequencies and damping ratios, and their standard deviations, (6,) each."""
        found = minimize(self.cost, np.zeros(len(self.start)), jac=True, method="BFGS", options={"gtol": 1e-3})
        steps = 1e-3 * np.eye(len(found.x))
        H = np.array([(self.cost(found.x + s)[1] - self.cost(found.x - s)[1]) / 2e-3 for s in steps])
        covariance = np.linalg.inv((H + H.T) / 2)
        return (self.start + self.scale * found.x)[:6], (self.scale * np.sqrt(np.diag(covariance)))[:6]


@pytest.mark.slow
def test_refined_modes_have_the_mean_and_the_covariance_of_the_posterior() -> None:
    """Ours has complex shapes and a background that bends, too: more unknowns, so that it is less sure, and sees less of what is assumed.

    An estimate with more unknowns differs from the efficient one by an error of variance v_ours - v_efficient (J. A. Hausman, Econometrica
    46, 1978). Held forces bend the spectrum towards half the sampling rate, which the constant S_e of the posterior does not: 20 Hz.
    """
    squares, ratios = [], []
    for seed in (98,):
        truth = Truth(F, ZETA, SHAPES, FORCES, np.zeros(4), 20.0, 72_000)
        y, _ = made(np.random.default_rng(seed), truth, 0.05)
        record = ms.Signals(outputs=y, sampling_rate=20.0)
        mean, std = Posterior(record).mean_and_deviations()
        ours = ms.refine(record, ms.ModalModel(poles=poles_from(F, ZETA), shapes=SHAPES.astype(complex)))
        values = np.concatenate([ours.frequencies, ours.damping_ratios])
        deviations = np.concatenate([ours.frequencies_std, ours.damping_ratios_std])
        squares.append((values - mean) ** 2 / (deviations**2 - std**2))
        ratios.append(deviations / std)
    assert np.all(np.array(ratios) > 1)
    assert np.mean(ratios) < 1.4
    low, high = chi2.ppf([0.001, 0.999], 6)
    assert low < np.sum(squares) < high
