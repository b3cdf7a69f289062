"""Standard deviations of frequencies and damping ratios: calibrated on known noise, withheld where nothing can be said."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as sla

import modalscope as ms
from modalscope.identification.deviating import Asked
from modalscope.identification.matrices.influence import Moments
from modalscope.selection.likelihood import deviations, noise as noise_module
from modalscope.selection.likelihood.covariance import deviations_of_poles, influence_on
from modalscope.selection.likelihood.deviations import deviations_of, lines_for_all, residual_variance
from modalscope.selection.likelihood.noise import Parts, Residual, Unknown, White, noise_of, typical_deviation
from modalscope.systems import chain5
from tests.selection.likelihood.cases import TRUTH, errors, lines, windowed
from tests.support import built, cut_order


def test_deviations_of_f_and_zeta_are_those_of_many_poles_drawn():
    s, rng = -2 + 30j, np.random.default_rng(0)
    covariance = np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
    drawn = s + rng.multivariate_normal([0, 0], covariance, 200_000) @ [1, 1j]
    f, zeta = deviations_of_poles(np.array([s]), covariance[None])
    # of 200 000 draws a deviation is known to .2 %; first order leaves out .1 %
    assert f[0] == pytest.approx(np.std(np.abs(drawn) / (2 * np.pi)), rel=0.01)
    assert zeta[0] == pytest.approx(np.std(-drawn.real / np.abs(drawn)), rel=0.01)


def test_moments_hold_the_covariance_of_real_and_imaginary_part():
    x = np.random.default_rng(1).standard_normal((500, 2)) @ [[1.0, 0.4], [0.0, 2.0]]
    dp = x @ [1, 1j]
    found = Moments(np.array([np.mean(np.abs(dp) ** 2)]), np.array([np.mean(dp**2)])).covariance[0]
    np.testing.assert_allclose(found, x.T @ x / 500, atol=1e-12)


def samples(seed):
    return chain5().impulse_response(400, noise=0.01, seed=seed)


def record(seed, **more):
    return chain5().simulate(at=[0, 3], samples=1000, sampling_rate=20, noise=0.01, seed=seed, **more)


OF_RECORDS = {"domain": "z", "route": "records"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made", "seeds", "row"),
    [
        *((samples, 30, {"method": method}) for method in ("era", "alternate", "polyreference", "least_squares")),
        *((partial(lines, known=known, every=3), 15, {"method": "alternate"}) for known in (True, False)),
        (partial(record, runs=1), 15, {"method": "alternate", **OF_RECORDS}),
        (partial(record, runs=2), 15, {"method": "era", **OF_RECORDS}),
        *(
            (partial(windowed, on_lines=z), 15, {"method": "era", "domain": "z" if z else "time"})
            for z in (False, True)
        ),
    ],
)
def test_errors_are_as_large_as_their_deviations(made, seeds, row):
    """40 dB, ten figures a seed: the mean square of 300 errors over deviations is 1 within 4 x sqrt(2 / 300).

    A window makes noise fade with the signal: taken as white, it is told to be 1.5 (samples) to 3 times (lines) too small.
    """
    found = [errors(made(k), 10, **row) for k in range(seeds)]
    ratio = np.array([apart / std for apart, std in found])
    assert np.mean(ratio**2) == pytest.approx(1, abs=4 * np.sqrt(2 / ratio.size))


def test_the_damping_of_a_window_is_taken_off_before_deviations_are_told(monkeypatch):
    # a pole -5 + 4j under a window exp(-2 t) is s = -3 + 4j, |s| = 5. Its real part alone is uncertain, by .1:
    # f = |s| / 2 pi changes with it by -3 / 5 / 2 pi, zeta = -Re s / |s| by -(Im s)^2 / |s|^3 = -16 / 125
    monkeypatch.setattr(deviations, "full", lambda matrix: matrix)
    monkeypatch.setattr(deviations, "influence_on_all", lambda *_: None)
    monkeypatch.setattr(deviations, "_moments", lambda *_: Moments(np.array([0.01]), np.array([0.01 + 0j])))
    matrix = SimpleNamespace(
        thinned=False, judged=SimpleNamespace(added_damping=2.0, grid=(), count=1, values=np.ones((1, 1)))
    )
    noise = SimpleNamespace(damping_is_told=lambda poles: poles == -3 + 4j)
    found = deviations_of(matrix, None, Asked(2, None, np.array([-5 + 4j]), np.zeros(1), np.array([0]), noise))[0]
    assert found.frequency[0] == pytest.approx(0.1 * 0.6 / (2 * np.pi))
    assert found.damping_ratio[0] == pytest.approx(0.1 * 16 / 125)


def test_squares_of_the_deviations_of_parts_sum_to_the_variance_of_the_mean(monkeypatch):
    # five parts of as many products: 1, 2, 3, 4, 5 have the variance 10 / 4, their mean a fifth of it
    values = np.arange(1.0, 6).reshape(5, 1, 1, 1) * np.ones((1, 3, 1, 1))
    blocks = SimpleNamespace(values=values, mean=values.mean(axis=0), pairs=np.full((5, 3), 7.0), sums=values)
    monkeypatch.setattr(noise_module, "correlation_blocks", lambda *_, **__: blocks)
    correlation = SimpleNamespace(ambient=True, count=2, values=np.ones((2, 1, 1)), input_dofs=("1",))
    parts = noise_of(correlation, SimpleNamespace(runs=1, samples=100, sampling_rate=10.0))
    assert np.sum(parts.deviations**2, axis=0) == pytest.approx(np.full((2, 1, 1), 0.5))


@pytest.mark.parametrize("on_lines", [False, True])
def test_noise_is_drawn_as_it_is_known_under_a_window(on_lines):
    data = windowed(0, on_lines, count=64)
    noise = noise_of(data).beside(np.array([[1.0, 4.0]]))
    rng = np.random.default_rng(0)
    drawn = np.stack([noise.drawn((data.count, 1, 2), rng)[:, 0] for _ in range(4000)])
    found = drawn[:, :, 1].T @ drawn[:, :, 1].conj() / len(drawn)
    if on_lines:
        known = 4 * sla.toeplitz(noise.fading, noise.fading.conj())
    else:
        known = 4 * np.diag(np.exp(-0.2 * np.arange(data.count) / 20))
        known = known / np.mean(np.diag(known)) * 4
    np.testing.assert_allclose(found, known, atol=4 * 5 / np.sqrt(4000) * known.real.max() / 4)


def test_deviations_scale_with_the_noise_and_are_not_there_when_not_asked():
    quiet, loud = (errors(chain5().impulse_response(400, noise=n, seed=0), 10)[1] for n in (1e-4, 1e-3))
    np.testing.assert_allclose(loud / quiet, 10, rtol=0.05)
    data = chain5().impulse_response(200, noise=0.01, seed=0)
    assert ms.identify(data, order=10, deviations=False).modes.frequencies_std is None
    assert ms.stabilize(data, deviations=False).frequencies_std is None


def test_a_diagram_has_them_for_every_pole_and_selected_modes_from_members_that_did_not_split():
    diagram = ms.stabilize(chain5().impulse_response(300, noise=0.01, seed=0))
    assert diagram.frequencies_std.shape == diagram.poles.shape
    assert np.all(np.isfinite(diagram.damping_ratios_std))
    modes = ms.select(diagram)
    ends = modes.interval(0.95)
    assert np.all(ends["frequency"][:, 0] < modes.frequencies)
    assert np.all(modes.frequencies_std > 0)
    assert any(note.kind == "deviations" for note in modes.notes)
    assert typical_deviation(np.array([3.0, 1.0, 1.2, np.nan, 50.0])) == pytest.approx(1.1)
    assert np.isnan(typical_deviation(np.array([np.nan])))


def test_the_source_of_the_noise_is_the_best_that_the_data_have():
    frf = lines(0, every=3)
    assert isinstance(noise_of(frf), White)
    assert isinstance(noise_of(replace(frf, variance=None)), Residual)
    seen = replace(frf, variance=None, coherence=np.full(frf.values.shape[:2], 0.9), averages=20)
    told = noise_of(seen)
    np.testing.assert_allclose(told.variance, np.abs(frf.values) ** 2 * (0.1 / 0.9) / 20)
    record = chain5().simulate(inputs="ambient", samples=5000)
    correlation = ms.estimate_correlation(record, lags=60)
    assert isinstance(noise_of(correlation, record), Parts)
    assert isinstance(noise_of(correlation), Unknown)


def test_leakage_withholds_the_damping_of_modes_narrower_than_four_lines():
    frf = lines(0, every=3)
    leaking = replace(frf, variance=None, coherence=np.full(frf.values.shape[:2], 0.99), averages=20)
    modes = ms.identify(leaking, method="alternate", order=10).modes
    narrow = 2 * modes.damping_ratios * modes.frequencies < 4 * (frf.frequencies[1] - frf.frequencies[0])
    assert np.any(narrow[np.isfinite(modes.frequencies_std)])
    assert np.all(np.isnan(modes.damping_ratios_std[narrow]))
    assert "leakage" in str(ms.identify(leaking, method="alternate", order=10).notes[-1])


def test_correlations_without_their_record_have_none_and_say_why():
    record = chain5().simulate(inputs="ambient", samples=5000)
    found = ms.identify(ms.estimate_correlation(record, lags=60), order=10)
    assert np.all(np.isnan(found.modes.frequencies_std))
    assert "no standard deviations" in str(found.notes[-1])
    short = ms.identify(record, order=10)
    assert np.any(np.isfinite(short.modes.frequencies_std))
    notes = [note for note in short.notes if note.kind == "deviations"]
    assert notes[0].numbers["degrees_of_freedom"] == notes[0].numbers["parts"] - 1


def test_student_replaces_the_normal_quantile_where_parts_are_few():
    modes = ms.ModalModel(poles=[-1 + 100j], shapes=[[1.0]], frequencies_std=[0.1])
    few = modes.noted(ms.Note("deviations", {"degrees_of_freedom": 19}, "from 20 parts"))
    half = few.interval(0.95)["frequency"][0, 1] - few.frequencies[0]
    assert half == pytest.approx(0.2093, abs=1e-4)


def test_the_residual_gives_the_variance_of_the_noise():
    rng = np.random.default_rng(0)
    left = np.sum((rng.standard_normal((4000, 2, 1)) * [[2.0], [0.5]]) ** 2, axis=0)
    np.testing.assert_allclose(residual_variance(left, 4000, False), [[4.0], [0.25]], rtol=0.1)
    np.testing.assert_allclose(residual_variance(left, 2000, True), 4 * residual_variance(left, 4000, False))
    assert np.all(np.isnan(residual_variance(left, 0, False)))


def test_lines_far_from_all_poles_stand_for_their_neighbours_and_together_for_all():
    frf = lines(0)
    poles = TRUTH.poles
    kept = lines_for_all(frf, poles, 20)
    assert kept.each.sum() == frf.count
    assert len(kept.used) < 0.7 * frf.count
    grid = frf.frequencies
    near = np.min(np.abs(2j * np.pi * grid[:, None] - poles), axis=1) / (2 * np.pi)
    assert np.all(np.isin(np.flatnonzero(near < 3 * 2 * 0.01), kept.used))  # a third of it spans less than two lines
    assert np.all(lines_for_all(frf, poles, 80).each == 1)  # a polynomial of degree 80 turns within 8 lines
    assert lines_for_all(windowed(0), poles, 20) is None
    assert lines_for_all(windowed(0, False), poles, 20) is None


def test_deviations_by_some_lines_are_those_by_all():
    pipeline = built(lines(0), 10, method="alternate", block_rows=20)
    cut = cut_order(pipeline, 10)
    found = [
        influence_on(pipeline.matrix, pipeline.realization, 10, cut.triple, cut.modal.eigen, kept)
        for kept in (None, lines_for_all(pipeline.response, cut.modal.poles, 20))
    ]
    variance = np.ones(pipeline.response.values.shape[1:])
    whole, part = (f.joint(f, variance).size for f in found)
    np.testing.assert_allclose(part, whole, rtol=0.05)  # of variances: 2.5 % of deviations


def test_half_spectra_have_no_deviations_until_their_record_is_refined() -> None:
    # taken as white they were .13 Hz of .91 Hz, where the scatter of six records is .004 Hz
    record = chain5().simulate(inputs="ambient", duration=300, sampling_rate=20.0, seed=1)
    found = ms.identify(record, method="lscf", order=12, deviations=True)
    assert np.all(np.isnan(found.modes.frequencies_std))
    assert "half spectra" in " ".join(str(note) for note in found.notes)
    spectra = ms.preprocess.half_spectra(ms.estimate_correlation(record, lags=200))
    assert isinstance(noise_of(spectra), Unknown)
    known = chain5().modes()
    refined = ms.refine(record, ms.ModalModel(poles=known.poles, shapes=known.shapes, output_dofs=record.output_dofs))
    away = np.abs(refined.frequencies - known.frequencies) / refined.frequencies_std
    assert away.max() < 4
