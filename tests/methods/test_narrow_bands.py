"""Several bands as one result; bad bands; lines that are not in order."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import DataError, FrequencyResponse, identify
from modalscope.selection.judging.bands import merge_bands
from tests.support import FIVE


def test_overlapping_bands_give_each_mode_once() -> None:
    s = FIVE["chain5"]()
    frf = s.frequency_response(np.linspace(0.3, 8, 600))
    bands = [(0.5, 3.0), (2.0, 5.6), (5.0, 7.0)]
    merged = merge_bands([identify(frf, order=10, band=band).modes for band in bands], bands)
    assert len(merged) == 5
    assert np.allclose(merged.frequencies, s.modes().frequencies, rtol=1e-8)
    assert merged.participation is not None
    assert set(merged.indicators) >= {"emac", "mpc"}
    assert "merged from bands 0.5 to 3 Hz" in merged.processing[-1]


def test_repeated_modes_of_one_band_stay_apart() -> None:
    modes = FIVE["ring5"]().modes()
    assert len(merge_bands([modes, modes], [(0, 4), (3, 8)])) == 5


def test_bands_and_lines_that_cannot_be_used() -> None:
    frf = FIVE["chain5"]().frequency_response(np.linspace(0.5, 7, 80))
    with pytest.raises(DataError, match="none of them inside"):
        identify(frf, order=10, band=(20, 30))
    with pytest.raises(DataError, match="it does not increase"):
        identify(frf, order=10, band=(5, 2))
    swapped = np.r_[frf.frequencies[:40], frf.frequencies[38:78]]
    with pytest.raises(DataError, match=r"increasing lines.*line 40 \(3.62"):
        FrequencyResponse(values=frf.values, frequencies=swapped)
    with pytest.raises(DataError, match="increasing lines"):
        FrequencyResponse(values=frf.values, frequencies=frf.frequencies[::-1])
    bare = FrequencyResponse(values=frf.values, frequencies=frf.frequencies)
    with pytest.raises(DataError, match="initial_values='rest': the quantity"):
        identify(bare, method="era", domain="s", order=10, initial_values="rest")


def test_a_dc_line_does_no_harm() -> None:
    s = FIVE["chain5"]()
    for quantity in ("displacement", "velocity", "acceleration"):
        found = identify(s.frequency_response(np.linspace(0, 8, 161), quantity=quantity), order=10)
        assert np.allclose(found.modes.frequencies, s.modes().frequencies, rtol=1e-9)
