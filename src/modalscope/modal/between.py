"""What groups of columns of one response say of its poles by themselves: one step of Gauss and Newton each, and the scatter of these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.modes import ModalModel
from modalscope.model.response import Response

__all__ = ["steps_of_groups", "with_repeatability"]

#: Fewer groups than this say too little of how far they disagree.
_LEAST = 4


def with_repeatability(modes: ModalModel, response: Response) -> ModalModel:
    """Return modes with the deviation of the mean over the groups of the response's inputs, s / sqrt(G); as they are without four groups.

    Parameters
    ----------
    modes : ModalModel
        Identified from all groups together.
    response : FrequencyResponse or ImpulseResponse
        With `groups`: one label an input.
    """
    labels = response.groups
    if labels is None or len(set(labels)) < _LEAST or not len(modes):
        return modes
    steps = steps_of_groups(modes.poles, response)
    moved = modes.poles + steps
    f = np.abs(moved) / (2 * np.pi)
    zeta = -moved.real / np.abs(moved)
    count = np.sqrt(len(steps))
    return replace(
        modes,
        frequencies_repeatability=np.asarray(f.std(axis=0, ddof=1) / count),
        damping_ratios_repeatability=np.asarray(zeta.std(axis=0, ddof=1) / count),
    )


def steps_of_groups(poles: Array, response: Response) -> ComplexArray:
    """Return how far every group of inputs would move the poles, (groups, n), in rad/s.

    Residues R are fitted to the columns of the group with the poles given. Then ds is that of the least
    |(1 - Q Q')(E - sum_r ds_r R_r dg_r/ds)|^2 over its pairs, with E what is left and Q an orthonormal basis of the functions g:
    the residues are free in this step, too.

    Parameters
    ----------
    poles : array of complex, (n,)
    response : FrequencyResponse or ImpulseResponse
    """
    assert response.groups is not None
    basis = response.basis(poles, response.outside_powers)
    columns = np.hstack([basis.terms, basis.functions])
    Q = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny))[0]
    slopes = response.derivatives(poles)
    slopes = slopes - Q @ (Q.T @ slopes)
    steps = []
    for label in dict.fromkeys(response.groups):
        chosen = [k for k, own in enumerate(response.groups) if own == label]
        data = basis.data[:, :, chosen].reshape(len(basis.data), -1)
        own = np.linalg.lstsq(columns, data, rcond=None)[0][basis.terms.shape[1] :].reshape(len(poles), 2, -1)
        steps.append(_step(slopes, data - Q @ (Q.T @ data), own[:, 0] + 1j * own[:, 1]))
    return np.array(steps)


def _step(slopes: RealArray, left: RealArray, residues: ComplexArray) -> ComplexArray:
    """Return ds (n,) of the least squares of `left` (rows, pairs) by residue times slope, real and imaginary part of each.

    With e1 and e2 the slopes of 2 Re and -2 Im, a residue R and a step d give Re(R d) e1 + Im(R d) e2.
    """
    n = len(residues)
    gram = (slopes.T @ slopes).reshape(n, 2, n, 2)
    seen = (slopes.T @ left).reshape(n, 2, -1)
    # what a unit step along the real and the imaginary axis does, as factors of e1 and e2: (n, step, slope, pairs)
    factors = np.array([[residues.real, residues.imag], [-residues.imag, residues.real]]).transpose(2, 0, 1, 3)
    A = np.einsum("asip,aibj,btjp->asbt", factors, gram, factors, optimize=True).reshape(2 * n, 2 * n)
    b = np.einsum("asip,aip->as", factors, seen, optimize=True).ravel()
    x = np.linalg.lstsq(A, b, rcond=None)[0].reshape(n, 2)
    return np.asarray(x[:, 0] + 1j * x[:, 1])
