"""The block data matrix against its definition (Eqs. 17, 20-21): subsets, shifts, weights, compression, and the conditions."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import DataError, ImpulseResponse
from modalscope.identification.fast.block_hankel import BlockHankel
from modalscope.identification.identify import identify
from modalscope.identification.matrices.hankel import hankel
from tests.support import EPS, FIVE, add_noise, relative, row_selection, row_sums


@pytest.fixture
def response() -> ImpulseResponse:
    """White samples: every entry of the matrix is a number of its own, so that a wrong index cannot hide."""
    values = np.random.default_rng(5).standard_normal((40, 3, 2))
    return ImpulseResponse(values=values, sampling_rate=10.0)


def by_definition(values, k, row_shifts, rows, column_shifts, columns):
    """Block (j, i) = Y_{J_j I_i}(s_j + k + t_i), written out."""
    return np.block(
        [
            [values[s + k + t][np.ix_(J, I)] for t, I in zip(column_shifts, columns, strict=True)]
            for s, J in zip(row_shifts, rows, strict=True)
        ]
    )


def test_whole_blocks_are_the_plain_hankel_matrix(response):
    H = hankel(response, block_rows=5, block_columns=7)
    all_rows, all_columns = [range(3)] * 5, [range(2)] * 7
    for k in (0, 1):
        want = by_definition(response.values, k, range(5), all_rows, range(7), all_columns)
        np.testing.assert_array_equal(H.shifted(k).dense(), want)
    tall = np.vstack([H.shifted(0).dense(), H.shifted(1).dense()[-3:]])
    np.testing.assert_array_equal(H.tall().dense(), tall)


def test_any_subsets_and_shifts_follow_the_definition(response):
    s, J = [0, 2, 3, 7], [[0, 1, 2], [0, 2], [1], [2, 0]]
    t, I = [0, 1, 4, 9, 10], [[0, 1], [1], [0, 1], [0], [1, 0]]
    H = hankel(response, row_shifts=s, row_subsets=J, column_shifts=t, column_subsets=I)
    for k in (0, 1):
        np.testing.assert_array_equal(H.shifted(k).dense(), by_definition(response.values, k, s, J, t, I))
    assert (H.block_rows, H.block_columns) == (4, 5)


@pytest.mark.parametrize("per_block", [False, True])
def test_weights_and_compression_act_in_that_order(response, per_block):
    rng = np.random.default_rng(0)
    plain = hankel(response, block_rows=4, block_columns=6)
    wr = rng.uniform(0.5, 2, 12 if per_block else 3)
    wc = rng.uniform(0.5, 2, 12 if per_block else 2)
    T = rng.standard_normal((2, 3))
    H = hankel(response, block_rows=4, block_columns=6, row_weights=wr, column_weights=wc, row_compression=T)
    rows, columns = (wr, wc) if per_block else (np.tile(wr, 4), np.tile(wc, 6))
    for k in (0, 1):
        want = np.kron(np.eye(4), T) @ (rows[:, None] * plain.shifted(k).dense() * columns)
        assert relative(H.shifted(k).dense(), want) < 10 * EPS


def test_compression_over_whole_columns_and_rows(response):
    rng = np.random.default_rng(1)
    Tr, Tc = rng.standard_normal((5, 12)), rng.standard_normal((4, 12))
    plain = hankel(response, block_rows=4, block_columns=6)
    H = hankel(response, block_rows=4, block_columns=6, row_compression=Tr, column_compression=Tc)
    assert relative(H.shifted(1).dense(), Tr @ plain.shifted(1).dense() @ Tc.T) < 10 * EPS


@pytest.mark.parametrize(("rows", "columns"), [(3, 9), (9, 3), (1, 6), (6, 1)])
def test_products_and_gram_recursion_agree_with_the_array(rows, columns):
    values = np.random.default_rng(2).standard_normal((rows + columns + 1, 4, 3))
    rng = np.random.default_rng(3)
    for operator in (BlockHankel(values, rows, columns), BlockHankel(values, rows, columns).transposed()):
        H = operator.dense()
        X, Z = rng.standard_normal((H.shape[1], 2)), rng.standard_normal((H.shape[0], 2))
        assert relative(operator.times(X), H @ X) < 100 * EPS
        assert relative(operator.transposed_times(Z), H.T @ Z) < 100 * EPS
        # the recursion adds one term of rounding a block
        assert relative(operator.gram(), H.T @ H) < 100 * EPS
        np.testing.assert_array_equal(np.vstack(list(operator.row_chunks(5))), H)


def test_sums_are_warned_of_and_selections_are_not(response):
    summed = hankel(response, block_rows=4, block_columns=6, row_compression=row_sums([[0, 2], [1]], 3))
    chosen = hankel(response, block_rows=4, block_columns=6, row_compression=row_selection([0, 1], 3))
    assert "antisymmetric" in summed.warnings[0]
    assert chosen.warnings == ()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"row_shifts": [0, 2, 4]}, "row_shifts needs shifts without a common factor.*multiples of 2.*A\\^2"),
        ({"column_shifts": [0, 3, 6, 9]}, "column_shifts needs shifts without a common factor"),
        ({"row_shifts": [1, 2, 3]}, "0 among them"),
        ({"row_shifts": [0, 2, 2]}, "each shift once"),
        ({"row_shifts": [0, 1.5]}, "row_shifts"),
        ({"block_rows": 30, "block_columns": 11}, "reads samples 0 to 40, but the response has 40"),
        ({"row_shifts": [0, 1, 38]}, "Lower the sum of the last shifts"),
        ({"block_rows": 0}, "block_rows"),
        ({"row_subsets": [[0, 1]] * 4}, "row_subsets needs all 3 outputs in the first block"),
        ({"row_subsets": [[0, 1, 2]] * 3}, "row_subsets needs 4 sets"),
        ({"row_subsets": [[0, 1, 2], [3], [0], [0]]}, "index outside"),
        ({"row_subsets": [[0, 1, 2], [1, 1], [0], [0]]}, "once per block"),
        ({"row_weights": [1, 0, 1]}, "row_weights needs positive weights"),
        ({"column_weights": [1, 1, 1]}, "column_weights needs 2 or 10 entries"),
        ({"row_compression": np.ones((2, 5))}, "row_compression needs 3 columns"),
        ({"row_compression": np.zeros((1, 3))}, "one is zero"),
        ({"row_shifts": [0, 1], "block_rows": 3}, "row_shifts has 2 entries"),
    ],
)
def test_conditions_have_their_own_words(response, options, words):
    sizes = {"block_rows": 4, "block_columns": 5}
    for side in ("row", "column"):
        if f"{side}_shifts" in options:
            sizes.pop(f"block_{side}s")
    with pytest.raises(DataError, match=f"(?s){words}"):
        hankel(response, **{**sizes, **options})


def test_shifts_with_a_common_factor_do_lose_rank():
    """Why it is an error: of two modes whose poles A^2 takes to one place, even shifts see only one."""
    z = 0.95 * np.exp(0.6j)
    poles = np.array([z, -z])
    values = 2 * np.real(poles[:, None] ** np.arange(20)).sum(axis=0)[:, None, None]
    full = hankel(ImpulseResponse(values=values, sampling_rate=1.0), block_rows=8, block_columns=8).shifted(0).dense()
    assert np.linalg.matrix_rank(full, tol=1e-10) == 4
    assert np.linalg.matrix_rank(full[::2], tol=1e-10) == 2


def test_shifts_in_any_order_are_those_in_order_with_their_own_subsets_weights_and_compression():
    """Eq. 20 has arbitrary s_j and t_i: rows change places, and what belongs to them."""
    response = add_noise(FIVE["chain5"]().impulse_response(60), 20.0)
    given = [4, 0, 7, 1, 2, 5, 3]
    order = np.argsort(given)
    subsets = [[0, 1], [0, 1, 2, 3], [1, 3], [0, 1, 2, 3], [2, 3], [0, 1, 2], [3]]
    ends = np.cumsum([0, *map(len, subsets)])
    rows = np.concatenate([np.arange(ends[k], ends[k + 1]) for k in order])
    rng = np.random.default_rng(0)
    weights, T = rng.uniform(0.5, 2, rows.size), rng.standard_normal((10, rows.size))
    common = {"column_shifts": [0, 1, 3, 4, 6, 9, 10]}
    turned = hankel(response, row_shifts=given, row_subsets=subsets, row_weights=weights, row_compression=T, **common)
    straight = hankel(
        response,
        row_shifts=sorted(given),
        row_subsets=[subsets[k] for k in order],
        row_weights=weights[rows],
        row_compression=T[:, rows],
        **common,
    )
    for k in (0, 1):
        np.testing.assert_array_equal(turned.shifted(k).dense(), straight.shifted(k).dense())
    columns = {"row_shifts": sorted(given), "column_shifts": [3, 0, 4, 1, 10, 9, 6]}
    plain = {"row_shifts": sorted(given), **common}
    ours, theirs = (
        np.sort_complex(identify(response, method="era", order=10, **which).poles) for which in (columns, plain)
    )
    assert relative(ours, theirs) < 1e-9
