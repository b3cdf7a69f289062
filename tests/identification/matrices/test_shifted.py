"""Shifted transfer functions of samples: recursion, finite windows, bands, periodised grids; identities with the time domain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope import DataError, ImpulseResponse, identify
from modalscope.analysis.comparing.identities import projected_general
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.hankel import hankel
from modalscope.identification.matrices.shifted import shifted, shifted_transfer, window_lines
from modalscope.identification.matrices.transfer import transfer
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.regression import regression
from modalscope.identification.realizations.shift import shift
from tests.support import FIVE, add_noise, match_poles, random_system, relative

#: The identities hold to rounding times the condition of the truncation, with noise too.
IDENTITY = 1e-9

seeds = st.integers(0, 2**32 - 1)


def apart(A: np.ndarray, B: np.ndarray) -> float:
    """How far the eigenvalues of two matrices are apart, each from the nearest of the other."""
    gaps = np.abs(np.linalg.eigvals(A)[:, None] - np.linalg.eigvals(B)) / np.abs(np.linalg.eigvals(B))
    return float(max(gaps.min(axis=0).max(), gaps.min(axis=1).max()))


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_recursion_and_definition_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((60, 2, 3))
    z = np.exp(2j * np.pi * rng.uniform(0, 0.5, 9))
    definition = [np.tensordot(z[:, None] ** -np.arange(48), values[t : t + 48], axes=1) for t in range(12)]
    assert relative(shifted_transfer(values, z, 48, range(12)), np.stack(definition)) < 1e-12


def test_the_finite_window_is_exact() -> None:
    """Y_t = C A^t (I - A^K z^-K) (I - A / z)^-1 B for an undamped record that has not decayed at all."""
    ss = random_system(np.random.default_rng(2), outputs=2, inputs=1, modes=3, damping=(1e-9, 2e-9))
    values = ss.markov_parameters(80)
    z = np.exp(2j * np.pi * np.array([0.03, 0.11, 0.4]))
    found = shifted_transfer(values, z, 64, [5])[0]
    A5, A64 = (np.linalg.matrix_power(ss.A, k) for k in (5, 64))
    one = np.eye(ss.order)
    for x, y in zip(z, found, strict=True):
        expected = ss.C @ A5 @ (one - A64 / x**64) @ np.linalg.solve(one - ss.A / x, ss.B)
        assert relative(y, expected) < 1e-10


@pytest.mark.parametrize("window", [60, 61])
@given(seeds)
@settings(max_examples=10, deadline=None)
def test_on_all_lines_of_the_window_the_method_is_era_in_the_time_domain(window: int, seed: int) -> None:
    """I4, with noise: H_g(k) = H(k) F with F orthogonal when inner lines weigh sqrt 2, for even and odd windows."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, outputs=3, inputs=2, modes=3)
    noisy = add_noise(ss.impulse_response(100), rng=rng)
    lines, time = (
        shifted(noisy, block_rows=12, block_columns=window),
        hankel(noisy, block_rows=12, block_columns=window),
    )
    fd, td = factorize(lines.shifted(0), 6), factorize(time.shifted(0), 6)
    assert relative(fd.d, td.d) < 1e-12
    assert (
        relative(
            lines.shifted(1).dense() @ lines.shifted(0).dense().T, time.shifted(1).dense() @ time.shifted(0).dense().T
        )
        < 1e-12
    )
    assert apart(balanced(lines, fd).triple(6).A, balanced(time, td).triple(6).A) < IDENTITY


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_one_sided_complex_lines_of_a_whole_grid_are_era_too(seed: int) -> None:
    """I4 with all K complex DFT lines instead of half of them in real columns."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, outputs=2, inputs=2, modes=2)
    values = add_noise(ss.impulse_response(64), rng=rng).values
    window, q, n = 50, 8, 4
    z = np.exp(2j * np.pi * np.arange(window) / window)
    Y = shifted_transfer(values, z, window, range(q + 1))
    H = [Y[k : k + q].transpose(0, 2, 1, 3).reshape(q * 2, -1) for k in (0, 1)]
    P, d, Qh = np.linalg.svd(H[0], full_matrices=False)
    A = (P[:, :n].conj().T @ H[1] @ Qh[:n].conj().T) / np.sqrt(np.outer(d[:n], d[:n]))
    noisy = ImpulseResponse(values=values, sampling_rate=1.0)
    time = hankel(noisy, block_rows=q, block_columns=window)
    expected = balanced(time, factorize(time.shifted(0), n)).triple(n).A
    assert apart(A, expected) < IDENTITY
    assert relative(d[:n], np.sqrt(window) * factorize(time.shifted(0), n).d) < 1e-12


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_real_columns_are_the_lines_at_both_signs(seed: int) -> None:
    """I5: [Re Im] has the singular values over sqrt 2, and the poles, of complex columns at +w and -w."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, outputs=3, inputs=2, modes=2, sampled=False)
    noisy = add_noise(ss.frequency_response(np.linspace(0.03, 0.45, 70)), rng=rng)
    matrix = transfer(noisy, domain="s", block_rows=6)
    real = np.hstack([matrix.columns_array(i).T for i in range(2)])
    half = real.shape[1] // 4
    parts = real.reshape(real.shape[0], 2, 2, half)
    both = np.concatenate([parts[:, :, 0] + 1j * parts[:, :, 1], parts[:, :, 0] - 1j * parts[:, :, 1]], axis=2)
    H0, H1 = (
        matrix.full_shift.split(both.reshape(real.shape[0], -1).real),
        matrix.full_shift.split(both.reshape(real.shape[0], -1).imag),
    )
    complex_0, complex_1 = H0[0] + 1j * H1[0], H0[1] + 1j * H1[1]
    P, d, Qh = np.linalg.svd(complex_0, full_matrices=False)
    n = 4
    A = (P[:, :n].conj().T @ complex_1 @ Qh[:n].conj().T) / np.sqrt(np.outer(d[:n], d[:n]))
    factors = factorize(matrix.shifted(0), n)
    assert relative(d[:n], np.sqrt(2) * factors.d) < 1e-12
    assert apart(A, balanced(matrix, factors).triple(n).A) < IDENTITY


@given(seeds, st.sampled_from(["s", "z"]))
@settings(max_examples=15, deadline=None)
def test_regression_on_lines_is_era_on_lines(seed: int, domain: str) -> None:
    """I12, with noise."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, outputs=3, inputs=2, modes=3, sampled=False)
    matrix = transfer(
        add_noise(ss.frequency_response(np.linspace(0.03, 0.45, 90)), rng=rng), domain=domain, block_rows=8
    )
    factors = factorize(matrix.shifted(0), 6)
    pair = [method(matrix, factors).triple(6).A for method in (regression, balanced)]
    assert apart(*pair) < IDENTITY


@given(seeds, st.sampled_from(["s", "z", "samples"]))
@settings(max_examples=15, deadline=None)
def test_the_alternate_method_on_lines_is_the_generalised_balanced_form(seed: int, domain: str) -> None:
    """(110) and (57) against (28) with the factors (E0 P d^1/2, d^1/2 Q'), and against the matrix inversion lemma, with noise."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, outputs=3, inputs=2, modes=3, sampled=domain == "samples")
    if domain == "samples":
        matrix = shifted(add_noise(ss.impulse_response(100), rng=rng), block_rows=8)
    else:
        matrix = transfer(
            add_noise(ss.frequency_response(np.linspace(0.03, 0.45, 90)), rng=rng), domain=domain, block_rows=8
        )
    n = 6
    factors = factorize(matrix.tall(), n)
    P, d, Q = factors.P[:, :n], factors.d[:n], factors.Q[:, :n]
    before, after = matrix.row_shift.split(P)
    first = np.arange(3)
    general = projected_general(before, d, Q, after * d @ Q.T, first, first)
    found = shift(matrix, factors).triple(n).A
    assert relative(found, general.A) < IDENTITY
    p = P[-3:]
    lemma = (np.eye(n) + p.T @ np.linalg.solve(np.eye(3) - p @ p.T, p)) @ before.T @ after
    root = np.sqrt(d)
    assert relative(found, lemma * root / root[:, None]) < IDENTITY


@pytest.mark.parametrize("method", ["era", "polyreference", "alternate", "least_squares"])
@pytest.mark.parametrize("name", FIVE)
def test_a_band_of_a_record_that_has_not_decayed_is_exact(name: str, method: str) -> None:
    """Lines from 1 to 3 Hz of 200 samples: no leakage, whatever follows; the modes above still leave their exact mark."""
    s = FIVE[name]()
    found = identify(
        s.impulse_response(200), method=method, domain="z", order=2 * s.degrees, band=(1, 3), block_rows=12
    )
    assert match_poles(found.modes.poles, s.modes().poles).damping_error < 1e-9
    assert found.fit_error < 1e-9
    # the samples are an extrapolation from this band: extraneous poles of canonical forms may leave 1e-7 outside of it
    assert relative(found.rebuild().values, s.impulse_response(200).values) < 1e-6


def test_a_late_first_sample_is_referred_to_the_impulse() -> None:
    s = FIVE["chain5"]()
    whole = s.impulse_response(200)
    late = type(whole)(values=whole.values[7:], sampling_rate=whole.sampling_rate, first_sample=7)
    found = identify(late, method="era", domain="z", order=10)
    assert relative(found.rebuild().values, late.values) < 1e-9
    assert found.modes.indicators["emac"].min() > 1 - 1e-9


@pytest.mark.parametrize("length", [240, 241])
def test_a_full_grid_of_lines_is_periodised_and_exact(length: int) -> None:
    ss = FIVE["chain5"]().state_space(dt=0.05, quantity="acceleration")
    f = window_lines(length, 20.0)
    found = identify(ss.frequency_response(f), method="era", domain="z", order=10, source="samples")
    assert "periodised samples" in str(found.notes[0])
    assert match_poles(found.modes.poles, FIVE["chain5"]().modes().poles).damping_error < 1e-10
    assert found.fit_error < 1e-10
    assert found.modes.indicators["amplitude_coherence"].min() > 1 - 1e-9
    by_elimination = identify(ss.frequency_response(f), method="era", domain="z", order=10)
    assert "eliminated" in str(by_elimination.notes[0])
    assert match_poles(by_elimination.modes.poles, found.modes.poles).damping_error < 1e-9


def test_elimination_is_steadier_in_noise_than_periodised_samples() -> None:
    """Why it is the default on a full grid too."""
    s = FIVE["chain5"]()
    frf = s.state_space(dt=0.05).frequency_response(window_lines(400, 20.0))
    errors = {
        source: np.median(
            [
                match_poles(
                    identify(add_noise(frf, 40, seed), method="era", domain="z", order=10, source=source).modes.poles,
                    s.modes().poles,
                ).damping_error
                for seed in range(5)
            ]
        )
        for source in ("samples", "elimination")
    }
    assert errors["elimination"] < 0.8 * errors["samples"]


def test_every_source_says_what_it_is() -> None:
    s = FIVE["chain5"]()
    samples = identify(s.impulse_response(200), method="era", domain="z", order=10)
    assert "exact, whatever follows the last one" in str(samples.notes[0])
    lines = identify(s.frequency_response(np.linspace(0.5, 7, 90)), method="era", domain="z", order=10)
    assert "bilinear map" in str(lines.notes[0])
    assert "initial terms eliminated" in str(lines.notes[0])


def test_arbitrary_shifts_of_samples() -> None:
    s = FIVE["ring5"]()
    found = identify(s.impulse_response(200), method="era", domain="z", order=10, row_shifts=[0, 1, 3, 4, 9])
    assert match_poles(found.modes.poles, s.modes().poles).damping_error < 1e-9


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"band": (1.001, 1.002)}, r"none of them inside"),
        ({"block_columns": 500}, r"reads 510 samples"),
        ({"initial_values": "rest"}, r"have no initial terms"),
        ({"source": "elimination"}, r"the data are samples"),
        ({"column_subsets": [[0, 1]]}, r"columns .* are lines"),
    ],
)
def test_what_samples_cannot_give_is_an_error(options: dict[str, object], text: str) -> None:
    with pytest.raises(DataError, match=text):
        identify(FIVE["chain5"]().impulse_response(200), method="era", domain="z", order=10, block_rows=10, **options)
