"""Triangular factors, orthonormal bases and projection residuals of tall arrays, by Cholesky factors where accurate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import Array, ComplexArray, RealArray

#: Relative residual norm that each column must keep given the preceding ones.
_MIN_REMAINDER = 1e-4

#: Relative residual norm from which a second factor corrects the first, and that each column must then keep: nearly one.
_MIN_CORRECTED_REMAINDER, _MIN_SECOND_REMAINDER = 1e-6, 0.5


def triangle_of(chunks: Callable[[], Iterator[RealArray]], columns: int, least: float = _MIN_REMAINDER) -> RealArray:
    """Return R (at most columns, columns) of all rows that the chunks give together.

    `chunks`: gives the chunks, (rows, columns) each, from the first on; it is called again where the Gram matrix is not accurate.
    `least`: relative residual norm that each column must keep for the Gram matrix to be accurate enough; R is then known to
    1e-16 / least^2.
    """
    gram, rows = _gram_and_rows(chunks(), columns)
    R = factor_of_gram(gram, overwrite=True, least=_MIN_CORRECTED_REMAINDER) if rows > columns else None
    if R is None:
        return _orthogonally(chunks(), columns)
    size, own = np.linalg.norm(R, axis=0), np.diag(R)
    if np.all(own >= least * size):
        return R
    divisor = np.asfortranarray(R + np.diag(np.where(size > 0, 0.0, 1.0)))
    level = (sla.blas.dtrsm(1.0, divisor, chunk.T, trans_a=1).T for chunk in chunks())
    S = factor_of_gram(gram_of(level, columns), overwrite=True, least=_MIN_SECOND_REMAINDER)
    return _orthogonally(chunks(), columns) if S is None else np.asarray(S @ R)


def gram_of(chunks: Iterable[RealArray], columns: int) -> RealArray:
    """Return the upper triangle of the Gram matrix of all rows that the chunks (rows, columns) give together."""
    return _gram_and_rows(chunks, columns)[0]


def _gram_and_rows(chunks: Iterable[RealArray], columns: int) -> tuple[RealArray, int]:
    """Return the Gram matrix of all chunks, its upper triangle, and how many rows they have."""
    gram, rows = np.zeros((columns, columns), order="F"), 0
    for chunk in chunks:
        sla.blas.dsyrk(1.0, chunk.T, beta=1.0, c=gram, overwrite_c=1)  # in its place
        rows += len(chunk)
    return gram, rows


def _orthogonally(chunks: Iterator[RealArray], columns: int) -> RealArray:
    """Return R by Householder's reflections, in one place that holds R and as many rows again."""
    place = np.zeros((2 * columns, columns), order="F")
    filled = 0
    for chunk in chunks:
        for start in range(0, len(chunk), columns):
            part = chunk[start : start + columns]
            if filled + len(part) > len(place):
                filled = _reflected(place, filled)
            place[filled : filled + len(part)] = part
            filled += len(part)
    return np.ascontiguousarray(place[: _reflected(place, filled)])


def _reflected(place: RealArray, filled: int) -> int:
    """Replace the filled rows by their triangular factor, and return how many rows that has."""
    columns: int = place.shape[1]
    place[filled:] = 0
    sla.lapack.dgeqrf(place, overwrite_a=1)
    for k in range(columns):
        place[k + 1 :, k] = 0
    return min(filled, columns)


def factor_of_gram(gram: RealArray, *, overwrite: bool = False, least: float = _MIN_REMAINDER) -> RealArray | None:
    """Return the upper triangular R with R'R = G, columns of zeros kept; None where columns are nearly dependent.

    `gram` (n, n): g; its upper triangle is read. `overwrite`: whether its place may be used. `least`: relative residual norm
    that each column must keep given the preceding ones.

    Examples
    --------
    >>> factor_of_gram(np.array([[4.0, 2.0], [2.0, 2.0]]))
    array([[2., 1.],
           [0., 1.]])
    >>> factor_of_gram(np.ones((2, 2))) is None
    True
    """
    size = np.sqrt(np.diag(gram))
    alive = size > 0
    level = gram if overwrite else np.array(gram, order="F")
    level /= np.where(alive, size, 1)
    level /= np.where(alive, size, 1)[:, None]
    level[~alive, ~alive] = 1
    factor, failed = sla.lapack.dpotrf(level, lower=0, clean=1, overwrite_a=1)
    own = np.diag(factor)[alive]
    if failed or not np.all(np.isfinite(own)) or own.min(initial=1.0) < least:
        return None
    factor *= size
    return np.asarray(factor)


def stacked_factor(R: RealArray, chunk: RealArray) -> RealArray:
    """Return the triangular factor of R above a chunk; both as they are where they are wide."""
    stacked = np.vstack([R, chunk]) if len(R) else np.array(chunk, dtype=float)
    if len(stacked) <= stacked.shape[1]:
        return stacked
    factor = sla.qr(stacked, mode="r", overwrite_a=True, check_finite=False)[0]
    return np.asarray(factor[: stacked.shape[1]], dtype=float)


#: Distance from orthonormal columns within which a pass reaches rounding: the condition is then below (1 + .1) / (1 - .1).
_MAX_DEVIATION = 0.1


def orthonormal(columns: RealArray) -> RealArray:
    """Return orthonormal columns of the same span, (K, k): one or two passes X R^-1 with R'R = X'X, which are products, or Householder's.

    The first pass leaves about eps times the square of the condition, columns brought to one length: rounding where they are nearly
    orthogonal, as what comes out of a Gram matrix' eigenvectors is. Where it is small beside one the second pass leaves rounding; other
    columns cost a tenth more for the trial.

    `columns` (K, k): K >= k.

    References
    ----------
    Yamamoto, Nakatsukasa, Yanagisawa and Fukaya, "Roundoff error analysis of the CholeskyQR2 algorithm", ETNA 44 (2015).

    Examples
    --------
    >>> X = np.random.default_rng(0).standard_normal((50, 3)) * [1, 1e-9, 1e5]
    >>> Q = orthonormal(X)
    >>> bool(np.allclose(Q.T @ Q, np.eye(3), atol=1e-14)), bool(np.allclose(Q @ (Q.T @ X), X, rtol=1e-12))
    (True, True)
    """
    base, by = orthonormal_by(columns)
    return base if by is None else np.asarray(base @ by)


def orthonormal_by(columns: RealArray) -> tuple[RealArray, RealArray | None]:
    """Return X (K, k) and T (k, k) of which X T is what `orthonormal` gives, for products that take T last; T is None where X is that."""
    size = np.sqrt(np.einsum("kj,kj->j", columns, columns))
    if not np.all(size > 0) or not np.all(np.isfinite(size)):
        return np.asarray(np.linalg.qr(columns)[0]), None
    basis = columns
    for scale in (size, np.ones_like(size)):
        gram = basis.T @ basis / np.outer(scale, scale)
        near = np.linalg.norm(gram - np.eye(len(size))) <= _MAX_DEVIATION
        if basis is not columns and not near:
            break
        try:
            inverse = sla.lapack.dtrtri(sla.cholesky(gram, check_finite=False))[0]
        except sla.LinAlgError:
            break
        by = np.asarray(inverse / scale[:, None])
        if near:
            return basis, by
        basis = np.asarray(basis @ by)
    return np.asarray(np.linalg.qr(columns)[0]), None


#: Number of rows from which reflections take longer than two Cholesky factors.
_MIN_CHOLESKY_ROWS = 3000

#: Maximum condition of a Gram matrix with unit diagonal, in the 1-norm, at which products serve alone: what its Cholesky factor gives is
#: then known to eps times that, 2e-13.
_MAX_CONDITION_OF_PRODUCTS = 1e3


#: Rows of two successive products that are computed at a time: the intermediate result stays in the cache.
_ROWS_AT_A_TIME = 256

#: Share of the largest eigenvalue of a Gram matrix, and of the energy of the data, below which the rest is rounding.
_ROUNDING_OF_GRAM, _ROUNDING_OF_RESIDUAL = 1e-11, 1e-8

#: Maximum relative error of an energy computed as a difference, by a bound that is pessimistic by a factor of about 100.
_MAX_ENERGY_ERROR = 1e-7


def resolved(X: RealArray, data: RealArray) -> tuple[RealArray, RealArray]:
    """Return Q'D and R of Q R = X: of many rows by two Cholesky factors of Gram matrices, as exact as reflections.

    Columns are brought to one length for that. The first basis X R1^-1, by substitution row by row, is orthonormal but for eps times the
    squared condition; where its own Gram matrix shows that to be small, the second factor leaves rounding. It is applied to what the first
    basis sees of the data, as reflections are to the data: Q is never made.

    `X` (K, k): columns that are not zero. `data` (K, q).

    References
    ----------
    Yamamoto et al., "Roundoff error analysis of the CholeskyQR2 algorithm", Electronic Transactions on Numerical Analysis 44 (2015).
    """
    if not X.size:  # no modes: LAPACK has no reflections for them
        return np.zeros((0, data.shape[1])), np.zeros((0, X.shape[1]))
    gram = X.T @ X
    scale = np.sqrt(np.diag(gram))
    first = _triangle(gram / np.outer(scale, scale)) if len(X) > _MIN_CHOLESKY_ROWS else None
    if first is not None:
        first = np.asfortranarray(first * scale)
        near, projected = np.zeros_like(gram), np.zeros((len(scale), data.shape[1]))
        for start in range(0, len(X), _ROWS_AT_A_TIME):
            some = np.array(X[start : start + _ROWS_AT_A_TIME], order="F")
            rows = sla.blas.dtrsm(1.0, first, some, side=1, overwrite_b=1)
            near += rows.T @ rows
            projected += rows.T @ data[start : start + _ROWS_AT_A_TIME]
        second = _triangle(near) if np.linalg.norm(near - np.eye(len(near))) <= _MAX_DEVIATION else None
        if second is not None:
            solution = sla.solve_triangular(second, projected, trans=1, check_finite=False)
            return np.asarray(solution), np.asarray(second @ first)
    mirrored, R = sla.qr_multiply(X / scale, data.T, mode="right", overwrite_a=True)
    return np.asarray(mirrored.T, dtype=float), np.asarray(R * scale, dtype=float)


def resolved_by_products(gram: RealArray, projected: RealArray) -> tuple[RealArray, RealArray] | None:
    """Return what `resolved` does from the products X'X and X'D alone; None where X'X, columns of one length, is not well conditioned.

    `gram` (k, k): its diagonal is not zero. `projected` (k, q).
    """
    scale = np.sqrt(np.diag(gram))
    level = gram / np.outer(scale, scale)
    R = _triangle(level)
    if R is None or _condition(R, level) > _MAX_CONDITION_OF_PRODUCTS:
        return None
    R = R * scale
    return np.asarray(sla.solve_triangular(R, projected, trans=1, check_finite=False)), R


def _condition(triangle: RealArray, gram: RealArray) -> float:
    """Return an estimate of |G| |G^-1| in the 1-norm from R with R'R = G."""
    reciprocal, _ = sla.lapack.dpocon(triangle, np.abs(gram).sum(axis=0).max())
    return float(1 / reciprocal) if reciprocal > 0 else np.inf


def spanning(gram: RealArray) -> tuple[RealArray, RealArray]:
    """Return W and R of columns P (K, k), from their products P'P (k, k): P W is orthonormal, and P = P W R.

    With columns of length one P'P = V L V', W = V L^-1/2 and R = L^1/2 V', without directions that products cannot tell from dependent
    ones.
    """
    W, R, _ = _spanned(gram)
    return W, R


def energy_left(data: RealArray, columns: RealArray) -> RealArray:
    """Return sums of squares of data less all that columns explain, (q,): as differences where digits allow, else of the rest."""
    columns = _finite(columns)
    W, _, spread = _spanned(columns.T @ columns)
    whole, projected = np.einsum("kq,kq->q", data, data), W.T @ (columns.T @ data)
    energy = whole - np.einsum("kq,kq->q", projected, projected)
    # a direction is known to rounding times the condition, and takes that share of all others with it
    error = np.finfo(float).eps * np.sqrt(whole) * (spread @ np.abs(projected))
    rounded = ~(energy * _MAX_ENERGY_ERROR > error)
    if np.any(rounded):
        rest = _less(data[:, rounded], columns, W, projected[:, rounded])
        energy[rounded] = np.einsum("kq,kq->q", rest, rest)
    return np.asarray(energy)


def _finite(columns: RealArray) -> RealArray:
    """Return columns whose squares can be summed: only what they span counts."""
    if np.isfinite(np.einsum("kc,kc->", columns, columns)):
        return columns
    size = np.abs(columns).max(axis=0)
    return columns / np.where(size > 0, size, 1.0)


def _spanned(gram: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Return W and R as `spanning` does, and by how much smaller than the largest each direction is, squared."""
    size = np.sqrt(np.diag(gram))
    used = np.flatnonzero(size)
    values, vectors = np.linalg.eigh(gram[np.ix_(used, used)] / np.outer(size[used], size[used]))
    kept = values > _ROUNDING_OF_GRAM * values.max(initial=0.0)
    root, V = np.sqrt(values[kept]), vectors[:, kept]
    W, R = np.zeros((size.size, root.size)), np.zeros((root.size, size.size))
    W[used], R[:, used] = V / root / size[used, None], (root[:, None] * V.T) * size[used]
    return W, R, values.max(initial=0.0) / values[kept]


def _less(data: RealArray, columns: RealArray, W: RealArray, projected: RealArray) -> RealArray:
    """Return `less` of columns that W makes orthonormal; `projected`: W'X'D of the data."""
    residual = data - columns @ (W @ projected)
    residual -= columns @ (W @ (W.T @ (columns.T @ residual)))
    if np.sum(residual**2) < _ROUNDING_OF_RESIDUAL * np.sum(data**2):
        Q = np.asarray(np.linalg.qr(columns[:, np.any(W, axis=1)])[0])
        residual = data - Q @ (Q.T @ data)
    return residual


def _triangle(gram: RealArray) -> RealArray | None:
    """Return R with R'R the Gram matrix; None where rounding leaves it no such factor."""
    try:
        return np.asarray(np.linalg.cholesky(gram).T)
    except np.linalg.LinAlgError:
        return None


def most_real(vectors: Array) -> ComplexArray:
    """Return vectors (l,) or (l, n) turned by -arg(sum phi^2) / 2: real and imaginary parts are orthogonal, and the real one is largest.

    Examples
    --------
    >>> most_real(np.array([1j, 2j]))
    array([1.+0.j, 2.+0.j])
    """
    return np.asarray(vectors * np.exp(-0.5j * np.angle(np.sum(vectors**2, axis=0))))


def scaled_span(columns: RealArray) -> RealArray:
    """Return an orthonormal basis of what columns span, each brought to length one first, with one copy of long columns beside it.

    `columns` (K, k).
    """
    scaled = _of_length_one(columns)
    if not scaled.shape[1]:
        return scaled
    U, s, _ = sla.svd(scaled, full_matrices=False, overwrite_a=True)
    return U[:, : np.count_nonzero(s > max(scaled.shape) * np.finfo(float).eps * s[0])]


def span_by_products(columns: RealArray) -> RealArray:
    """Return a basis of the same, in a fourth of the time: by two Cholesky factors where columns are independent.

    `columns` (K, k): K well above k.
    """
    scaled = _of_length_one(columns)
    R = factor_of_gram(scaled.T @ scaled, overwrite=True, least=_MIN_CORRECTED_REMAINDER)
    if R is not None:
        scaled = sla.blas.dtrsm(1.0, R, scaled, side=1, overwrite_b=1)  # each in their place
        S = factor_of_gram(scaled.T @ scaled, overwrite=True, least=_MIN_SECOND_REMAINDER)
        if S is not None:
            return np.asarray(sla.blas.dtrsm(1.0, S, scaled, side=1, overwrite_b=1))
    return scaled_span(columns)


def _of_length_one(columns: RealArray) -> RealArray:
    """Return a copy of the columns that are not zero, each divided by its length: one after the other, LAPACK makes no further copy."""
    size = np.sqrt(np.einsum("kj,kj->j", columns, columns))
    scaled = columns.copy("F") if np.all(size > 0) else np.asfortranarray(columns[:, size > 0])
    scaled /= size[size > 0]
    return scaled
