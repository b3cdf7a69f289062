"""Projection of future on past outputs of records (data-driven subspace identification), plain or as canonical variates.

With [past; future] = [[L11, 0], [L21, L22]] Q and L L' = L21 L21' + L22 L22', the future's own covariance, the matrix factored is
L^-1 L21 instead of L21. A weak mode beside strong noise then counts by how well the past predicts it, not by its size.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import scipy.linalg as sla
from numpy.lib.stride_tricks import sliding_window_view

from modalscope.data.geometry import DofLike, references_of
from modalscope.data.records import Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.identification.fast.window_gram import triangle_of, window_gram
from modalscope.identification.matrices.influence import ConvolvedInfluence, Lines, convolved
from modalscope.identification.matrices.matrix import Eigen, ModalFit, Triple
from modalscope.identification.matrices.sampled_rows import MixedRows, SampleRows
from modalscope.numerics.checks import Array, IntArray, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.sums import TriangleSum

#: Columns of the triangular factorization processed at a time, in multiples of the rows.
_CHUNK_COLUMNS = 4


def projection(
    signals: Signals,
    references: Iterable[DofLike] | DofLike | None = None,
    block_rows: int = 10,
    block_columns: int = 10,
    correlation: ImpulseResponse | None = None,
) -> Projection:
    """Project future outputs on past reference outputs: what data-driven stochastic subspace identification factors.

    With y(t) the outputs, q = block_rows and p = block_columns, the columns for all times t of all runs are

        past    [y_ref(t - 1); y_ref(t - 2); ...; y_ref(t - p)],    future  [y(t); y(t + 1); ...; y(t + q)],

    divided by the root of their number. With [past; future] = [[L11, 0], [L21, L22]] Q the projection is L21 Q1, and L21 has its left
    factor and singular values.

    `signals`: the mean of every channel and run is removed; inputs are not used. `references`: outputs of the past; all by default.
    `block_rows`, `block_columns`: blocks of the future but one, and of the past. `correlation`: of the same records: what participation
    is fitted to and a model is compared with.

    Raises `DataError`: unknown references, or fewer columns than rows: everything can then be predicted from the past.

    Returns
    -------
    Projection

    References
    ----------
    Van Overschee and De Moor, "Subspace Identification for Linear Systems", 1996, chapter 3; Peeters and De Roeck, "Reference-based
    stochastic subspace identification for output-only modal analysis", Mech. Syst. Signal Process. 13 (1999), 855-878.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((2000, 2))
    >>> matrix = projection(Signals(outputs=y, sampling_rate=10.0), ["y2"], block_rows=3, block_columns=5)
    >>> matrix.tall().shape
    (8, 5)
    """
    chosen = np.array(references_of(references, signals.output_dofs), dtype=np.intp)
    future, past = check_count("block_rows", block_rows), check_count("block_columns", block_columns)
    outputs, _ = signals.by_run()
    centred = outputs - outputs.mean(axis=1, keepdims=True)
    made = Projection(centred, chosen, future, past, signals.sampling_rate, correlation)
    if made.columns < made.rows:
        raise DataError(
            f"projection(block_rows={future}, block_columns={past}) of {outputs.shape[2]} outputs on {chosen.size} references:",
            f"{signals.runs} x {signals.samples} samples give {made.columns} columns for {made.rows} rows: "
            "the past predicts any record of that length",
            "Lower block_rows and block_columns, take fewer references, or measure a longer record.",
        )
    return made


@dataclass(frozen=True, eq=False)
class Projection(SampleRows):
    """Future outputs projected on past reference outputs (made by `projection`).

    `values` (R, N, l): runs without their means. `references` (r,). `future_blocks`, `past_blocks`: blocks of the future but one, and of
    the past.
    """

    values: RealArray
    references: IntArray
    future_blocks: int
    past_blocks: int
    sampling_rate: float
    correlation: ImpulseResponse | None = None
    by_mode = True

    @property
    def judged(self) -> ImpulseResponse:
        """The correlation of the records."""
        if self.correlation is None:
            raise DataError(
                "modes of projected records:",
                "their correlation is missing",
                "Give projection(..., correlation=estimate_correlation(signals)).",
            )
        return self.correlation

    @property
    def block_rows(self) -> int:
        """Blocks of the future but one."""
        return self.future_blocks

    @property
    def outputs(self) -> int:
        """Outputs of the records."""
        return int(self.values.shape[2])

    @property
    def columns(self) -> int:
        """Times at which past and future lie within a run, over all runs."""
        runs, samples, _ = self.values.shape
        return int(runs * max(samples - self.block_rows - self.past_blocks, 0))

    @property
    def past(self) -> int:
        """Rows of the past, r p."""
        return int(self.references.size * self.past_blocks)

    @property
    def rows(self) -> int:
        """Rows of past and future together, r p + l (q + 1)."""
        return self.past + self.outputs * (self.block_rows + 1)

    def _chunks(self) -> Iterator[RealArray]:
        """Yield columns of [past; future] as rows, some at a time."""
        p = self.past_blocks
        for run in self.values:
            windows = sliding_window_view(run, p + self.block_rows + 1, axis=0)  # (columns, l, blocks)
            for start in range(0, len(windows), _CHUNK_COLUMNS * self.rows):
                part = windows[start : start + _CHUNK_COLUMNS * self.rows].transpose(0, 2, 1)
                before = part[:, p - 1 :: -1][:, :, self.references]
                count = len(part)
                yield np.hstack([before.reshape(count, -1), part[:, p:].reshape(count, -1)])

    def _gram(self) -> RealArray:
        """Return [past; future] [past; future]' over all times and runs."""
        p, blocks = self.past_blocks, self.past_blocks + self.block_rows + 1
        whole: RealArray = np.sum([window_gram(run, blocks) for run in self.values], axis=0)
        channels = np.arange(blocks * self.outputs).reshape(blocks, self.outputs)
        kept = np.concatenate([channels[p - 1 :: -1][:, self.references].ravel(), channels[p:].ravel()])
        return np.asarray(whole[np.ix_(kept, kept)])

    @cached_property
    def _both(self) -> RealArray:
        """[[L11, 0], [L21, L22]], the past above the future: by the windows' Gram matrix, or where that is not exact by the windows."""
        L = triangle_of(self._gram())
        if L is not None:
            return np.asarray(L / np.sqrt(self.columns), order="C")
        total = TriangleSum(self.rows)
        for chunk in self._chunks():
            total.add(chunk)
        return np.asarray(total.finish().T / np.sqrt(self.columns), order="C")

    @property
    def past_triangle(self) -> RealArray:
        """L11 (r p, r p), lower triangular: the past's own covariance is L11 L11'."""
        return self._both[: self.past, : self.past]

    @property
    def future(self) -> RealArray:
        """[L21, L22] (l (q + 1), r p + l (q + 1)): the future in the coordinates of the past and of what it does not predict."""
        return self._both[self.past :]

    @cached_property
    def triangle(self) -> RealArray:
        """L21 (l (q + 1), r p): the projection times an orthonormal matrix, its exact stand-in, from runs and times in turn."""
        return np.ascontiguousarray(self.future[:, : self.past])

    def influence(self, left: Array, right: Array, lines: Lines | None = None) -> ConvolvedInfluence:
        """Return the gradient by the correlation: L21 = R L11^-T with blocks R(a + b + 1), and what L11 changes stays in the range."""
        v = sla.solve_triangular(self.past_triangle, right, lower=True, trans="T", check_finite=False).T
        L = left.reshape(len(left), -1, self.outputs)
        past = v.reshape(len(left), self.past_blocks, self.references.size)
        columns = np.zeros((*past.shape[:2], self.judged.values.shape[2]), dtype=complex)
        columns[:, :, self.references] = past
        return convolved(L, columns)

    @property
    def dt(self) -> float:
        """Sampling interval, seconds."""
        return 1 / self.sampling_rate

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes C X, and participation by least squares over the correlation of the records."""
        shapes = np.asarray(model.C @ eigen.vectors)
        response = self.judged
        participation, _ = response.basis(self.to_s(eigen.values)).fit_participation(shapes)
        feedthrough = response.feedthrough
        return ModalFit(shapes, participation, (0 * response.values[0] if feedthrough is None else feedthrough)[None])

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        return (
            f"{self.block_rows + 1} future blocks of {self.outputs} outputs projected on {self.past_blocks} past blocks "
            f"of {self.references.size} references, over {self.columns} times"
        )


def canonical_projection(
    signals: Signals,
    references: Iterable[DofLike] | DofLike | None = None,
    block_rows: int = 10,
    block_columns: int = 10,
    correlation: ImpulseResponse | None = None,
) -> CanonicalProjection:
    """Project future outputs on past reference outputs, both whitened: what canonical variate analysis factors.

    `signals`, `references`, `block_rows`, `block_columns`, `correlation`: as in
    `modalscope.identification.matrices.projections.projection`.

    Raises `DataError`: as there.

    References
    ----------
    Larimore, "Canonical variate analysis in identification, filtering, and adaptive control", 29th IEEE CDC (1990); Van Overschee and
    De Moor, "Subspace Identification for Linear Systems", 1996, chapter 3.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((2000, 2))
    >>> matrix = canonical_projection(Signals(outputs=y, sampling_rate=10.0), block_rows=3, block_columns=5)
    >>> d = np.linalg.svd(matrix.tall().dense(), compute_uv=False)
    >>> bool(0 < d[0] < 0.2)  # correlations: white noise predicts nothing of itself
    True
    """
    plain = projection(signals, references, block_rows, block_columns, correlation)
    return CanonicalProjection(**{f.name: getattr(plain, f.name) for f in fields(plain)})


@dataclass(frozen=True, eq=False)
class CanonicalProjection(MixedRows, Projection):
    """Future outputs projected on past reference outputs, whitened (made by `canonical_projection`)."""

    @cached_property
    def mixing(self) -> RealArray:
        """L (l (q + 1), l (q + 1)), lower triangular: what takes whitened rows back to outputs."""
        R = np.asarray(sla.qr(self.future.T, mode="r", check_finite=False)[0])
        return np.asarray(R[: R.shape[1]].T)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        return f"{super().describe()}, both whitened (canonical variates)"
