"""Canonical variates: singular values are canonical correlations, and what is read off the whitened factor belongs to the outputs."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla

from modalscope import systems
from modalscope.data import Signals
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.projections import CanonicalProjection, canonical_projection
from modalscope.identification.method_names import find_method
from modalscope.identification.realizations.shift import shift
from tests.support import built

ROWS, COLUMNS = 6, 8


@pytest.fixture(scope="module")
def record() -> Signals:
    return systems.chain5().simulate(inputs="ambient", samples=4000, sampling_rate=10.0, seed=3)


@pytest.fixture(scope="module")
def matrix(record: Signals) -> CanonicalProjection:
    return canonical_projection(record, block_rows=ROWS, block_columns=COLUMNS)


def plain(record: Signals) -> tuple[np.ndarray, np.ndarray]:
    """Past and future of all times as columns, by definition."""
    y = np.asarray(record.outputs) - np.asarray(record.outputs).mean(axis=0)
    times = range(COLUMNS, len(y) - ROWS)
    past = np.array([y[t - COLUMNS : t][::-1].ravel() for t in times]).T
    future = np.array([y[t : t + ROWS + 1].ravel() for t in times]).T
    return past / np.sqrt(len(times)), future / np.sqrt(len(times))


def test_singular_values_are_the_canonical_correlations_of_past_and_future(
    record: Signals, matrix: CanonicalProjection
) -> None:
    past, future = plain(record)
    bases = [np.linalg.qr(side.T)[0] for side in (past, future)]
    correlations = np.linalg.svd(bases[1].T @ bases[0], compute_uv=False)
    d = np.linalg.svd(matrix.tall().dense(), compute_uv=False)
    np.testing.assert_allclose(d, correlations[: d.size], atol=1e-10)
    assert d.max() < 1


def test_the_mixing_is_the_root_of_the_covariance_of_the_future(record: Signals, matrix: CanonicalProjection) -> None:
    _, future = plain(record)
    np.testing.assert_allclose(matrix.mixing @ matrix.mixing.T, future @ future.T, rtol=1e-10, atol=1e-12)
    assert np.array_equal(matrix.mixing, np.tril(matrix.mixing))


def test_the_model_is_the_textbook_one(matrix: CanonicalProjection) -> None:
    """W1 = cov(future)^(-1/2), O = W1^-1 U S^(1/2), A = O[:-l]# O[l:] (Van Overschee and De Moor, 1996)."""
    n, l = 8, matrix.outputs
    values, vectors = np.linalg.eigh(matrix.mixing @ matrix.mixing.T)
    root = vectors * np.sqrt(values) @ vectors.T
    U, s, _ = np.linalg.svd(sla.solve(root, matrix.triangle))
    O = root @ U[:, :n] * np.sqrt(s[:n])
    textbook = np.linalg.lstsq(O[:-l], O[l:], rcond=None)[0]
    model = shift(matrix, factorize(matrix.tall(), n)).triple(n)
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(model.A)), np.sort_complex(np.linalg.eigvals(textbook)), atol=1e-9
    )


def test_block_rows_of_the_factor_are_those_of_outputs(matrix: CanonicalProjection) -> None:
    """So that EMAC compares what was identified with c z^k, not with whitened rows: the first block row is C itself."""
    n = 8
    factors = factorize(matrix.tall(), n)
    model = shift(matrix, factors).triple(n)
    blocks = matrix.row_blocks(factors.P) * np.sqrt(factors.d)
    np.testing.assert_allclose(blocks[0], model.C, atol=1e-10)
    assert blocks.shape == (ROWS + 1, matrix.outputs, n)


def test_it_is_a_row_of_the_table_by_any_of_its_names(record: Signals) -> None:
    assert find_method("CVA", None, "time").name == "ssi-cva"
    pipeline = built(record, method="canonical variate analysis", order=10)
    assert pipeline.settings["weighting"] == "cva"
    assert isinstance(pipeline.matrix.fitted, CanonicalProjection)
