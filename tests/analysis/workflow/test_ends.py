"""A band is fitted with lines beyond its ends, to where the response is least, and reported to the ends that were asked."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow import bands
from modalscope.systems import chain5
from tests.analysis.workflow.last_fit import part_of_a_band, record


def level(response: ms.FrequencyResponse) -> np.ndarray:
    return np.sum(
        np.abs(response.values / np.sqrt(np.mean(np.abs(response.values) ** 2, axis=(0, 2)))[:, None]) ** 2, axis=(1, 2)
    )


@pytest.mark.parametrize("ends", [(2.7, 6.0), (2.2, 4.3), (3.4, 5.0), (0.5, 6.4)])
def test_the_ends_that_are_fitted_lie_where_the_response_is_least_within_a_tenth(ends: tuple[float, float]) -> None:
    response = chain5().frequency_response(np.linspace(0.4, 7.0, 600))
    low, high = bands._fitted(response, ends)
    f, seen = response.frequencies, level(response)
    below, above = (f >= 0.9 * ends[0]) & (f <= ends[0]), (f >= ends[1]) & (f <= 1.1 * ends[1])
    assert f[below][np.argmin(seen[below])] == low
    assert f[above][np.argmin(seen[above])] == high


def test_nothing_is_fitted_beyond_data_that_are_not_cut_to_a_band() -> None:
    samples = chain5().impulse_response(200)
    assert bands._fitted(samples, (1.0, 3.0)) == (1.0, 3.0)
    assert bands._fitted(chain5().frequency_response(np.linspace(1, 3, 9)), (1.0, 3.0)) == (1.0, 3.0)
    assert bands._fitted(samples, None) is None


def test_a_record_is_fitted_beyond_a_band_too() -> None:
    data = record(93000).data
    low, high = bands._fitted(data, (10.0, 30.0))
    assert 9.0 <= low <= 10.0
    assert 30.0 <= high <= 33.0
    assert (low, high) != (10.0, 30.0)


def test_modes_beside_the_ends_are_listed_and_what_is_shown_ends_where_it_was_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # modes at 11.06 and 41.43 Hz lie within 3 % of the ends, three more just below the band
    case = part_of_a_band(94008)
    low, high = case.options["band"]
    found = ms.analyze(case.data, **case.options, orders=range(20, 45, 8))
    f = np.sort(np.abs(case.poles) / (2 * np.pi))
    true = f[(f > low) & (f < high)]
    assert found.modes.frequencies == pytest.approx(true, rel=0.002)
    shown = found.diagram
    assert shown.settings.band == (low, high)
    assert low <= shown.response.frequencies[0] < shown.response.frequencies[-1] <= high
    assert np.all((shown.frequencies >= low) & (shown.frequencies <= high))
    (terms,) = found.modes.residual_terms
    assert terms.band == pytest.approx(shown.response.span)
    monkeypatch.setattr(bands, "_BEYOND", 0.0)
    cut = ms.analyze(case.data, **case.options, orders=range(20, 45, 8)).modes
    # the lines beyond the ends tell most of the modes at them
    assert cut.frequencies_std[0] > 2 * found.modes.frequencies_std[0]


def test_several_bands_that_meet_at_a_mode_list_it_once() -> None:
    response = chain5().frequency_response(np.linspace(0.4, 7.0, 900)).select()
    at = float(chain5().modes().frequencies[2])
    found = ms.analyze(response, band=[(0.4, at - 0.01), (at - 0.01, 7.0)], orders=range(6, 31, 4))
    assert found.modes.frequencies == pytest.approx(chain5().modes().frequencies, rel=1e-4)


@pytest.mark.slow
def test_a_mode_that_stands_out_of_what_is_left_of_a_record_is_added() -> None:
    # 32.3 Hz, by 27 deviations: the orders of the diagram do not agree there
    case = record(93007)
    found = ms.analyze(case.data, **case.options)
    assert found.modes.frequencies == pytest.approx(np.sort(np.abs(case.poles)) / (2 * np.pi), rel=0.003)
    assert any(note.kind == "added" for note in found.notes)
    assert not any(note.kind == "added" for note in ms.analyze(record(93000).data).notes)


def test_a_dead_channel_is_named_with_a_band_too() -> None:
    response = chain5().frequency_response(np.linspace(0.4, 7.0, 300))
    values = np.array(response.values)
    values[:, 1] = 0
    dead = ms.FrequencyResponse(values=values, frequencies=response.frequencies)
    with pytest.raises(ms.DataError, match="output y2 is zero throughout"):
        ms.analyze(dead, band=(1.0, 5.0))
