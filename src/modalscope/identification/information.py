"""Gradient and information of the likelihood, whole and by parts of the data, from the complex columns of a point.

The derivative of channel o by the real and the imaginary part of an unknown a is Re(c_oa W_a) and Re(j c_oa W_a), where W_a is its
column without what the modes themselves explain; sums over channels then need nothing but the products W'W, W^H W and c'c, c^H c.
"""

from __future__ import annotations

import numpy as np

from modalscope.identification.likelihood import Fitted, Point
from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["covariance_of_scores", "inverse", "normal", "residual", "scores", "scores_of_rows"]


def normal(point: Point, fitted: Fitted) -> tuple[RealArray, RealArray]:
    """Return the information J'J (2 n p, 2 n p) and J'r (2 n p,), real and imaginary part of every unknown side by side."""
    W, c = _free(point, fitted), _coefficients(point, fitted)
    V = W.view(np.float64)  # real and imaginary parts side by side
    slope = V.T @ fitted.left
    return _over_channels(V.T @ V, c), _interleaved(np.einsum("oa,ao->a", c, slope[::2] + 1j * slope[1::2]))


def covariance_of_scores(point: Point, fitted: Fitted, noise: RealArray) -> RealArray:
    """Return the covariance of J'e (2 n p, 2 n p), e of the covariance `noise` (4 n, 4 n) between compressed rows, alike in all channels.

    Parameters
    ----------
    point, fitted
    noise : array, (4 n, 4 n)
    """
    V = _free(point, fitted).view(np.float64)
    coloured = (noise @ V.reshape(len(noise), -1)).reshape(V.shape)
    return _over_channels(V.T @ coloured, _coefficients(point, fitted))


def _over_channels(G: RealArray, c: ComplexArray) -> RealArray:
    """Return sum_o of products of Re(c_oa W_a) and Re(j c_oa W_a) from those of real and imaginary parts of W, side by side."""
    RR, RI, II = G[::2, ::2], G[::2, 1::2], G[1::2, 1::2]
    H = (RR + II + 1j * (RI - RI.T)) * (c.conj().T @ c)
    S = (RR - II + 1j * (RI + RI.T)) * (c.T @ c)
    J = np.empty((2 * len(H), 2 * len(H)))
    J[::2, ::2], J[1::2, 1::2] = (H + S).real / 2, (H - S).real / 2
    J[::2, 1::2], J[1::2, ::2] = -(H + S).imag / 2, (H - S).imag / 2
    return J


def scores(point: Point, fitted: Fitted) -> RealArray:
    """Return J'r of every channel, (l, m, 2 n p): at the optimum they sum to zero."""
    W, c = _free(point, fitted), _coefficients(point, fitted)
    p = point.data.shape[2]
    each = np.einsum("kia,kio->oia", _split(W, p), _split(fitted.left, p), optimize=True) * c[:, None]
    return _interleaved(each.transpose(1, 0, 2) if point.problem.turned else each)


def scores_of_rows(point: Point, fitted: Fitted, blocks: Array) -> RealArray:
    """Return J'r of every block of rows, all channels together, (blocks, 2 n p).

    Parameters
    ----------
    point, fitted
    blocks : array of int, (K,)
        The block of every row, counted from zero.
    """
    W, c = _free(point, fitted), _coefficients(point, fitted)
    left, span = residual(point, fitted), point.span
    found = []
    for block in range(int(blocks.max()) + 1):
        rows = blocks == block
        part = np.tensordot(span[rows].T, left[rows], axes=1)  # (4 n, q, p)
        found.append(np.sum(c * np.einsum("kia,koi->oa", _split(W, part.shape[2]), part, optimize=True), axis=0))
    return _interleaved(np.array(found))


def residual(point: Point, fitted: Fitted) -> RealArray:
    """Return the whitened residual on all rows, (K, q, p)."""
    q, p = point.data.shape[1:]
    explained = point.data - _split(fitted.left, p).transpose(0, 2, 1)
    left = point.spanned(explained.reshape(len(explained), q * p)).reshape(-1, q, p)
    return np.subtract(point.problem.data, left, out=left)


def inverse(information: RealArray) -> RealArray:
    """Return the inverse, columns brought to one level first; directions that the data say nothing about are left at zero."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    found = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-13, hermitian=True)
    return np.asarray(found / np.outer(scale, scale))


def _free(point: Point, fitted: Fitted) -> ComplexArray:
    W = np.ascontiguousarray(point.directions())
    V = W.view(np.float64)  # real columns with real columns: half the work
    V -= fitted.kept @ (fitted.kept.T @ V)
    return W


def _coefficients(point: Point, fitted: Fitted) -> ComplexArray:
    """C of the mode of every unknown, (q, n p)."""
    return np.repeat(fitted.linear, point.sides.shape[1], axis=1)


def _split(columns: Array, p: int) -> Array:
    return columns.reshape(-1, p, columns.shape[1])


def _interleaved(values: ComplexArray) -> RealArray:
    """Derivatives by real and imaginary parts, Re v and Re(j v) = -Im v, side by side on the last axis."""
    return np.stack([values.real, -values.imag], axis=-1).reshape(*values.shape[:-1], -1)
