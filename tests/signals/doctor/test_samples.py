"""Faults of single samples and lines: found where they are put in, and never in sound records."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import hypergeom

from modalscope.data import DataError, FrequencyResponse, Signals
from modalscope.numerics.checks import Array
from modalscope.signals.doctor import examine
from modalscope.signals.doctor.responses import (
    conjugated,
    isolated_lines,
    lone_lines,
    no_phase,
    outputs_to_estimate,
    sampled,
)
from modalscope.signals.doctor.samples import equal_stretches, spikes_of, wraps
from modalscope.systems import chain5

CHAIN = chain5()
LINES = np.arange(0.1, 9, 0.02)
NEW = {"overflow", "frozen", "gap", "spikes", "transposed", "conjugated", "no phase", "lone lines"}


def ambient(seed: int, rate: float = 100.0, samples: int = 4000) -> Signals:
    """Return a record sampled well above its modes, 40 dB above its noise."""
    return CHAIN.simulate(
        inputs="ambient", samples=samples, sampling_rate=rate, quantity="velocity", noise=0.001, seed=seed
    )


def spoilt(record: Signals, change: object) -> set[str]:
    outputs = record.outputs.copy()
    change(outputs)  # type: ignore[operator]
    return {f.kind for f in examine(Signals(outputs=outputs, sampling_rate=record.sampling_rate))} & NEW


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_sound_records_and_responses_are_not_named(seed: int) -> None:
    rng = np.random.default_rng(seed)
    record = ambient(seed, rate=float(rng.choice([20.0, 50.0, 200.0])))
    coarse = np.std(record.outputs) / 2 ** int(rng.integers(2, 7))
    for outputs in (record.outputs, np.round(record.outputs / coarse) * coarse):
        assert not NEW & {f.kind for f in examine(Signals(outputs=outputs, sampling_rate=record.sampling_rate))}
    response = CHAIN.frequency_response(LINES, noise=10 ** rng.uniform(-4, -0.5), seed=seed)
    assert not NEW & {f.kind for f in examine(response)}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_what_was_put_in_is_found(seed: int) -> None:
    record = ambient(seed)
    top = 0.7 * np.abs(record.outputs[:, 1]).max()

    def overflow(y: Array) -> None:
        y[:, 1] = (y[:, 1] + top) % (2 * top) - top

    def hold(y: Array) -> None:
        y[1000:1040, 2] = y[1000, 2]

    def gap(y: Array) -> None:
        y[1000:1040] = 0.0

    def spike(y: Array) -> None:
        y[2000, 0] += 3 * np.std(y[:, 0])

    assert spoilt(record, overflow) == {"overflow"}
    assert spoilt(record, hold) == {"frozen"}
    assert spoilt(record, gap) == {"gap"}
    assert spoilt(record, spike) == {"spikes"}


def test_a_signal_of_two_levels_wraps_nowhere_and_a_steep_sine_neither() -> None:
    t = np.arange(4000)
    assert wraps(np.sign(np.sin(t / 40))).size == 0
    assert wraps(np.sin(t / 3)).size == 0
    assert all(wraps(np.random.default_rng(s).standard_normal(4000)).size == 0 for s in range(50))
    sine = 1.2 * np.sin(t / 40)
    assert wraps((sine + 1) % 2 - 1).size == np.count_nonzero(np.diff(np.abs(sine) > 1))


def test_a_value_holds_only_between_motion_and_for_longer_than_chance() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal(2000)
    quiet = x.copy()
    quiet[:500] = 0.0  # before the first hit
    assert equal_stretches(quiet) == []
    held = x.copy()
    held[700:712] = 3.0
    assert equal_stretches(held) == [(700, 712)]
    assert equal_stretches(np.sign(x)) == []  # two levels: runs of a dozen are chance
    assert equal_stretches(np.zeros(100)) == []


def test_only_a_sample_that_isolated_lines_is_a_spike() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal(5000)
    assert spikes_of(x).size == 0
    onset = np.concatenate([0.01 * x[:2000], 5 * np.exp(-np.arange(3000) / 300) * np.cos(np.arange(3000) / 5)])
    assert spikes_of(onset).size == 0
    x[1234] += 30
    assert spikes_of(x).tolist() == [1234]


def test_more_channels_than_samples_are_named() -> None:
    rng = np.random.default_rng(0)
    found = examine(Signals(outputs=rng.standard_normal((6, 400)), sampling_rate=10.0))
    assert "transposed" in {f.kind for f in found}


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_a_conjugate_response_runs_backwards_in_time(quantity: str) -> None:
    response = CHAIN.frequency_response(LINES, noise=0.03, seed=1, quantity=quantity)
    turned = FrequencyResponse(values=response.values.conj(), frequencies=LINES, quantity=quantity)
    assert "conjugated" in {f.kind for f in examine(turned)}
    assert "conjugated" not in {f.kind for f in examine(response.band(2, 5))}
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((500, 3, 2)) + 1j * rng.standard_normal((500, 3, 2))
    assert "conjugated" not in {
        f.kind for f in examine(FrequencyResponse(values=noise, frequencies=np.arange(1, 501.0)))
    }


@pytest.mark.parametrize("noise", [0.0, 0.001, 0.3])
def test_a_conjugate_response_of_few_lines_at_its_resonances_is_told_from_its_noise(noise: float) -> None:
    """Of three modes as narrow as a line, most products are of skirts and of noise, which say nothing."""
    f, rng = np.arange(1, 801.0), np.random.default_rng(3)
    H = sum(
        a * f**2 / (g**2 - f**2 + 2j * z * g * f) for a, g, z in ((1, 60, 0.01), (0.8, 170, 0.008), (-0.6, 410, 0.006))
    )
    H = (H + noise * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)))[:, None, None]
    assert [finding.kind for finding in conjugated(FrequencyResponse(values=H.conj(), frequencies=f))] == ["conjugated"]
    assert conjugated(FrequencyResponse(values=H, frequencies=f)) == []


def test_decibels_have_no_phase_and_magnitudes_are_refused() -> None:
    size = np.abs(CHAIN.frequency_response(LINES).values)
    found = examine(FrequencyResponse(values=20 * np.log10(size) + 0j, frequencies=LINES))
    assert "decibels" in next(f.reason for f in found if f.kind == "no phase")
    signed = size * np.sign(np.sin(LINES * 9))[:, None, None] / size.max()
    assert "all values are real" in no_phase(FrequencyResponse(values=signed + 0j, frequencies=LINES))[0].reason
    with pytest.raises(DataError, match="magnitudes"):
        FrequencyResponse(values=size + 0j, frequencies=LINES)


def test_a_line_that_isolated_lines_in_every_pair_is_named_and_a_resonance_is_not() -> None:
    response = CHAIN.frequency_response(LINES, noise=0.01, seed=0)
    values = response.values.copy()
    values[60] *= 20
    found = [f for f in examine(FrequencyResponse(values=values, frequencies=LINES)) if f.kind == "lone lines"]
    assert f"{LINES[60]:.6g} Hz" in found[0].reason
    narrow = np.abs(1 / (1j * (np.arange(41) - 20.3) + 0.05))  # a half bandwidth of a twentieth of a line
    assert isolated_lines(narrow[:, None] + 0j).size == 0


def test_what_one_mode_and_a_level_give_between_lines_is_exact_and_three_times_that_isolated_lines() -> None:
    rng = np.random.default_rng(2)
    x = np.arange(60.0)
    shapes, levels = rng.standard_normal((2, 2, 4)) + 1j * rng.standard_normal((2, 2, 4))
    H = shapes[0] / (1j * (x[:, None] - 31.4) + 0.02) + levels[0]
    assert isolated_lines(H).size == 0
    for k in (12, 26, 45):
        for factor in (3, 1 / 3, 3j):
            spoilt = H.copy()
            spoilt[k] *= factor
            assert isolated_lines(spoilt).tolist() == [k]
    # of noise alone no line is named
    noise = rng.standard_normal((2000, 3)) + 1j * rng.standard_normal((2000, 3))
    assert isolated_lines(noise).size == 0


def test_lines_two_apart_and_a_pair_within_its_noise_do_not_hide_a_line_that_isolated_lines() -> None:
    rng = np.random.default_rng(3)
    x = np.arange(80.0)
    H = np.ones(5) + 3.0 / (1j * (x[:, None] - 40.3) + 2.0)
    H[:, 4] *= 1e-4  # all of it noise
    H = H + 1e-3 * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    assert isolated_lines(H).size == 0
    H[[20, 22, 60]] *= np.array([3.0, 4.0, 3.0])[:, None]
    H[:, 4] = 1e-3 * (rng.standard_normal(80) + 1j * rng.standard_normal(80))
    assert isolated_lines(H).tolist() == [20, 22, 60]
    assert H[22, 0] == pytest.approx(4 * H[21, 0], rel=0.2)  # what was given is left as it is


@pytest.mark.parametrize("hann", [False, True])
def test_a_resonance_narrower_than_a_line_is_no_lone_line_and_mains_beside_it_are(hann: bool) -> None:
    x = np.arange(1.0, 400.0)
    f, zeta = np.array([9.08, 40.03, 53.5, 121.0]), 4e-4
    shapes = np.random.default_rng(0).standard_normal((3, 4))
    H = np.einsum("in,fn->fi", shapes, -(x[:, None] ** 2) / (f**2 - x[:, None] ** 2 + 2j * zeta * f * x[:, None]))
    if hann:
        H = np.pad(H, ((1, 1), (0, 0)), mode="edge")
        H = 0.5 * H[1:-1] - 0.25 * (H[:-2] + H[2:])
    rng = np.random.default_rng(1)
    H = H + 1e-3 * np.median(np.abs(H)) * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    assert isolated_lines(H).tolist() == []
    H[200] *= 10
    assert isolated_lines(H).tolist() == [200]


@pytest.mark.parametrize(("outputs", "searched"), [(84, ()), (400, (84.0, 400.0))])
def test_of_many_pairs_a_sample_is_searched_and_the_chance_to_miss_a_line_is_said(
    outputs: int, searched: tuple[float, ...]
) -> None:
    f, w = np.linspace(1, 20, 200), 2 * np.pi * np.random.default_rng(0).uniform(3, 15, outputs)
    H = 1 / (w**2 - (2 * np.pi * f[:, None]) ** 2 + 0.1j * w * 2 * np.pi * f[:, None])
    response = FrequencyResponse(values=H[:, :, None], frequencies=f, quantity="displacement")
    notes = sampled(response)
    assert [(note.numbers["pairs"], note.numbers["of"]) for note in notes] == ([searched] if searched else [])
    for note in notes:
        assert note.numbers["missed"] == pytest.approx(hypergeom.cdf(2, outputs, outputs // 10, 84), rel=1e-9)
    assert not lone_lines(response)
    changed = H.copy()
    changed[120] *= 5
    shown = FrequencyResponse(values=changed[:, :, None], frequencies=f, quantity="displacement")
    assert [str(finding) for finding in lone_lines(shown)] == [
        str(finding) for finding in lone_lines(shown, whole=True)
    ]
    assert lone_lines(shown)[0].frequencies == (f[120],)


def _record(outputs: int, inputs: int = 1, quantity: str | None = "acceleration") -> Signals:
    rng = np.random.default_rng(0)
    y, u = rng.standard_normal((400, outputs)), rng.standard_normal((400, inputs))
    dofs = tuple(f"{i + 1}:+X" for i in range(outputs))
    return Signals(
        outputs=y, inputs=u, sampling_rate=10.0, quantities=quantity, output_dofs=dofs, input_dofs=dofs[-inputs:]
    )


def test_of_a_record_of_many_outputs_those_are_estimated_that_a_finding_can_name_and_drawn_ones() -> None:
    many = _record(90, 2)
    chosen = outputs_to_estimate(many, set(many.output_dofs) - {"7:+X"})
    assert {6, 88, 89} <= set(chosen)  # not explained, and driving points
    assert len(chosen) == 3 + 24
    few = _record(25)
    assert outputs_to_estimate(few, few.output_dofs) == list(range(25))  # one is a driving point, 24 are drawn
    assert outputs_to_estimate(many, ()) == list(range(90))


@pytest.mark.parametrize(("outputs", "quantity", "said"), [(24, "velocity", 0), (25, "velocity", 1), (25, None, 0)])
def test_of_many_outputs_the_chance_to_miss_a_wrong_quantity_is_said(
    outputs: int, quantity: str | None, said: int
) -> None:
    notes = sampled(_record(outputs, quantity=quantity))
    assert len(notes) == said
    for note in notes:
        assert note.numbers["missed"] == pytest.approx(hypergeom.cdf(0, outputs, outputs // 10, 24), rel=1e-9)
