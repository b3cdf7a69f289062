"""Canonical variates: the projection of future on past with both sides whitened, so that its singular values are correlations.

With [past; future] = [[L11, 0], [L21, L22]] Q and L L' = L21 L21' + L22 L22', the future's own covariance, the matrix factored is
L^-1 L21 instead of L21. A weak mode beside strong noise then counts by how well the past predicts it, not by its size.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.projection import Projection, projection
from modalscope.blocks.sample_rows import MixedRows
from modalscope.model.checks import RealArray
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.labels import DofLike
from modalscope.model.signals import Signals

__all__ = ["CanonicalProjection", "canonical_projection"]


def canonical_projection(
    signals: Signals,
    references: Iterable[DofLike] | DofLike | None = None,
    block_rows: int = 10,
    block_columns: int = 10,
    correlation: ImpulseResponse | None = None,
) -> CanonicalProjection:
    """Project future outputs on past reference outputs, both whitened: what canonical variate analysis factors.

    Parameters
    ----------
    signals, references, block_rows, block_columns, correlation
        As in `modalscope.blocks.projection.projection`.

    Raises
    ------
    DataError
        As there.

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
