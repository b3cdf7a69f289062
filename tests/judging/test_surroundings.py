"""What is said of the surroundings of a mode, and what it makes of its grade."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.notes import Harmonic
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.functions.poles import poles_from
from modalscope.judging.grades import grades
from modalscope.judging.surroundings import EXPLAINED_NEARBY, OF_NYQUIST, explained_nearby, with_reasons
from modalscope.numerics.checks import ComplexArray
from tests.plot import examples

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
    modes = ms.analyze(ms.Signals(outputs=np.asarray(record.outputs)[::9], sampling_rate=20.0 / 9), band=(0, 1.1)).modes
    above = [mode for mode in modes if mode.frequency > 0.8 * 10 / 9]
    assert above
    assert all(mode.grade != "good" for mode in above)
    assert {OF_NYQUIST, EXPLAINED_NEARBY} <= set(modes.reasons[0])


def test_every_one_of_several_bands_is_asked_with_its_own_terms() -> None:
    """Samples of bands are at rates of their own: modes of all bands together explain nothing there."""
    record = ms.systems.build("chain5").simulate(inputs="ambient", duration=2000, sampling_rate=20.0, seed=1)
    result = ms.analyze(record, band=[(0.3, 2.0), (2.0, 7.0)])
    assert len(result.diagrams) == 2
    assert min(each[EXPLAINED_NEARBY] for each in result.modes.reasons) > 0.9
