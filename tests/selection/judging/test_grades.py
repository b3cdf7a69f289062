from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import ModalModel, Signals
from modalscope.interfaces.reporting.document import Origin
from modalscope.interfaces.reporting.html import table
from modalscope.interfaces.reporting.modes import modes_section, summary_section
from modalscope.interfaces.reporting.record import data_section
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.grades import ALIKE, QUANTITIES, alike_pairs, grades, half_widths
from tests.interfaces.plot import examples

#: Half width of a 95 % interval in standard deviations.
Z = 1.959964


def known(damping: float = 0.01, frequency: float = 1e-4) -> ModalModel:
    """Return the chain's modes with relative deviations of frequencies and damping ratios."""
    modes = examples.modes()
    return replace(
        modes, frequencies_std=frequency * modes.frequencies, damping_ratios_std=damping * modes.damping_ratios
    )


def words(modes: ModalModel) -> list[str]:
    return [grade.word for grade in grades(modes)]


def test_modes_known_to_a_per_cent_with_shapes_of_their_own_are_good_and_say_how_well_they_are_known() -> None:
    found = grades(known())
    assert {grade.word for grade in found} == {"good"}
    assert all("damping known within ±2" in grade.reason for grade in found)  # 1.96 times 1 %


def test_without_deviations_nothing_is_good() -> None:
    assert all(grade.word == "look" and "not known" in grade.reason for grade in grades(examples.modes()))
    assert all(np.isnan(half).all() for half in half_widths(examples.modes()))


@pytest.mark.parametrize(("open_by", "word"), [(0.29, "good"), (0.31, "look"), (0.99, "look"), (1.01, "doubtful")])
def test_damping_open_by_thirty_per_cent_wants_a_look_and_open_by_its_value_is_doubtful(
    open_by: float, word: str
) -> None:
    """The mode itself is as good as its frequency and its shape; its reason tells of its damping."""
    found = grades(known(damping=open_by / Z))
    assert {grade.words["damping"] for grade in found} == {word}
    assert {grade.word for grade in found} == {"good"}
    assert all(grade.reason == grade.words["damping"].reason for grade in found)


@pytest.mark.parametrize(("share", "word"), [(0.99, "good"), (1.01, "doubtful")])
def test_a_frequency_open_by_more_than_its_half_bandwidth_is_doubtful(share: float, word: str) -> None:
    modes = known()
    std = share / Z * np.maximum(modes.damping_ratios, 0.005) * modes.frequencies
    assert set(words(replace(modes, frequencies_std=std))) == {word}


@pytest.mark.parametrize(("share", "word"), [(0.0049, "good"), (0.0051, "doubtful")])
def test_the_frequency_of_a_tone_without_damping_is_judged_on_its_own_scale(share: float, word: str) -> None:
    modes = known()
    f, zeta = modes.frequencies, np.full(len(modes), 1e-6)
    tone = replace(
        modes, poles=poles_from(f, zeta), frequencies_std=share / Z * f, damping_ratios_std=share / Z * np.ones(len(f))
    )
    assert set(words(tone)) == {word}
    assert {grade.words["damping"] for grade in grades(tone)} == {"doubtful"}


def test_shapes_without_any_damping_have_words() -> None:
    """Deflection shapes at one frequency each are modes of poles on the axis."""
    modes = known()
    still = replace(modes, poles=2j * np.pi * modes.frequencies, damping_ratios_std=np.full(len(modes), 1e-4))
    assert {grade.words["damping"].reason for grade in grades(still)} == {"no damping told"}
    unknown = replace(still, frequencies_std=None, damping_ratios_std=None)
    assert {grade.reason for grade in grades(unknown)} == {"uncertainty not known"}


def test_alike_shapes_are_no_fault_of_modes_that_lie_apart_and_tell_of_pairs() -> None:
    modes = known()
    shapes = np.array(modes.shapes)
    shapes[:, 3] = shapes[:, 1]
    alike = replace(modes, shapes=shapes)
    assert set(words(alike)) == {"good"}
    assert alike_pairs(alike)[0][:2] == (1, 3)
    assert all(value > ALIKE for *_, value in alike_pairs(alike))


def test_of_two_that_are_the_same_mode_the_weaker_wants_a_look() -> None:
    modes = known()
    f, zeta, shapes = modes.frequencies.copy(), modes.damping_ratios.copy(), np.array(modes.shapes)
    f[3], zeta[3], shapes[:, 3] = f[1] * (1 + 1e-4), zeta[1], shapes[:, 1]
    twice = replace(modes, poles=poles_from(f, zeta), shapes=shapes, gain=np.array([9.0, 9.0, 9.0, 5.0, 9.0]))
    assert words(twice) == ["good", "good", "good", "look", "good"]
    assert "mode 2 once more" in grades(twice)[3].reason
    assert words(replace(twice, gain=None))[1] == "look"  # which is the weaker is not known
    apart = replace(twice, poles=poles_from(np.where(np.arange(5) == 3, f[1] * 1.02, f), zeta))
    assert set(words(apart)) == {"good"}


def test_no_unit_of_an_output_changes_a_word() -> None:
    rng = np.random.default_rng(3)
    modes = known()
    shapes = np.array(modes.shapes) * np.exp(1j * rng.uniform(0, 2, modes.shapes.shape))
    modes = replace(modes, shapes=shapes)
    std = rng.uniform(0.1, 1.2, (1, len(modes))) * rng.uniform(0.5, 2, (len(shapes), 1)) * np.abs(shapes).mean()
    units = 10.0 ** rng.uniform(-6, 6, (len(shapes), 1))
    for stated in (None, std):
        one = replace(modes, shapes_std=stated)
        other = replace(modes, shapes=shapes * units, shapes_std=None if stated is None else stated * units)
        assert [dict(grade.words) for grade in grades(one)] == [dict(grade.words) for grade in grades(other)]
        assert len({grade.words["shape"] for grade in grades(one)}) > 1


def test_alike_shapes_are_a_warning_of_the_summary_and_shapes_of_their_own_are_not() -> None:
    modes = known()
    shapes = np.array(modes.shapes)
    shapes[:, 3] = shapes[:, 1]
    body = summary_section(replace(modes, shapes=shapes), [examples.diagram()], None).body
    assert 'class="loud">WARNING: shapes of modes 2 and 4' in body
    assert "WARNING" not in summary_section(modes, [examples.diagram()], None).body


def test_a_pole_that_grows_is_doubtful() -> None:
    modes = known()
    grows = replace(modes, poles=np.where(np.arange(5) == 2, -np.conj(modes.poles), modes.poles))
    assert words(grows)[2] == "doubtful"


def test_a_shape_of_all_phases_wants_a_look() -> None:
    modes = known()
    shapes = np.array(modes.shapes, dtype=complex)
    shapes[:, 0] = np.exp(1j * np.pi / 2 * np.arange(shapes.shape[0]))  # a travelling wave: no phase is preferred
    assert "shape is complex" in grades(replace(modes, shapes=shapes))[0].reason


def test_the_table_of_modes_opens_with_grades_and_folds_the_figures_behind() -> None:
    body = modes_section(known()).body
    first, _, behind = body.partition("<details>")
    assert first.count('class="grade good"') == 5
    assert "spread" not in first
    assert behind.count("damping known within") == 5


def test_a_grade_cannot_become_markup() -> None:
    assert "<b x" not in table(["a"], [['"><b x']], graded=0)


def test_a_record_tells_its_own_length_rate_and_processing() -> None:
    data = Signals(outputs=np.ones((120_000, 4)), sampling_rate=100.0, processing=("drift removed",))
    body = data_section(examples.response(), None, (), data).body
    assert "120000 samples at 100 Hz: 20 min" in body
    assert "drift removed" in body


def test_only_a_record_without_inputs_has_spectra_behind_its_diagram() -> None:
    noise = np.random.default_rng(0).standard_normal((2000, 2))
    assert Origin(data=Signals(outputs=noise, sampling_rate=10.0)).spectra is not None
    assert Origin(data=Signals(outputs=noise, inputs=noise, sampling_rate=10.0)).spectra is None
    assert Origin().spectra is None


def test_modes_of_a_refinement_that_did_not_converge_want_a_look() -> None:
    assert {grade.reason for grade in grades(replace(known(), converged=False))} == {"refinement did not converge"}


def test_each_quantity_has_a_word_of_its_own_with_its_reason() -> None:
    modes = known(damping=0.31 / Z)
    assert {mode.words["frequency"] for mode in modes} == {"good"}
    assert {mode.words["damping"] for mode in modes} == {"look"}
    assert all(mode.words["frequency"].reason.startswith("frequency known within ±") for mode in modes)
    assert all("damping uncertain by ±31 %" in mode.words["damping"].reason for mode in modes)
    assert all(set(grade.words) == set(QUANTITIES) for grade in grades(modes))
    uncertain = replace(known(), frequencies_std=1.01 / Z * np.maximum(modes.damping_ratios, 0.005) * modes.frequencies)
    assert [tuple(mode.words.values()) for mode in uncertain] == [("doubtful", "good", "good")] * len(modes)
    assert (
        pickle.loads(pickle.dumps(uncertain[0].words["frequency"])).reason == "frequency uncertain beyond its bandwidth"
    )


@pytest.mark.parametrize(("error", "word"), [(0.33, "good"), (0.34, "look"), (0.99, "look"), (1.01, "doubtful")])
def test_a_shape_is_trusted_by_its_own_deviation(error: float, word: str) -> None:
    """The MAC with the true shape is 1 / (1 + e^2): .9 at a third, a half at 1."""
    modes = known()
    each = error * np.linalg.norm(modes.shapes, axis=0) / np.sqrt(len(modes.shapes))
    known_shapes = replace(modes, shapes_std=np.broadcast_to(each, modes.shapes.shape))
    assert {mode.words["shape"] for mode in known_shapes} == {word}
    assert {mode.grade for mode in known_shapes} == {word}


def test_shapes_without_a_known_deviation_want_a_look() -> None:
    modes = replace(known(), shapes_std=np.full(known().shapes.shape, np.nan))
    assert {mode.words["shape"].reason for mode in modes} == {"deviation of the shape not known"}


def test_rules_concern_the_quantities_that_they_are_about() -> None:
    modes = known()
    shapes = np.array(modes.shapes, dtype=complex)
    shapes[:, 0] = np.exp(1j * np.pi / 2 * np.arange(len(shapes)))
    assert tuple(replace(modes, shapes=shapes)[0].words.values()) == ("good", "good", "look")
    failed = grades(modes, np.array([False, *[True] * 4]))
    assert [tuple(grade.words.values()) for grade in failed][:2] == [("look", "look", "good"), ("good", "good", "good")]
