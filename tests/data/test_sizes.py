"""Numbers beyond which powers are no numbers are found wherever they stand."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import DataError, ImpulseResponse, Signals
from modalscope.data.sizes import check_size


@pytest.mark.parametrize("samples", [2, 63, 64, 65, 200])
@pytest.mark.parametrize("factor", [1e31, -1e31])
def test_a_number_that_is_too_large_is_found_in_every_channel_and_place(samples: int, factor: float) -> None:
    rng = np.random.default_rng(0)
    for channel in range(3):
        for place in {0, samples // 2, samples - 1}:
            y = rng.uniform(0.5, 1, (samples, 3))
            check_size(Signals(outputs=y, sampling_rate=1.0))
            y[place, channel] *= factor
            with pytest.raises(DataError, match=f"channel y{channel + 1} is "):
                check_size(Signals(outputs=y, sampling_rate=1.0))


def test_channels_too_small_are_found_in_runs_and_responses() -> None:
    y = np.ones((3, 70, 2))
    y[:, :, 1] = 1e-31
    with pytest.raises(DataError, match="channel y2 is 1e-31"):
        check_size(Signals(outputs=y, sampling_rate=1.0))
    values = np.ones((70, 2, 3))
    values[:, 1] *= -1e-61
    with pytest.raises(DataError, match="channel y2 is 1e-61"):
        check_size(ImpulseResponse(values=values, sampling_rate=1.0))
    y[:, :, 1] = 0  # of nothing no power is taken
    check_size(Signals(outputs=y, sampling_rate=1.0))
