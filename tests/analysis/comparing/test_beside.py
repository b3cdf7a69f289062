"""A consensus beside the analysis of the same data: no narrower interval, the same grade."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.comparing import compare
from modalscope.analysis.comparing.beside import analysis_of, beside
from modalscope.analysis.comparing.scatter import Scatter
from modalscope.data.mode_fields import half_widths
from modalscope.data.notes import Candidate
from modalscope.interfaces.plot.methods import deviations_picture
from modalscope.interfaces.plot.web.svg import svg
from modalscope.systems import chain5
from tests.support import refused

ROWS = ["era/time", "least_squares/time", "alternate/time"]


@pytest.fixture(scope="module")
def response() -> ms.ImpulseResponse:
    return chain5().impulse_response(300, noise=0.01, seed=0)


@pytest.fixture(scope="module")
def found(response: ms.ImpulseResponse) -> ms.Result:
    return ms.analyze(response)


def widened(found: ms.Result, factor: float) -> ms.Result:
    """Return a result with deviations that are larger: refined intervals are wider than what methods scatter by."""
    modes = found.modes
    wide = {name: factor * getattr(modes, name) for name in ("frequencies_std", "damping_ratios_std")}
    return replace(found, modes=replace(modes, **wide))


def test_no_interval_is_narrower_than_that_of_the_analysis_whose_grade_a_mode_has(
    response: ms.ImpulseResponse, found: ms.Result
) -> None:
    for factor in (1e-3, 60.0):
        known = widened(found, factor)
        c = compare(response, ROWS, orders=range(2, 21, 2), analysis=known)
        assert c.analysis is known
        ours, theirs = half_widths(c.modes), half_widths(known.modes)
        for stated, own, other in zip((c.scatter.frequency, c.scatter.damping), ours, theirs, strict=True):
            np.testing.assert_allclose(stated, own, rtol=1e-9)  # the table and the modes say the same
            assert np.all(stated >= other * (1 - 1e-12))
            assert np.all(stated > 100 * other) if factor < 1 else np.allclose(stated, other)
        assert [t.grade for t in c.trust] == [mode.grade for mode in known.modes]
        assert all(t.agreed for t in c.trust)
    assert {t.grade for t in c.trust} != {"good"}  # sixty times as uncertain


def test_the_analysis_is_that_of_analyze(response: ms.ImpulseResponse, found: ms.Result) -> None:
    c = compare(response, ROWS[:1], orders=range(2, 21, 2))
    assert c.analysis is not None
    np.testing.assert_allclose(c.analysis.modes.frequencies, found.modes.frequencies, rtol=1e-5)
    refused("analysis", compare, response, ROWS[:1], analysis=found.modes)


def test_a_mode_that_the_analysis_does_not_list_is_at_best_worth_a_look(
    response: ms.ImpulseResponse, found: ms.Result
) -> None:
    modes = found.modes
    missing = modes[2]
    rest = modes.take([0, 1, 3, 4])
    assert [b.grade.word for b in beside(modes, found)] == [mode.grade for mode in modes]
    told = beside(modes, replace(found, modes=rest))[2]
    assert (told.grade.word, told.grade.reason) == ("look", "the analysis does not list it")
    assert np.isnan([told.values, told.half_widths]).all()
    half = missing.damping_ratio * missing.frequency
    for away, named in ((0.99, True), (1.01, False)):
        left = (Candidate(frequency=missing.frequency + away * half, damping_ratio=0.01, reason="too weak"),)
        told = beside(modes, replace(found, modes=replace(rest, left_out=left)))[2]
        assert ("(too weak)" in told.grade.reason) is named
    # what the consensus itself does not determine is doubtful
    wide = replace(modes, frequencies_std=2 * modes.damping_ratios * modes.frequencies)
    assert beside(wide, replace(found, modes=rest))[2].grade.word == "doubtful"


def test_without_an_analysis_no_mode_is_good_and_a_note_says_why(found: ms.Result) -> None:
    assert [b.grade.word for b in beside(found.modes, None)] == ["look"] * 5
    none, why = analysis_of(chain5().impulse_response(6, seed=0), None, [2000], {})
    assert none is None
    assert why


def test_a_mode_that_the_data_do_not_determine_has_no_interval_in_the_consensus_either(
    response: ms.ImpulseResponse, found: ms.Result
) -> None:
    degrees = np.full((5, 2), 9.0)
    degrees[1] = 0
    known = replace(found, modes=replace(found.modes, degrees=degrees))
    c = compare(response, ROWS, orders=range(2, 21, 2), analysis=known)
    assert np.isnan([c.scatter.frequency[1], c.scatter.damping[1]]).all()
    assert np.isfinite(np.delete(c.scatter.frequency, 1)).all()
    assert np.isnan(c.modes.frequencies_std[1])
    assert c.trust[1].grade == "doubtful"
    assert "nan" not in c.table().lower()
    assert "nan" not in svg(deviations_picture(c)).lower()


def test_pairs_are_one_to_one(found: ms.Result) -> None:
    """Of two modes of the consensus that both look like one of the analysis one is paired."""
    twice = found.modes.take([0, 0, 1, 2, 3, 4])
    assert sum(b.grade.reason == "the analysis does not list it" for b in beside(twice, found)) == 1


def test_half_widths_of_the_scatter_are_the_wider_ones() -> None:
    nothing = np.zeros(3)
    own = Scatter(
        np.full(3, 0.2),
        np.full(3, 0.01),
        np.r_[0.1, np.nan, np.nan],
        np.full(3, 0.005),
        *(nothing,) * 2,
        np.full(3, np.nan),
    )
    none = own.at_least(np.array([[np.inf, 0.3, np.nan], [np.nan, np.inf, 0.001]]))
    np.testing.assert_allclose(none.frequency, [np.nan, 0.3, 0.2])
    np.testing.assert_allclose(none.deviation("damping"), [0.01 / 1.96, np.nan, 0.01 / 1.96], rtol=1e-4)
    wider = own.at_least(np.array([[0.1, 0.3, np.nan], [np.nan, 0.02, 0.001]]))
    np.testing.assert_allclose(wider.frequency, [0.2, 0.3, 0.2])
    np.testing.assert_allclose(wider.damping, [0.01, 0.02, 0.01])
    np.testing.assert_allclose(wider.deviation("frequency"), [0.2 / 1.96, 0.3 / 1.96, np.nan], rtol=1e-4)
