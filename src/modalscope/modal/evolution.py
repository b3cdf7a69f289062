"""How well the factors of a data matrix follow the modes read off it: EMAC and amplitude coherence of one order."""

from __future__ import annotations

import numpy as np

from modalscope.blocks.hankel import Hankel
from modalscope.blocks.lines import LineMatrix
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.projection import Projection
from modalscope.modal.indicators import amplitude_coherence, decay_step, emac_channels, weighted_mean
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.realizations.triple import Realization

__all__ = ["column_side", "row_side"]


def _last_blocks(blocks: Array, first: Array, evolution: Array, vectors: ComplexArray) -> RealArray:
    """Return the EMAC of one side: identified blocks (K, c, N) in states against the first block (c, n) of the modes, grown."""
    step = decay_step(evolution)
    identified = np.einsum("jcN,Nj->cj", blocks[step], vectors, optimize=True)
    return weighted_mean(emac_channels(identified, first * evolution[step, np.arange(step.size)]), first)


def _times(blocks: Array, states: ComplexArray) -> ComplexArray:
    """Return blocks (K, c, N) times states (N, k), as one product of real arrays."""
    real = np.ascontiguousarray(states).view(np.float64)
    product = np.ascontiguousarray(blocks.reshape(-1, blocks.shape[2]) @ real)
    return product.view(np.complex128).reshape(*blocks.shape[:2], -1)


def row_side(
    matrix: DataMatrix,
    realization: Realization,
    n: int,
    poles: Array,
    vectors: Array,
    shapes: Array,
    *,
    coherence: bool = True,
) -> tuple[RealArray, RealArray | None] | None:
    """Return EMAC and amplitude coherence of the row factor V = P d^1/2 against c_j g_k; None when its blocks are not whole.

    Parameters
    ----------
    matrix, realization, n
        The data matrix, and what the model of order n was cut from.
    poles : array of complex, (k,)
        In the plane of the matrix.
    vectors : array of complex, (n, k)
        Eigenvectors of A.
    shapes : array of complex, (l, k)
        C times the eigenvectors.
    coherence : bool
        Whether the amplitude coherence is wanted: it needs all rows, of which there may be many, and is None without.
    """
    blocks = matrix.row_blocks(realization.factors.P[:, :n])
    if blocks is None:
        return None
    first = matrix.first_block(shapes)
    states: Array = realization.factors.d[:n, None] ** realization.row_power * np.asarray(vectors, dtype=np.complex128)
    evolution = matrix.evolution(poles, blocks.shape[0])
    emac = _last_blocks(blocks, first, evolution, states)
    return emac, amplitude_coherence(_times(blocks, states), first, evolution) if coherence else None


def column_side(
    matrix: Hankel | Projection | LineMatrix,
    realization: Realization,
    n: int,
    poles: Array,
    rows: Array,
    participation: Array,
) -> tuple[RealArray, RealArray] | None:
    """Return the same for the column factor W = d^1/2 Q' against b_j z^k, on lines b_j / (x_i - s_j).

    None where blocks are not whole, and where columns are times, at which the states are unknown.

    Parameters
    ----------
    matrix, realization, n, poles
        As in `row_side`.
    rows : array of complex, (k, n)
        Rows of the inverse of the eigenvectors.
    participation : array of complex, (k, m)
    """
    if isinstance(matrix, Projection):
        return None
    if isinstance(matrix, LineMatrix):
        return _line_side(matrix, realization, n, poles, rows, participation)
    factors = realization.factors
    blocks = matrix.column_blocks(factors.Q[:, :n])
    if blocks is None:
        return None
    first = matrix.first_block_of_inputs(participation).T
    states: Array = factors.d[:n, None] ** (1 - realization.row_power) * np.asarray(rows, dtype=np.complex128).T
    evolution = matrix.evolution(poles, blocks.shape[0])
    grown = _times(blocks, states)
    return _last_blocks(blocks, first, evolution, states), amplitude_coherence(grown, first, evolution)


def _line_side(
    matrix: LineMatrix, realization: Realization, n: int, poles: Array, rows: Array, participation: Array
) -> tuple[RealArray, RealArray]:
    """Return EMAC and amplitude coherence of the rows over the lines against b_j / (x_i - s_j), without what was eliminated.

    NaN for a mode that the elimination leaves nothing of. There is no last block: EMAC is the agreement on every line at +w and
    -w, weighted by the expected amplitude.
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
