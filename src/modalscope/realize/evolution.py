"""How well the factors of a data matrix follow the modes read off it: EMAC and amplitude coherence of one order."""

from __future__ import annotations

import numpy as np

from modalscope.blocks.lines import LineMatrix
from modalscope.blocks.matrix import DataMatrix
from modalscope.indicators import amplitude_coherence, decay_step, emac_channels, weighted_mean
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.realize.triple import Realization

__all__ = ["column_side", "row_side"]


def _side(blocks: Array, first: Array, evolution: Array, vectors: ComplexArray) -> tuple[RealArray, RealArray]:
    """Return EMAC and amplitude coherence of one side: identified blocks (K, c, N) in states, first block (c, n) of the modes."""
    step = decay_step(evolution)
    modes = np.arange(step.size)
    identified = np.einsum("jcN,Nj->cj", blocks[step], vectors, optimize=True)
    emac = weighted_mean(emac_channels(identified, first * evolution[step, modes]), first)
    whole = blocks.reshape(-1, blocks.shape[2]) @ vectors
    coherence = amplitude_coherence(whole.reshape(*blocks.shape[:2], -1), first, evolution)
    return emac, coherence


def row_side(
    matrix: DataMatrix, realization: Realization, n: int, poles: Array, vectors: Array, shapes: Array
) -> tuple[RealArray, RealArray] | None:
    """Return EMAC and amplitude coherence of the row factor V = P d^1/2 against c_j g_k; None when its blocks are not whole.

    Parameters
    ----------
    matrix, realization
        The data matrix and what the model of order n was cut from.
    poles : array of complex, (k,)
        In the plane of the matrix.
    vectors : array of complex, (n, k)
        Eigenvectors of A.
    shapes : array of complex, (l, k)
        C times the eigenvectors.
    """
    factors, outputs = realization.factors, shapes.shape[0]
    count, rest = divmod(factors.P.shape[0], outputs)
    if (
        rest
        or count not in (matrix.block_rows, matrix.block_rows + 1)
        or getattr(matrix, "row_weights", None) is not None
    ):
        return None
    V = (factors.P[:, :n] * factors.d[:n] ** realization.row_power).reshape(count, outputs, n)
    # on a polynomial basis V_0 is C p_0
    scale = getattr(matrix, "output_scale", None)
    first = (shapes if scale is None else shapes / scale[:, None]) * getattr(matrix, "first_value", 1.0)
    return _side(V, first, matrix.evolution(poles, count), np.asarray(vectors))


def column_side(
    matrix: DataMatrix, realization: Realization, n: int, poles: Array, rows: Array, participation: Array
) -> tuple[RealArray, RealArray] | None:
    """Return the same for the column factor W = d^1/2 Q' against b_j z^k, on lines b_j / (x_i - s_j); None where blocks are not whole.

    Parameters
    ----------
    rows : array of complex, (k, n)
        Rows of the inverse of the eigenvectors.
    participation : array of complex, (k, m)
    """
    if isinstance(matrix, LineMatrix):
        return _line_side(matrix, realization, n, poles, rows, participation)
    factors, inputs = realization.factors, participation.shape[1]
    count, rest = divmod(factors.Q.shape[0], inputs)
    if not getattr(matrix, "whole", False) or rest or getattr(matrix, "column_weights", None) is not None:
        return None
    W = (factors.Q[:, :n] * factors.d[:n] ** (1 - realization.row_power)).reshape(count, inputs, n)
    return _side(W, participation.T, matrix.evolution(poles, count), np.asarray(rows).T)


def _line_side(
    matrix: LineMatrix, realization: Realization, n: int, poles: Array, rows: Array, participation: Array
) -> tuple[RealArray, RealArray]:
    """Return EMAC and amplitude coherence of the rows over the lines against b_j / (x_i - s_j), without what was eliminated.

    NaN for a mode that the elimination leaves nothing of. There is no last block: EMAC is the agreement on every line at +w and -w, weighted by the expected amplitude.
    """
    factors = realization.factors
    right = matrix.right_factor(factors)[:, :, :n] * factors.d[:n] ** (1 - realization.row_power)
    found = np.einsum("ifn,kn->ifk", right, rows, optimize=True)
    functions, seen = matrix.compared_functions(poles)
    expected = functions * matrix.residue_scale(poles) * participation.T[:, None, :]
    found, expected = (_at_both_signs(part) for part in (found, expected))
    flat, ideal = found.reshape(-1, len(rows)), expected.reshape(-1, len(rows))
    emac = weighted_mean(emac_channels(flat, ideal), ideal)
    coherence = amplitude_coherence(flat[None], ideal, np.ones((1, len(rows))))
    return np.where(seen, emac, np.nan), np.where(seen, coherence, np.nan)


def _at_both_signs(columns: ComplexArray) -> ComplexArray:
    """Turn columns of real and imaginary parts (m, 2 F, k) into the values at +w and -w."""
    real, imaginary = np.split(columns, 2, axis=1)
    return np.concatenate([real + 1j * imaginary, real - 1j * imaginary], axis=1)
