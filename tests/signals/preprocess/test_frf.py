"""Frequency responses: exact ones of every excitation, the estimators' definitions, and their own variances."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from modalscope.data import DataError, Signals
from modalscope.signals.doctor import examine
from modalscope.signals.preprocess import estimate_frf, exponential_decay
from modalscope.signals.preprocess.excitation import find_excitation
from modalscope.signals.preprocess.impacts import between_hits, find_hits, room_of, whole_series
from modalscope.signals.preprocess.spectra import WINDOWS, Segments, cross_spectra, effective_averages, window_of
from modalscope.systems import chain5
from tests.support import random_system, relative

RATE = 20.0
#: A chain that forgets fast: 3 % and more of damping at .1 of the sampling rate decay to e^-20 in 1000 samples.
MODEL = random_system(np.random.default_rng(5), outputs=3, inputs=2, modes=3, damping=(0.03, 0.1), direct=True)


def record(u, model=MODEL, columns=None, **options):
    """Outputs of the sampled model, at rest before the first sample."""
    runs = u if u.ndim == 3 else u[None]
    columns = list(range(runs.shape[2])) if columns is None else columns
    full = np.zeros((*runs.shape[:2], 2))
    full[:, :, columns] = runs
    y = np.stack([model.simulate(run) for run in full])
    return Signals(outputs=y if u.ndim == 3 else y[0], inputs=u, sampling_rate=1.0, **options)


def truth(frf, inputs=slice(None)):
    return MODEL.frequency_response(frf.frequencies).values[:, :, inputs]


def bursts(runs, seed=0, samples=2000, active=0.4):
    u = np.random.default_rng(seed).standard_normal((runs, samples, 2))
    u[:, int(active * samples) :] = 0
    return u


@pytest.mark.parametrize("estimator", ["h1", "h2", "hv"])
def test_bursts_give_the_exact_response_to_two_correlated_inputs(estimator):
    u = bursts(4) @ np.array([[1.0, 0.8], [0.0, 0.6]])  # a coherence of .64 between the inputs
    frf = estimate_frf(record(u), estimator=estimator)
    assert "burst" in frf.processing[-1]
    assert relative(frf.values, truth(frf)) < 1e-6  # what is left of the decay at the end
    assert frf.averages == 4
    assert frf.coherence.min() > 1 - 1e-9


def test_one_run_of_one_burst_is_the_plain_ratio():
    data = record(bursts(1)[0, :, :1])
    frf = estimate_frf(data)
    ratio = np.fft.rfft(data.outputs, axis=0) / np.fft.rfft(data.inputs, axis=0)
    # the median is removed, which only 0 Hz sees
    assert relative(frf.values[1:, :, 0], ratio[1:]) < 1e-9
    assert frf.variance is None
    assert frf.coherence is None


def test_a_sweep_is_recognised_and_transformed_whole():
    t = np.arange(12000) / 100
    u = np.zeros((12000, 1))
    u[:, 0] = signal.chirp(t, 1, 120, 40)
    data = record(u)
    assert find_excitation(data) == "sweep"
    frf = estimate_frf(data)
    ratio = np.fft.rfft(data.outputs, axis=0) / np.fft.rfft(data.inputs, axis=0)
    assert frf.frequencies[0] > 0  # the mean was removed: no force at 0 Hz, and no NaN
    assert relative(frf.values[:, :, 0], ratio[1:]) < 1e-9


def test_periodic_excitation_gives_the_exact_response_without_a_window():
    rng, period = np.random.default_rng(0), 1000
    u = np.stack([np.tile(rng.standard_normal((period, 2)), (4, 1)) for _ in range(2)])
    frf = estimate_frf(record(u), excitation="periodic", settle=2)
    assert frf.frequencies[1] == pytest.approx(2 / period)  # 0 Hz is left out: no mean
    assert relative(frf.values, truth(frf)) < 1e-6  # settled to e^-40
    assert frf.averages == 4


def test_lines_between_those_of_a_multisine_are_left_out_even_with_noise():
    rng, period = np.random.default_rng(0), 500
    phases = rng.uniform(0, 2 * np.pi, 40)
    lines = 3 + 4 * np.arange(40)
    one = np.cos(2 * np.pi * np.outer(np.arange(period), lines) / period + phases).sum(axis=1)
    u = np.tile(one, 12)[:, None]
    data = record(u)
    noisy = Signals(
        outputs=data.outputs + 0.1 * rng.standard_normal(data.outputs.shape),
        inputs=u + 0.1 * rng.standard_normal(u.shape),
        sampling_rate=1.0,
    )
    frf = estimate_frf(noisy, excitation="periodic", settle=2)
    assert set(lines) <= set(np.rint(frf.frequencies * period).astype(int))
    # an empty line passes for a driven one when its mean exceeds three deviations: e^-9 of them
    assert frf.lines <= 42
    # complex normal: |error|^2 / variance has mean 1 over 120 elements, deviation 1 / sqrt(120) and a little more
    driven = np.isin(np.rint(frf.frequencies * period).astype(int), lines)
    score = np.abs(frf.values - truth(frf, slice(0, 1)))[driven] ** 2 / frf.variance[driven]
    assert 0.7 < score.mean() < 1.4


@pytest.fixture(scope="module")
def hits():
    """Six hits of a hammer in one record of 12 s, 10 % noise in the second output."""
    rng = np.random.default_rng(2)
    u = np.zeros((12000, 1))
    pulse = np.sin(np.pi * np.arange(1, 8) / 8)
    for k in range(6):
        u[300 + 1900 * k : 307 + 1900 * k, 0] = (1 + 0.2 * k) * pulse
    data = record(u)
    return Signals(
        outputs=data.outputs + 1e-4 * rng.standard_normal(data.outputs.shape),
        inputs=u + 1e-4 * rng.standard_normal(u.shape),
        sampling_rate=1.0,
    )


def test_hits_are_cut_from_one_long_record(hits):
    frf = estimate_frf(hits)
    assert "hits 1, 2, 3, 4, 5, 6;" in frf.processing[-1]
    assert frf.averages == 6
    low = frf.frequencies < 0.1  # where a pulse of seven samples has its force
    assert (
        relative(frf.values[low], truth(frf, slice(0, 1))[low]) < 1e-2
    )  # noise of 1e-4 on forces of 4 in 1900 samples


def test_exponential_and_force_windows_shift_every_pole_exactly(hits):
    """y(t) e^-at is the response of the system with poles s - a to u(t) e^-at."""
    frf = estimate_frf(hits, exponential=0.01, force_window=30.0, segment=1800)
    assert frf.added_damping == pytest.approx(np.log(100) / 1800)
    shifted = MODEL.A * np.exp(-frf.added_damping)
    z = np.exp(2j * np.pi * frf.frequencies)
    B = MODEL.B[:, :1] * np.exp(-frf.added_damping)
    expected = MODEL.D[:, :1] + MODEL.C @ np.linalg.solve(z[:, None, None] * np.eye(6) - shifted, B)
    low = frf.frequencies < 0.1
    assert relative(frf.values[low], expected[low]) < 1e-2
    assert exponential_decay(0.01, 1800) == frf.added_damping


def test_noise_of_the_force_between_hits_is_no_force(hits):
    """Of noise in 1900 samples, 7 of which are a pulse, about a hundredth is left: what lies within the pulse and its length beside it."""
    noise = 0.02 * np.random.default_rng(3).standard_normal(hits.inputs.shape)
    noisy = Signals(outputs=hits.outputs, inputs=hits.inputs + noise, sampling_rate=1.0)
    frf, whole = estimate_frf(noisy), estimate_frf(noisy, force_window=1e6)
    assert "force zero between hits" in frf.processing[-1]
    assert "force zero" not in whole.processing[-1]
    low = frf.frequencies < 0.1
    error, before = (relative(f.values[low], truth(f, slice(0, 1))[low]) for f in (frf, whole))
    assert before > 0.02
    assert error < before / 3


def test_a_hit_without_samples_before_the_next_one_is_an_error(hits):
    force = np.array(hits.inputs)
    first = find_hits(force[None, :, 0])[0]
    force[:, 0], force[[5, 4000], 0] = 0, first.peak
    record = Signals(outputs=hits.outputs, inputs=force, sampling_rate=1.0)
    with pytest.raises(DataError, match=r"hit 1: before=5000 leaves 0 samples.\nLower before"):
        estimate_frf(record, hits="all", before=5000)
    with pytest.raises(DataError, match=r"before=3999 leaves 1 sample\."):
        estimate_frf(record, hits="all", before=3999)
    assert estimate_frf(record, hits="all", before=3000).averages == 2


def test_what_stands_out_of_the_noise_of_a_force_is_kept(hits):
    """A weak second pulse long after the first is a force, if it exceeds five deviations of the noise."""
    inputs = np.array(hits.inputs)
    inputs[1000, 0], inputs[1100, 0] = 6e-4, 4e-4
    forces = inputs[None, :, 0]
    quiet = between_hits(forces, find_hits(forces))[0]
    noise = np.median(np.abs(inputs)) / 0.6745
    assert 4e-4 < 5 * noise < 6e-4
    assert list(quiet[[1000, 1007, 1008, 1100]]) == [False, False, True, True]
    assert quiet.mean() > 0.98


def test_hits_can_be_chosen_by_number(hits):
    assert estimate_frf(hits, hits=[1, 4]).averages == 2
    with pytest.raises(DataError, match="the record has hits 1 to 6"):
        estimate_frf(hits, hits=[7])


def test_no_line_is_ever_nan():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((1000, 1))
    for kind in ("random", "burst", "sweep"):
        frf = estimate_frf(record(u), excitation=kind)
        assert np.all(np.isfinite(frf.values))


@pytest.mark.parametrize("length", [1, 2, 3, 256, 1001])
def test_windows_are_those_of_scipy(length: int):
    for name in WINDOWS:
        expected = signal.get_window("boxcar" if name == "none" else name, length)
        assert np.array_equal(window_of(name, length), expected)


def test_spectra_are_those_of_scipy():
    rng = np.random.default_rng(0)
    y, u = rng.standard_normal((1, 1000, 2)), rng.standard_normal((1, 1000, 2))
    w = signal.get_window("hann", 200)
    found = cross_spectra(y, u, 50.0, Segments(list(range(0, 801, 100)), w, w), whole=True)
    for i in range(2):
        for j in range(2):
            f, expected = signal.csd(u[0, :, j], y[0, :, i], fs=50.0, nperseg=200, detrend=False)
            assert np.allclose(found.cross[:, i, j], expected)
            assert np.allclose(
                found.outputs[:, i, j], signal.csd(y[0, :, j], y[0, :, i], fs=50.0, nperseg=200, detrend=False)[1]
            )
    assert np.allclose(found.frequencies, f)


def test_coherence_of_one_input_is_the_ordinary_one():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((4000, 1))
    y = u + rng.standard_normal((4000, 1))
    data = Signals(outputs=y - y.mean(), inputs=u - u.mean(), sampling_rate=1.0)
    expected = signal.coherence(u[:, 0] - u.mean(), y[:, 0] - y.mean(), nperseg=500, detrend=False)[1]
    assert np.allclose(estimate_frf(data, segment=500).coherence[:, 0], expected)


def test_h1_and_h2_are_the_bounds_of_hv():
    """With one input |H1| <= |Hv| <= |H2|, and H1 / H2 is the coherence."""
    rng = np.random.default_rng(0)
    u = rng.standard_normal((4000, 1))
    data = Signals(
        outputs=2 * u + rng.standard_normal(u.shape), inputs=u + 0.5 * rng.standard_normal(u.shape), sampling_rate=1.0
    )
    h1, hv, h2 = (estimate_frf(data, estimator=e) for e in ("h1", "hv", "h2"))
    assert np.all(np.abs(h1.values) <= np.abs(hv.values) * (1 + 1e-12))
    assert np.all(np.abs(hv.values) <= np.abs(h2.values) * (1 + 1e-12))
    assert np.allclose((h1.values / h2.values)[:, :, 0], h1.coherence)


def test_hv_does_not_depend_on_units():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((4000, 2))
    data = record(u)
    noisy = data.outputs + 0.3 * rng.standard_normal(data.outputs.shape)
    a = estimate_frf(Signals(outputs=noisy, inputs=u, sampling_rate=1.0), estimator="hv")
    b = estimate_frf(Signals(outputs=1e3 * noisy, inputs=1e-2 * u, sampling_rate=1.0), estimator="hv")
    assert relative(b.values, 1e5 * a.values) < 1e-9


def test_overlapping_segments_are_worth_fewer_averages():
    w = signal.get_window("hann", 256)
    starts = list(range(0, 256 * 20 - 255, 128))
    # Welch: half-overlapping Hann segments have rho^2 = 1/36, so n / (1 + 2/36 (n - 1) / n)
    n = len(starts)
    assert effective_averages(w, starts, 1) == pytest.approx(n / (1 + 2 / 36 * (n - 1) / n), rel=1e-3)
    assert effective_averages(np.ones(256), list(range(0, 2560, 256)), 3) == 30


def coverage(estimator, seeds, outputs=28, noise=None):
    """Part of the 95 % regions |error|^2 < q variance that hold the truth, over lines, outputs, inputs and seeds."""
    model = random_system(
        np.random.default_rng(1), outputs=outputs, inputs=2, modes=6, damping=(0.03, 0.1), direct=True
    )
    mix = np.array([[1.0, 0.5], [0.0, np.sqrt(0.75)]])
    hit = total = 0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal((20, 1024, 2)) @ mix
        u[:, 500:] = 0
        y = np.stack([model.simulate(run) for run in u])
        y_noise = 0.1 * y.std(axis=(0, 1))
        u_noise = 0.1 * u.std(axis=(0, 1)) if estimator != "h1" else np.zeros(2)
        powers = (np.zeros(outputs) if estimator == "h2" else y_noise**2, u_noise**2)
        data = Signals(
            outputs=y + np.sqrt(powers[0]) * rng.standard_normal(y.shape),
            inputs=u + np.sqrt(powers[1]) * rng.standard_normal(u.shape),
            sampling_rate=1.0,
        )
        known = None if estimator != "hv" else powers
        frf = estimate_frf(data, estimator=estimator, excitation="burst", noise=known)
        exact = model.frequency_response(frf.frequencies).values
        # |error|^2 / variance is F(2, 2 (n - m)) distributed: its 95 % point at 36 degrees of freedom is 3.26
        hit += int(np.sum(np.abs(frf.values - exact) ** 2 < 3.26 * frf.variance))
        total += exact.size
    return hit / total


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["h1", "h2", "hv"])
def test_regions_from_the_predicted_variance_cover_the_truth(estimator):
    # lines of one seed share the inputs' noise: three seeds of 513 lines x 28 outputs scatter by less than 1 %
    assert 0.92 < coverage(estimator, 3) < 0.98


@pytest.mark.study("standard-deviations")
@pytest.mark.parametrize("estimator", ["h1", "hv"])
def test_coverage_over_a_hundred_seeds(estimator, study):
    found = coverage(estimator, 100)
    table = study(f"frequency responses, {estimator}, 28 outputs, 2 inputs", "100 records, seeds 0 to 99")
    table.row("coverage of 95 % regions of the variance", 100 * found, least=92, most=98, form=".1f", unit=" %")
    assert not table.missed


def test_overlapping_hann_segments_of_random_forces_predict_their_scatter_too():
    """Leakage is part of the residual, so its scatter is predicted; its bias near sharp resonances costs a few per cent."""
    structure = chain5()
    inside = total = 0
    for seed in range(3):
        data = structure.simulate(samples=40000, sampling_rate=RATE, noise=0.05, seed=seed)
        frf = estimate_frf(data, segment=2000).band(0.5, 8)
        exact = structure.state_space(quantity="acceleration", dt=1 / RATE).frequency_response(frf.frequencies).values
        inside += int(np.sum(np.abs(frf.values - exact) ** 2 < 3.2 * frf.variance))
        total += exact.size
    assert 0.90 < inside / total < 0.98


WHITE = np.random.default_rng(0).standard_normal((400, 2))


@pytest.mark.parametrize(
    ("data", "options", "text"),
    [
        (Signals(outputs=WHITE, sampling_rate=1.0), {}, "the record has no inputs"),
        (record(WHITE * [1, 0]), {}, "u2 is constant: no force"),
        (record(WHITE[:, :1] * [1, 2]), {}, "the forces are dependent at"),
        (record(WHITE), {"excitation": "burst"}, "the number of averages is 1"),
        (record(WHITE), {"estimator": "h3"}, "there are only h1, h2, hv"),
        (record(WHITE), {"segment": 500}, "segments of 500 samples"),
        (record(WHITE), {"overlap": 1.0}, "overlap=1.0"),
        (record(WHITE), {"excitation": "impact"}, "2 inputs instead of one"),
        (record(WHITE), {"excitation": "periodic"}, "the forces do not repeat"),
        (record(WHITE), {"excitation": "periodic", "period": 300}, "fewer than two periods"),
        (record(WHITE), {"force_window": 0.1}, "the excitation is random"),
        (record(WHITE), {"exponential": 0.1}, "the excitation is random"),
        (record(WHITE), {"estimator": "h1", "noise": (1, 1)}, "H1 assumes all noise on the outputs"),
        (record(WHITE), {"estimator": "hv", "noise": ((1, 2), 1)}, "noise needs the powers of 3 outputs and 2 inputs"),
        (record(WHITE[:, :1]), {"excitation": "burst", "exponential": 2}, "Give end between 0 and 1"),
    ],
)
def test_what_cannot_be_estimated_is_said(data, options, text):
    with pytest.raises(DataError, match=text):
        estimate_frf(data, **options)


def series(pauses, heights=None, tail=0):
    """Return the hits of pulses of five samples with these pauses from start to start, and the samples of their record."""
    starts = 50 + np.concatenate([[0], np.cumsum(pauses)]).astype(int)
    force = np.zeros(starts[-1] + tail)
    for start, height in zip(starts, heights or [1.0] * len(starts), strict=True):
        force[start : start + 5] = height * np.sin(np.pi * np.arange(1, 6) / 6)
    return find_hits(force[None]), force.size


@pytest.mark.parametrize(
    ("pauses", "heights", "tail", "kept", "length"),
    [
        ([1000] * 4, None, 1000, [1, 2, 3, 4, 5], 1000),
        ([1000] * 4, None, 60, [1, 2, 3, 4], 1000),  # the record ends just after the last hit
        ([1000, 1000, 6000], None, 1000, [1, 2, 3, 4], 1000),  # someone talked
        ([1000, 200, 1000], None, 1000, [1, 4], 1000),  # two hits, too soon after each other, of which neither is free
        ([1000, 200, 1000], [1, 1, 0.3, 1], 1000, [1, 2, 3], 1000),  # one that bounced, recorded whole
        ([900, 1100, 1000], None, 1000, [1, 2, 3, 4], 900),
    ],
)
def test_hits_that_would_shorten_all_others_are_left_out(pauses, heights, tail, kept, length):
    hits, samples = series(pauses, heights, tail)
    room = room_of(hits, samples, 0)
    used = [hit for hit in whole_series(hits, room) if not hit.unfit]
    assert [hit.number for hit in used] == kept
    assert min(room[hit.number] for hit in used) == length


def test_the_hit_before_the_end_says_why_it_is_left_out(hits):
    short = replace(hits, outputs=hits.outputs[:10000], inputs=hits.inputs[:10000])
    frf = estimate_frf(short)
    assert frf.averages == 5
    assert "left out: 6, 220 samples long, 1900 are needed" in frf.processing[-1]
    assert [f.kind for f in examine(short)] == []
