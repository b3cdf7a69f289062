"""Modes of another program or test paired with those of a diagram."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.selection.judging.evidence import Candidate, Own
from modalscope.selection.judging.outcome import paired_with
from modalscope.selection.judging.tracking import Poles
from tests.support import add_noise

BUILDING = ms.systems.chain5()


@pytest.fixture(scope="module")
def diagram() -> ms.StabilizationDiagram:
    clean = BUILDING.frequency_response(np.linspace(0.3, 8, 300), quantity="acceleration")
    return ms.stabilize(add_noise(clean, 40, np.random.default_rng(0)))


def test_modes_are_paired_with_a_reference_and_say_by_how_much_they_differ(diagram):
    truth = BUILDING.modes()
    found = ms.select(diagram, reference=truth)
    assert len(found) == 5
    for j, why in enumerate(found.reasons):
        assert why["reference_frequency_hz"] == truth.frequencies[j]
        assert why["frequency_difference_hz"] == pytest.approx(found.frequencies[j] - truth.frequencies[j])
        assert why["damping_ratio_difference"] == pytest.approx(found.damping_ratios[j] - truth.damping_ratios[j])
        assert why["reference_mac"] > 0.99
        # the truth has no deviation of its own
        told = abs(why["frequency_difference_hz"]) / found.frequencies_std[j]
        assert why["frequency_difference_in_deviations"] == pytest.approx(told)
        assert why["frequency_difference_in_deviations"] < 5


def test_deviations_of_both_count(diagram):
    truth = BUILDING.modes()
    wide = replace(truth, frequencies_std=np.full(5, 3.0), damping_ratios_std=np.full(5, np.nan))
    found = ms.select(diagram, reference=wide)
    both = np.hypot(3.0, found.frequencies_std[0])
    why = found.reasons[0]
    assert why["frequency_difference_in_deviations"] == pytest.approx(abs(why["frequency_difference_hz"]) / both)
    assert why["damping_ratio_difference_in_deviations"] == pytest.approx(
        abs(why["damping_ratio_difference"]) / found.damping_ratios_std[0]
    )


def test_what_has_no_partner_is_told_on_either_side(diagram):
    truth = BUILDING.modes()
    shifted = replace(truth, poles=np.where(np.arange(5) == 2, truth.poles * 1.3, truth.poles))
    found = ms.select(diagram, reference=shifted)
    assert np.allclose(found.frequencies, np.delete(truth.frequencies, 2), rtol=1e-3)
    assert f"not found: {shifted.frequencies[2]:.5g} Hz" in " ".join(str(note) for note in found.notes)
    left = [c for c in found.left_out if c.reason == "not a mode of the reference"]
    assert [round(c.frequency, 2) for c in left] == [round(float(truth.frequencies[2]), 2)]


def test_a_reference_of_other_outputs_is_paired_by_frequency(diagram):
    truth = BUILDING.modes()
    fewer = ms.ModalModel(poles=truth.poles, shapes=truth.shapes[:2])
    found = ms.select(diagram, reference=fewer)
    assert len(found) == 5
    assert {why["reference_mac"] for why in found.reasons} == {1.0}


def test_the_more_alike_shape_is_the_partner_of_two_at_one_frequency(diagram):
    truth = BUILDING.modes()
    wrong = replace(truth.take([0, 0]), poles=truth.poles[[0, 0]], shapes=truth.shapes[:, [3, 0]])
    found = ms.select(diagram, reference=wrong)
    assert len(found) == 1
    assert found.reasons[0]["reference_mac"] > 0.99


def test_a_reference_beside_modes_by_hand_is_refused(diagram):
    with pytest.raises(ms.DataError, match="the reference already states the whole list"):
        ms.select(diagram, reference=BUILDING.modes(), frequencies=[1.0])
    with pytest.raises(ms.DataError, match="reference"):
        ms.select(diagram, reference=[1.0])


def test_a_rejected_candidate_is_a_partner_only_where_no_other_is() -> None:
    truth = BUILDING.modes().take([0, 1])
    nothing = np.zeros((0, len(truth.shapes)), complex)
    none = Poles((10,), np.zeros(0, int), np.zeros(0, complex), nothing, nothing, np.zeros(0))

    def candidate(mode: int, away: float, *against: str) -> Candidate:
        own = Own(truth.shapes[:, mode], np.zeros(2, complex), 0.0, 0.0)
        f, zeta = float(truth.frequencies[mode]) * (1 + away), float(truth.damping_ratios[mode])
        return Candidate(np.zeros(0, int), f, zeta, {}, against, own=own)

    near, far, alone = candidate(0, 0.0, "weak"), candidate(0, 0.004), candidate(1, 0.002, "weak")
    pairs = paired_with(truth, [near, far, alone], none, 0.01)
    assert [(pair[0] is far, pair[0] is alone, pair[1]) for pair in pairs] == [(True, False, 0), (False, True, 1)]
