"""A simulated test with nothing set: its lines or its rate hold all modes of the structure."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import systems
from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, Signals
from modalscope.systems.listing import KINDS, trial

EXPECTED = {"frf": FrequencyResponse, "impulse": ImpulseResponse, "records": Signals, "ambient": Signals}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["chain5", "over4", "clamped_beam"])
def test_all_modes_lie_in_the_band(name: str, kind: str) -> None:
    structure = systems.build(name)
    data, f = trial(structure, kind, samples=50), structure.modes().frequencies
    assert type(data) is EXPECTED[kind]
    if isinstance(data, FrequencyResponse):
        assert data.frequencies[0] < f.min() <= f.max() < data.frequencies[-1]
    else:
        assert data.sampling_rate >= 2.56 * f.max()
    assert isinstance(data, Signals) is (kind in ("records", "ambient"))
    assert (getattr(data, "inputs", 0) is None) == (kind == "ambient")


def test_noise_has_the_ratio_that_was_asked_and_repeats() -> None:
    chain = systems.chain5()
    clean, noisy, again = (trial(chain, "impulse", snr_db=snr) for snr in (None, 20.0, 20.0))
    added = np.sqrt(np.mean((noisy.values - clean.values) ** 2, axis=0) / np.mean(clean.values**2, axis=0))
    # 2000 samples tell a standard deviation to 1.6 %: four of these
    np.testing.assert_allclose(added, 0.1, rtol=0.065)
    np.testing.assert_array_equal(noisy.values, again.values)


def test_what_cannot_be_tried_is_refused() -> None:
    with pytest.raises(DataError, match="Did you mean 'impulse'"):
        trial(systems.chain5(), "impulses")
    with pytest.raises(DataError, match="samples needs a whole number of at least 2"):
        trial(systems.chain5(), samples=1)
