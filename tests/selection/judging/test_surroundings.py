"""What is said of the surroundings of a mode, and what it makes of its grade."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.notes import Harmonic
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.grades import grades
from modalscope.selection.judging.surroundings import (
    DIED,
    EXPLAINED_NEARBY,
    LEFT_AT_END,
    OF_NYQUIST,
    explained_nearby,
    left_at_end,
    note_on_ends,
    note_on_window,
    widened_by_window,
    with_reasons,
)
from tests.interfaces.plot import examples

NUDGE = 1e-3
F = np.linspace(1, 40, 2000)


def known() -> ms.ModalModel:
    modes = examples.modes()
    return replace(
        modes, frequencies_std=1e-4 * modes.frequencies, damping_ratios_std=0.01 * modes.damping_ratios, reasons=()
    )


def answer(modes: ms.ModalModel, lines: np.ndarray) -> ComplexArray:
    s, w = modes.poles, 2j * np.pi * lines[:, None]
    return ((1 / (w - s) + 1 / (w - s.conj())) @ modes.shapes.T.real)[:, :, None]


def two() -> ms.ModalModel:
    return ms.ModalModel(poles=poles_from(np.array([10.0, 30.0]), np.array([0.01, 0.01])), shapes=np.ones((2, 2)))


def test_what_is_explained_is_counted_around_each_mode_alone() -> None:
    modes = two()
    H = answer(modes, F)
    first = answer(modes.take([0]), F)
    response = FrequencyResponse(values=H, frequencies=F)
    assert np.allclose(explained_nearby(response, H, modes), 1)
    one, other = explained_nearby(response, first, modes)
    assert one > 0.999
    assert other < 0.01
    # a third of the amplitude is missing there: a ninth of the power
    assert explained_nearby(response, H - (H - first) / 3, modes)[1] == pytest.approx(8 / 9, abs=0.01)


def test_samples_are_asked_on_the_lines_of_their_transform() -> None:
    modes = two()
    t = np.arange(4000) / 100.0
    h = np.exp(np.outer(t, modes.poles)).real
    values = np.stack([h.sum(axis=1), h[:, 0]], axis=1)[:, :, None]
    fitted = np.stack([h[:, 0], h[:, 0]], axis=1)[:, :, None]
    one, other = explained_nearby(ImpulseResponse(values=values, sampling_rate=100.0), fitted, modes)
    assert one > 0.99
    assert other < 0.05


def test_nothing_is_said_of_modes_outside_the_lines_and_of_nothing() -> None:
    modes = two()
    inside = FrequencyResponse(values=answer(modes, F[F < 20]), frequencies=F[F < 20])
    assert np.isnan(explained_nearby(inside, inside.values, modes)).tolist() == [False, True]
    silent = FrequencyResponse(values=np.zeros((F.size, 2, 1), complex), frequencies=F)
    assert np.isnan(explained_nearby(silent, silent.values, modes)).all()
    said = with_reasons(modes, {EXPLAINED_NEARBY: np.array([0.5, np.nan])})
    assert [dict(each) for each in said.reasons] == [{EXPLAINED_NEARBY: 0.5}, {}]


@pytest.mark.parametrize(
    ("facts", "word", "reason"),
    [
        ({EXPLAINED_NEARBY: 0.2 + NUDGE}, "good", ""),
        ({EXPLAINED_NEARBY: 0.2 - NUDGE}, "look", "of the response around it explained"),
        ({OF_NYQUIST: 0.8 - NUDGE}, "good", ""),
        ({OF_NYQUIST: 0.8 + NUDGE}, "look", "may be an alias"),
    ],
)
def test_what_is_seen_around_a_mode_decides_between_good_and_look(
    facts: dict[str, float], word: str, reason: str
) -> None:
    modes = known()
    said = with_reasons(modes, {name: np.full(len(modes), value) for name, value in facts.items()})
    assert {grade.word for grade in grades(said)} == {word}
    assert all(reason in grade.reason for grade in grades(said))


@pytest.mark.parametrize(("away", "word"), [(0.02 - NUDGE, "look"), (0.02 + NUDGE, "good")])
def test_nothing_beside_a_line_of_a_machine_is_good(away: float, word: str) -> None:
    modes = known()
    line = Harmonic(frequency=float(modes.frequencies[1]) * (1 + away))
    assert [grade.word for grade in grades(replace(modes, harmonics=(line,)))][1] == word


def test_a_mode_near_the_end_of_what_was_sampled_is_not_good() -> None:
    """An ambient record that is not filtered: what lies above half the rate is seen below it."""
    record = ms.systems.build("chain5").simulate(inputs="ambient", duration=3000, sampling_rate=20.0, seed=3)
    folded = ms.Signals(outputs=np.asarray(record.outputs)[::9], sampling_rate=20.0 / 9)
    modes = ms.analyze(folded, band=(0, 1.1), orders=range(10, 41, 10)).modes
    above = [mode for mode in modes if mode.frequency > 0.8 * 10 / 9]
    assert above
    assert all(mode.grade != "good" for mode in above)
    assert {OF_NYQUIST, EXPLAINED_NEARBY} <= set(modes.reasons[0])


@pytest.mark.slow
def test_every_one_of_several_bands_is_asked_with_its_own_terms() -> None:
    """Samples of bands are at rates of their own: modes of all bands together explain nothing there."""
    record = ms.systems.build("chain5").simulate(inputs="ambient", duration=2000, sampling_rate=20.0, seed=1)
    result = ms.analyze(record, band=[(0.3, 2.0), (2.0, 7.0)])
    assert len(result.diagrams) == 2
    assert min(each[EXPLAINED_NEARBY] for each in result.modes.reasons) > 0.9


def struck(damping: float, seconds: float = 2.0, rate: float = 500.0) -> ms.Signals:
    """Return four hits of a structure with modes at 12 and 55 Hz, the first of the damping, in runs that end after `seconds`."""
    rng, n = np.random.default_rng(1), int(seconds * rate)
    t, runs = np.arange(n) / rate, []
    s = poles_from(np.array([12.0, 55.0]), np.array([damping, 0.02]))
    for _ in range(4):
        u = np.zeros(n)
        start = int(rng.integers(20, 30))
        u[start : start + 4] = [30.0, 90.0, 90.0, 30.0]
        moved = [np.convolve(u, np.imag(np.exp(pole * t)))[:n] for pole in s]
        y = np.array([[1.0, 0.5], [0.6, -1.0]]) @ moved
        runs.append(np.column_stack([u, (y + 0.002 * y.std() * rng.standard_normal(y.shape)).T]))
    whole = np.array(runs)
    return ms.Signals(outputs=whole[:, :, 1:], inputs=whole[:, :, :1], sampling_rate=rate)


def test_the_damping_of_a_mode_that_goes_on_where_its_record_ends_is_not_good() -> None:
    modes = ms.analyze(struck(0.01), orders=range(4, 21, 4), route="frf").modes
    assert [mode.words["damping"] for mode in modes] == ["look", "good"]
    assert modes.reasons[0][LEFT_AT_END] == pytest.approx(np.exp(-2 * np.pi * 12.0 * 0.01 * 2.0), rel=0.05)
    assert "left at the end of its blocks: leakage" in grades(modes)[0].reason


@pytest.mark.slow
def test_a_mode_that_a_window_took_or_that_died_is_good() -> None:
    windowed = ms.analyze(ms.estimate_frf(struck(0.01), excitation="impact", exponential=0.01)).modes
    assert LEFT_AT_END not in windowed.reasons[0]
    windowed_lines = ms.estimate_frf(struck(0.01), excitation="impact", exponential=0.01)
    assert np.all(np.isnan(left_at_end(windowed_lines, windowed)))
    assert np.all(left_at_end(ms.estimate_frf(struck(0.01), excitation="impact"), windowed) > 0)
    died = ms.analyze(struck(0.04)).modes
    assert [mode.grade for mode in died] == ["good", "good"]


@pytest.mark.parametrize(("share", "word"), [(DIED * (1 - NUDGE), "good"), (DIED * (1 + NUDGE), "look")])
def test_more_than_a_hundredth_left_at_the_end_of_blocks_is_leakage(share: float, word: str) -> None:
    modes = with_reasons(known(), {LEFT_AT_END: np.full(len(known()), share)})
    assert {grade.words["damping"] for grade in grades(modes)} == {word}


def test_responses_without_records_have_a_note_alone_and_only_on_lines_of_a_transform() -> None:
    step = 2.0
    note = note_on_ends(on_lines(np.arange(4, 40, step)), two())
    assert note is not None
    assert "blocks of 0.5 s without a window, 2 modes went on at their ends (73 % left at 10 Hz)" in str(note)
    assert note_on_ends(on_lines(np.arange(4, 40, step) + 0.7), two()) is None
    assert note_on_ends(on_lines(np.arange(400, 4000) * 0.01), two()) is None


@pytest.mark.parametrize(("bandwidth", "within"), [(2.0, 0.25), (4.0, 0.06), (8.0, 0.12)])
def test_a_hann_window_widens_resonances_by_a_known_part(bandwidth: float, within: float) -> None:
    """The impulse response times the autocorrelation of the window is what H1 of random forces tends to."""
    samples, rate = 2048, 256.0
    f, zeta = 40.0, bandwidth * rate / samples / (2 * 40.0)
    w = np.hanning(samples + 1)[:-1]
    r = np.correlate(w, w, "full")[samples - 1 :] / (w @ w)
    t = np.arange(samples) / rate
    h = np.exp(-2 * np.pi * f * zeta * t) * np.sin(2 * np.pi * f * t) * r
    lines = np.fft.rfftfreq(samples, 1 / rate)
    near = (lines > 20) & (lines < 60)
    seen = FrequencyResponse(values=np.fft.rfft(h)[near, None, None], frequencies=lines[near], quantity="displacement")
    response = replace(
        seen, values=seen.values * (1 + 1e-4 * np.random.default_rng(0).standard_normal(seen.values.shape))
    )
    assert not [note for note in ms.analyze(response, frequencies=[f]).notes if note.kind == "window"]
    averaged = replace(response, coherence=np.full(response.values.shape, 0.99))
    result = ms.analyze(averaged, frequencies=[f])
    widened = result.modes.damping_ratios[0] / zeta - 1
    assert widened == pytest.approx(4 / (3 * bandwidth**2), rel=within)
    truth = replace(result.modes, poles=result.modes.poles.imag * 1j + -2 * np.pi * f * zeta)
    assert widened_by_window(response, truth)[0] == pytest.approx(4 / (3 * bandwidth**2), rel=1e-3)
    assert any(note.kind == "window" for note in result.notes)
    for step, said in (
        ("H1 of 5 averages, impact excitation: no window", False),
        ("random excitation: hann window", True),
    ):
        assert (note_on_window(replace(averaged, processing=(step,)), result.modes) is not None) == said


def on_lines(lines: np.ndarray) -> FrequencyResponse:
    return FrequencyResponse(values=answer(two(), lines), frequencies=lines, quantity="displacement")
