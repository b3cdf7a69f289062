"""The two routes to the factors: accuracy by the ratio of singular values, memory, and what each says of itself."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from modalscope.data import DataError, ImpulseResponse
from modalscope.identification.fast import block_hankel, factorizations as costs
from modalscope.identification.fast.block_hankel import BlockHankel
from modalscope.identification.fast.factorizations import costs_of
from modalscope.identification.matrices.factor import factorize, left_factor
from modalscope.identification.matrices.hankel import hankel
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.order import complete_spectrum, recommend_order
from modalscope.numerics.functions.poles import frequencies_and_damping, poles_from
from modalscope.numerics.operators import DenseMatrix
from modalscope.numerics.resources import set_allowed_memory
from tests.support import add_noise, match_poles, relative


def response_of(
    weak: float, outputs: int = 12, inputs: int = 2, samples: int = 500
) -> tuple[ImpulseResponse, np.ndarray]:
    """Four modes, the third `weak` times as strong as the others."""
    rng = np.random.default_rng(3)
    s = poles_from([0.05, 0.11, 0.2, 0.3], [0.01, 0.01, 0.02, 0.01])
    C, B = rng.standard_normal((outputs, 4)), rng.standard_normal((4, inputs))
    B[2] *= weak
    values = 2 * np.einsum("lj,kj,jm->klm", C, np.exp(s * np.arange(samples)[:, None]), B).real
    return ImpulseResponse(values=values, sampling_rate=1.0, kind="dirac"), s


@pytest.mark.parametrize(
    ("weak", "frequency", "damping"),
    # the table of measured accuracies with a factor of thirty for other data: the Gram matrix alone 2e-12 / 1e-9,
    # the pass 2e-15 / 4e-13 at 6e-4, 2e-15 / 1e-12 at 1e-4, 6e-12 / 4e-10 at 2e-7 and 6e-10 / 5e-8 at 2.5e-9
    [(1e-2, 3e-11, 3e-8), (1e-4, 1e-12, 1e-10), (1e-6, 2e-10, 1e-8), (1e-8, 2e-8, 1.5e-6)],
)
def test_refinement_brings_the_structured_route_to_the_dense_one(weak, frequency, damping):
    response, s = response_of(weak)
    H = hankel(response, block_rows=200, block_columns=200)
    fast = factorize(H.shifted(0), 8, "gram")
    assert ("refinement" in fast.how) == (weak < 1e-3)
    z = np.linalg.eigvals(balanced(H, fast).triple(8).A)
    found = match_poles(np.log(z), s)
    assert found.frequency_error < frequency
    assert found.damping_error < damping


def test_the_gram_matrix_alone_serves_noisy_data_and_says_so():
    response, _ = response_of(1.0)
    H = hankel(add_noise(response, 40), block_rows=100, block_columns=200)
    fast, dense = (factorize(H.shifted(0), 8, route) for route in ("gram", "dense"))
    assert fast.how == "structured Gram matrix of 1200 x 400"
    assert relative(fast.d, dense.d) < 1e-12
    K, L = (balanced(H, f).triple(8).A for f in (fast, dense))
    a, b = (np.sort_complex(np.linalg.eigvals(M)) for M in (K, L))
    assert np.max(np.abs(a - b)) < 1e-10
    # what the route did not carry is there when asked: the smallest values, down to sqrt(eps)
    assert relative(complete_spectrum(fast), dense.spectrum) < 1e-8


def test_factors_of_wide_matrices_are_those_of_the_tall_ones():
    response, _ = response_of(0.3, outputs=2, inputs=7)
    H = hankel(response, block_rows=30, block_columns=120).shifted(0)
    f = factorize(H, 8)
    assert f.P.shape == (60, 8)
    assert f.Q.shape == (840, 8)
    assert relative((f.P * f.d) @ f.Q.T, H.dense()) < 1e-9


@pytest.mark.parametrize("noise", [None, 40.0])
def test_left_factor_by_chunks_or_gram_is_that_of_the_dense_matrix(noise):
    response, _ = response_of(1.0, outputs=2, inputs=20)
    H = hankel(response if noise is None else add_noise(response, noise), block_rows=24, block_columns=300).shifted(0)
    f = left_factor(H)
    assert f.how.startswith("triangular" if noise is None else "structured")
    assert f.Q.shape == (6000, 0)
    full = H.dense()
    # (P d)(P d)' = H H', whatever orthonormal Q stands beside
    assert relative((f.P * f.d**2) @ f.P.T, full @ full.T) < 1e-12


def test_the_matrix_is_never_formed():
    """60 x 200 outputs by 2 x 200 inputs would take 38 MB; the fast route stays below a quarter of it."""
    response, _ = response_of(1.0, outputs=60)
    H = hankel(add_noise(response, 40), block_rows=200, block_columns=200)
    tracemalloc.start()
    factorize(H.shifted(0), 8)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.25 * 8 * 60 * 200 * 2 * 200


def test_rank_is_what_stands_above_rounding():
    response, s = response_of(1e-7)
    f = factorize(hankel(response, block_rows=40, block_columns=60).shifted(0))
    assert f.rank == 2 * s.size
    assert frequencies_and_damping(s)[0].size == 4
    with pytest.raises(DataError, match="order=9: the data matrix has rank 8"):
        f.check_order(9)


def test_bad_routes_and_zero_matrices_are_errors():
    with pytest.raises(DataError, match="no structure that gives its Gram matrix"):
        factorize(DenseMatrix(np.ones((700, 500))), 3, "gram")
    with pytest.raises(DataError, match="factorization"):
        factorize(DenseMatrix(np.eye(3)), 3, "power")
    with pytest.raises(DataError, match="all values are zero"):
        factorize(DenseMatrix(np.zeros((3, 3))))


@pytest.mark.parametrize(("outputs", "inputs", "blocks"), [(3, 40, 60), (40, 3, 60), (2, 2, 5), (1, 1, 300)])
def test_products_by_transforms_are_those_by_block_rows(
    outputs: int, inputs: int, blocks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(0)
    H = BlockHankel(rng.standard_normal((3 * blocks, outputs, inputs)), blocks, 2 * blocks - 1, first=1)
    X, Z = rng.standard_normal((H.shape[1], 7)), rng.standard_normal((H.shape[0], 7))
    monkeypatch.setattr(block_hankel, "_BLOCK_NUMBERS", 5000)
    for slower in (0, 1e9):
        monkeypatch.setattr(block_hankel, "_TRANSFORM_COST", slower)
        assert H.by_transforms == (slower == 0)
        assert relative(H.times(X), H.dense() @ X) < 1e-12
        assert relative(H.transposed_times(Z), H.dense().T @ Z) < 1e-12


@pytest.mark.parametrize("route", ["randomized", "lanczos", "gram"])
@pytest.mark.parametrize(("weak", "noise"), [(1.0, 40.0), (1.0, None), (1e-7, None)])
def test_every_route_gives_the_poles_of_the_dense_one(route: str, weak: float, noise: float | None) -> None:
    """To 1e-8; a mode at 1e-7 of the others keeps the digits that its share leaves."""
    response, s = response_of(weak, outputs=6, inputs=5, samples=260)
    H = hankel(response if noise is None else add_noise(response, noise), block_rows=100, block_columns=120)
    found = [balanced(H, factorize(H.shifted(0), 8, way)).triple(8).A for way in (route, "dense")]
    ours, theirs = (np.log(np.linalg.eigvals(A)) for A in found)
    assert match_poles(ours, theirs[theirs.imag > 0]).frequency_error < 1e-8
    if noise is None:
        assert match_poles(ours, s).frequency_error < 1e-8


def test_where_the_gram_matrix_takes_long_products_serve_and_what_does_not_fit_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    response, _ = response_of(1.0, outputs=10, inputs=10, samples=240)
    H = hankel(add_noise(response, 40), block_rows=100, block_columns=120)
    assert factorize(H.shifted(0), 8).how.startswith("structured Gram matrix of 1200 x 1000")
    monkeypatch.setattr(costs, "_EXACT_OPERATIONS", 1e8)
    assert factorize(H.shifted(0), 8).how.startswith("randomized range of")
    try:
        set_allowed_memory(1_000_000)
        with pytest.raises(DataError, match=r"8 singular vectors of a matrix of 1200 x 1000: it takes about 1 MB"):
            factorize(H.shifted(0), 8)
    finally:
        set_allowed_memory(None)


def test_the_bulk_that_a_range_did_not_carry_has_its_energy_and_its_median() -> None:
    """So that an order can be recommended: the median decides the threshold, and need not be better than a tenth."""
    response, _ = response_of(1.0, outputs=10, inputs=10, samples=240)
    H = hankel(add_noise(response, 40), block_rows=100, block_columns=120).shifted(0)
    fast, dense = (factorize(H, 8, route) for route in ("randomized", "dense"))
    assert np.isclose(H.energy, np.sum(dense.spectrum**2))
    assert complete_spectrum(fast).size == dense.spectrum.size
    assert np.isclose(np.median(complete_spectrum(fast)), np.median(dense.spectrum), rtol=0.1)
    assert recommend_order(fast).order == recommend_order(dense).order == 8


def test_costs_name_every_way_the_cheapest_first() -> None:
    H = BlockHankel(np.ones((400, 20, 20)), 200, 200)
    found = costs_of(H, 60)
    assert [cost.route for cost in found] == ["randomized", "gram", "dense"]
    assert found[0].operations < found[-1].operations / 20
    assert found[0].memory < found[-1].memory / 20
    assert [cost.route for cost in costs_of(DenseMatrix(np.ones((600, 500))), 60)] == ["dense", "randomized"]
    assert [cost.route for cost in costs_of(DenseMatrix(np.ones((3000, 2000))), 60)] == ["randomized", "dense"]


def test_an_order_beyond_what_was_factored_is_not_told_as_rank() -> None:
    noise = DenseMatrix(np.random.default_rng(4).standard_normal((60, 50)))
    few, all_ = factorize(noise, 10), factorize(noise, 50)
    with pytest.raises(
        DataError, match=r"(?s)order=14: 10 singular vectors were computed.*factor for the largest order"
    ):
        few.check_order(14)
    with pytest.raises(DataError, match="order=51: the data matrix has rank 50"):
        all_.check_order(51)
