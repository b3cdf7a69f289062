"""Responses rebuilt from modes where the data have a window's damping that the modes have not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data.rebuilt import fit_error, fit_error_of, fit_of
from modalscope.data.response import Response
from modalscope.systems import chain5

MODES = replace(chain5().modes(), feedthrough=None)
WINDOW = 0.4
WINDOWED = replace(MODES, poles=MODES.poles - WINDOW)


@pytest.mark.parametrize(
    "data",
    [
        WINDOWED.impulse_response(300, 20.0, first_sample=7),
        replace(WINDOWED.frequency_response(np.linspace(0.1, 9, 300)), quantity=None),
    ],
    ids=["samples that begin late", "lines"],
)
def test_modes_rebuild_data_under_a_window_to_the_last_digit(data: Response) -> None:
    told = replace(data, added_damping=WINDOW)
    assert fit_of(MODES, told) < 1e-9
    # without the window nothing fits: decays of the data are up to thirty times those of the modes
    assert fit_of(MODES, data) > 0.5


def test_the_fit_error_is_the_norm_of_what_is_left_over_that_of_the_data() -> None:
    measured = np.array([[[3.0, 0.0]], [[4.0, 2.0]]])
    whole, channel = fit_error(measured, np.array([[[3.0, 0.0]], [[0.0, 1.0]]]))
    assert whole == pytest.approx(np.sqrt(17 / 29))
    assert channel == pytest.approx(np.array([[0.8, 0.5]]))


def test_pieces_give_the_fit_error_of_the_whole() -> None:
    model = chain5().state_space(dt=0.05)
    data = model.impulse_response(301)
    noisy = replace(data, values=data.values + 0.1 * np.random.default_rng(0).standard_normal(data.values.shape))
    whole, channel = fit_error(noisy.values, noisy.values_of(model))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(
            "modalscope.data.responses.HELD", 7 * noisy.values[0].size
        )  # pieces of sixteen samples, the fewest
        pieces = list(noisy.with_model(model))
    assert len(pieces) == 19
    found, by_channel = fit_error_of(pieces)
    assert found == pytest.approx(whole, rel=1e-12)
    assert by_channel == pytest.approx(channel, rel=1e-12)
    assert np.concatenate([rebuilt for _, rebuilt in pieces]) == pytest.approx(data.values, abs=1e-12)
