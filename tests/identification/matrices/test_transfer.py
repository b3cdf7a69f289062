"""Block matrices of transfer functions: derivatives, initial terms, elimination, chosen block rows, weights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope import DataError, FrequencyResponse, identify, refine
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.line_columns import line_weights
from modalscope.identification.matrices.transfer import transfer
from modalscope.numerics.functions.poles import poles_from
from modalscope.numerics.functions.polynomials import evaluate, orthogonal_basis, plane_of, remainders
from tests.support import EPS, FIVE, add_noise, match_poles, model_transfer, random_system, relative

#: Rounding of a few hundred additions and products.
ROUNDING = 1e-12


def lines_of(name: str, quantity: str = "displacement", count: int = 120) -> FrequencyResponse:
    return FIVE[name]().frequency_response(np.linspace(0.4, 7, count), quantity=quantity)


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("shift", [0, 1, 2, 4])
def test_derivatives_are_the_powers_without_their_initial_terms(sampled: bool, shift: int) -> None:
    """Eqs. 75 and 81 by a second route: x^i H - sum_(k < i) C A^k B x^(i-1-k)."""
    ss = random_system(np.random.default_rng(3), outputs=3, inputs=2, modes=3, sampled=sampled)
    f = np.linspace(0.05, 0.45, 40)
    x = (np.exp(2j * np.pi * f) if sampled else 2j * np.pi * f)[:, None, None]
    expected = x**shift * ss.frequency_response(f).values
    for k in range(shift):
        expected = expected - ss.C @ np.linalg.matrix_power(ss.A, k) @ ss.B * x ** (shift - 1 - k)
    assert relative(model_transfer(ss, f, shift), expected) < 1e-10


def test_quantities_turn_into_each_other_without_touching_the_data() -> None:
    s = FIVE["chain5"]()
    f = np.linspace(0.5, 6, 50)
    a = s.frequency_response(f, quantity="acceleration")
    before = a.values.copy()
    v = a.as_quantity("velocity")
    assert relative(v.values, s.frequency_response(f, quantity="velocity").values) < ROUNDING
    assert relative(v.as_quantity("displacement").values, s.frequency_response(f).values) < ROUNDING
    assert np.array_equal(a.values, before)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_the_basis_is_orthonormal_and_obeys_its_recurrence(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = 1j * np.sort(rng.uniform(0.3, 1, 60))
    w = rng.uniform(0.5, 2, 60)
    p, h = orthogonal_basis(x, 20, w)
    stacked = np.vstack([(w[:, None] * p).real, (w[:, None] * p).imag])
    assert np.abs(stacked.T @ stacked - np.eye(21)).max() < 100 * EPS
    assert relative(x[:, None] * p[:, :-1], p @ h) < 1e-13
    assert relative(evaluate(h, p[0, 0].real, x), p.T) < 1e-9  # without reorthogonalization the recurrence loses digits


def test_remainders_are_the_polynomial_parts_of_quotients() -> None:
    """Against coefficients, at a degree where those still have digits."""
    x = 1j * np.linspace(0.2, 1, 30)
    p, h = orthogonal_basis(x, 4)
    coefficients = np.linalg.lstsq(x[:, None] ** np.arange(5), p, rcond=None)[0]
    found = remainders(h, p[0, 0].real, x, 3)
    for i in range(3):
        cut = coefficients[i:]
        assert relative(found[i], x[:, None] ** np.arange(5 - i) @ cut) < 1e-9


@pytest.mark.parametrize("domain", ["s", "z"])
def test_with_all_initial_values_the_rows_are_the_observability_rows_times_the_states(domain: str) -> None:
    """p_k(x) H without known terms is C p_k(A) X, nothing eliminated."""
    rng = np.random.default_rng(8)
    sampled = domain == "z"
    ss = random_system(rng, outputs=2, inputs=2, modes=2, direct=True, sampled=sampled)
    f = np.linspace(0.05, 0.4, 50)
    frf = ss.frequency_response(f)
    q = 3
    terms = np.stack([ss.D, *(ss.C @ np.linalg.matrix_power(ss.A, k) @ ss.B for k in range(q))])
    matrix = transfer(frf, domain=domain, block_rows=q, initial_values=terms, equal_outputs=False)
    assert matrix.eliminated.shape[1] == 0
    plane = plane_of(domain, frf.span[1], frf.sampling_rate)
    scale = plane.scale
    assert scale is not None
    x, A = plane.point(f), ss.A / scale
    X = np.linalg.solve(x[:, None, None] * np.eye(ss.order) - A, ss.B / scale)
    values, vectors = np.linalg.eig(A)
    p = evaluate(matrix.recurrence, matrix.first_value, values)
    for i in range(2):
        blocks = [ss.C @ (vectors * p[k] @ np.linalg.inv(vectors)) @ X[:, :, i].T for k in range(q + 1)]
        expected = np.hstack([np.vstack(blocks).real, np.vstack(blocks).imag]).T
        assert relative(matrix.columns_array(i), expected) < 1e-10


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_known_initial_values_find_the_same_poles(quantity: str) -> None:
    s = FIVE["heavy4"]()
    frf = lines_of("heavy4", quantity)
    found = identify(frf, method="era", domain="s", order=8, initial_values="rest", block_rows=10)
    assert match_poles(found.modes.poles, s.modes().poles).damping_error < 1e-9


def test_known_initial_values_steady_heavy_damping_in_noise() -> None:
    """The recipes measured up to a factor of 20; two known terms of a displacement already halve the median error."""
    s = FIVE["heavy4"]()
    errors: dict[object, list[float]] = {None: [], "rest": []}
    for seed in range(12):
        noisy = add_noise(lines_of("heavy4", count=160), 40, seed)
        for known, kept in errors.items():
            r = identify(noisy, method="era", domain="s", order=8, block_rows=10, initial_values=known)
            kept.append(match_poles(r.modes.poles, s.modes().poles).frequency_error)
    assert np.median(errors["rest"]) < 0.6 * np.median(errors[None])


def test_the_triangle_stands_for_the_whole_matrix() -> None:
    matrix = transfer(add_noise(lines_of("chain5")), domain="s", block_rows=8)
    whole = np.vstack([matrix.columns_array(i) for i in range(matrix.inputs)])
    assert relative(matrix.triangle @ matrix.triangle.T, whole.T @ whole) < ROUNDING
    assert np.abs(matrix.eliminated.T @ matrix.columns_array(0)).max() < 1e-13 * np.abs(whole).max()


@pytest.mark.parametrize("method", ["era", "least_squares"])
@pytest.mark.parametrize("domain", ["s", "z"])
def test_any_block_rows_serve_the_methods_that_need_no_row_shift(method: str, domain: str) -> None:
    s = FIVE["ring5"]()
    found = identify(lines_of("ring5"), method=method, domain=domain, order=10, row_shifts=[5, 0, 6, 2])
    assert match_poles(found.modes.poles, s.modes().poles).damping_error < 1e-8
    assert found.settings["block_rows"] == 7


@pytest.mark.parametrize("method", ["alternate", "polyreference"])
def test_chosen_block_rows_are_refused_where_rows_must_follow_each_other(method: str) -> None:
    with pytest.raises(DataError, match=r"only block rows 0, 2, 5 are kept"):
        identify(lines_of("chain5"), method=method, domain="s", order=10, row_shifts=[0, 2, 5])


def test_plain_powers_work_without_noise_and_are_worse_in_it() -> None:
    """The orthogonal basis is the default for a reason: powers lose more than a factor of ten (recipes, section 4)."""
    s = FIVE["chain5"]()
    frf = lines_of("chain5", "acceleration", 160)
    clean = identify(frf, method="era", domain="s", order=10, block_rows=6, basis="powers")
    assert match_poles(clean.modes.poles, s.modes().poles).damping_error < 1e-8
    noisy = add_noise(frf, 40, 1)
    worst = {
        basis: match_poles(
            identify(noisy, method="era", domain="s", order=10, block_rows=10, basis=basis).modes.poles, s.modes().poles
        ).frequency_error
        for basis in ("powers", "orthogonal")
    }
    assert worst["powers"] > 10 * worst["orthogonal"]


def test_weights_take_a_bad_stretch_of_lines_out() -> None:
    s = FIVE["chain5"]()
    frf = lines_of("chain5", count=200)
    rng = np.random.default_rng(0)
    sigma = np.full(200, 1e-4) * np.abs(frf.values).mean()
    sigma[90:110] = 0.3 * np.abs(frf.values).mean()
    noise = sigma[:, None, None] * (rng.standard_normal(frf.values.shape) + 1j * rng.standard_normal(frf.values.shape))
    bad = FrequencyResponse(
        values=frf.values + noise,
        frequencies=frf.frequencies,
        quantity="displacement",
        variance=np.broadcast_to(2 * sigma[:, None, None] ** 2, frf.values.shape),
    )
    error = {
        weights: match_poles(
            identify(bad, method="alternate", order=10, weights=weights).modes.poles, s.modes().poles
        ).frequency_error
        for weights in (None, "variance")
    }
    # the noise of the bad lines is 3000 times that of the others; a tenth of its effect is a modest thing to ask
    assert error["variance"] < 0.1 * error[None]


def test_weights_of_coherence_follow_the_variance_of_an_estimate() -> None:
    frf = lines_of("chain5")
    g2 = np.linspace(0.5, 0.99, frf.lines)[:, None] * np.ones((1, 4))
    measured = FrequencyResponse(values=frf.values, frequencies=frf.frequencies, coherence=g2)
    w = line_weights(measured, "coherence")
    assert w is not None
    variance = np.mean(np.abs(frf.values) ** 2, axis=(1, 2)) * (1 - g2[:, 0]) / g2[:, 0]
    # no line weighs more than a thousand times another
    assert np.allclose(w, np.minimum(np.sqrt(variance.max() / variance), 1e3), rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"initial_values": np.zeros((1, 3, 2))}, r"needs shape \(terms, 4, 2\)"),
        ({"initial_values": "nothing"}, r"only arrays are possible, and 'rest'"),
        ({"row_shifts": [1, 2]}, r"0 among them"),
        ({"basis": "legendre"}, r"orthogonal, powers"),
        ({"block_columns": 5}, r"columns .* are lines"),
        ({"column_weights": [1.0]}, r"columns .* are lines"),
        ({"form": "controllable"}, r"its columns are not B, AB"),
        ({"source": "samples"}, r"samples need domain='z'"),
        ({"weights": "variance"}, r"neither variance nor coherence"),
        ({"weights": np.ones(3)}, r"weights needs 120 positive entries"),
    ],
)
def test_options_that_cannot_be_met_say_why(options: dict[str, object], text: str) -> None:
    with pytest.raises(DataError, match=text):
        identify(lines_of("chain5"), method="era", domain="s", order=10, **options)


def test_initial_values_mix_under_the_bilinear_map() -> None:
    with pytest.raises(DataError, match="the bilinear map mixes"):
        identify(lines_of("chain5"), method="era", domain="z", order=10, initial_values="rest")


def test_fewer_lines_than_unknowns_are_named() -> None:
    """2 F m >= n + (q + 1) m, sharp: with one line more it works."""
    short = lines_of("chain5", count=8)
    with pytest.raises(
        DataError, match=r"needs 2 x lines x inputs >= order \+ 12 x inputs = 34\D*8 lines and 2 inputs give 32"
    ):
        identify(short, method="era", domain="s", order=10, block_rows=11)
    assert identify(lines_of("chain5", count=9), method="era", domain="s", order=10, block_rows=11).order == 10


def test_the_response_of_a_sampled_system_has_no_s_plane() -> None:
    frf = FIVE["chain5"]().state_space(dt=0.05).frequency_response(np.linspace(0.5, 9, 60))
    with pytest.raises(DataError, match="not rational in j w"):
        identify(frf, method="era", domain="s", order=10)


def test_the_output_matrix_is_the_head_of_the_left_factor() -> None:
    """H(0) Q = P d: nothing of the lines' size is needed for C, which is what the products give."""
    rng = np.random.default_rng(1)
    values = rng.standard_normal((150, 30, 2)) + 1j * rng.standard_normal((150, 30, 2))
    response = FrequencyResponse(values=values * np.linspace(1, 9, 30)[:, None], frequencies=np.linspace(20, 100, 150))
    matrix = transfer(response, domain="s", block_rows=8)
    factors = factorize(matrix.tall(), 12)
    assert matrix.products
    C = matrix.first_rows(factors.Q / np.sqrt(factors.d))
    np.testing.assert_allclose(matrix.first_of_states(factors), C, atol=1e-11 * np.abs(C).max())


def test_a_pole_where_the_polynomials_overflow_has_no_shape_and_the_others_keep_theirs() -> None:
    """120 states of data without noise: an eigenvalue lay a thousand bands off, where p_120 exceeds all numbers."""
    matrix = transfer(lines_of("chain5", count=300), domain="s", block_rows=120)
    poles = np.array([1j * 2.0, 1e4 + 1e4j])
    with np.errstate(over="ignore", invalid="ignore"):
        p = evaluate(matrix.recurrence, matrix.first_value, poles)[matrix.block_indices(matrix.block_rows)]
    assert not np.isfinite(p[-1, 1])
    shape = np.arange(1.0, 1.0 + matrix.outputs)
    blocks = p[:, None, 0] * (shape / matrix.output_scale)[:, None].T
    V = np.stack([blocks.reshape(-1), np.ones(blocks.size)], axis=1)
    found = matrix.shapes(V, poles)
    assert np.allclose(found[:, 0], shape, rtol=1e-9)
    assert not np.any(found[:, 1])


def test_states_of_data_without_noise_far_beyond_their_modes_are_refined_or_left_out() -> None:
    rng = np.random.default_rng([1, 33, 29])
    f, zeta = np.sort(10 * (1 + 10 * rng.uniform(size=60))), 0.01 * np.exp(0.5 * rng.standard_normal(60))
    s = poles_from(f, zeta)
    shapes = rng.standard_normal((2, 60)) + 1j * rng.standard_normal((2, 60))
    x = 2j * np.pi * np.linspace(0.9 * f[0], 1.1 * f[-1], 300)[:, None, None]
    R = shapes.T[:, :, None] * shapes.T[:, None, :]
    values = sum(r / (x - p) + r.conj() / (x - p.conjugate()) for r, p in zip(R, s, strict=True))
    response = FrequencyResponse(values=values, frequencies=x[:, 0, 0].imag / (2 * np.pi))
    found = identify(response, order=120).modes
    assert np.all(np.isfinite(found.shapes))
    assert refine(response, found).converged is not None
