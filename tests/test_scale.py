"""The unit of the data is none of the method's business: the same modes whatever it is, or a clear error."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5

LINES = np.linspace(0.3, 7.5, 300)
DATA = {
    "samples": chain5().impulse_response(300, noise=0.01, seed=0),
    "lines": chain5().frequency_response(LINES, quantity="acceleration", noise=0.01, seed=0),
    "ambient": chain5().simulate(inputs="ambient", samples=4000, sampling_rate=20.0),
    "records": chain5().simulate(samples=4000, sampling_rate=20.0),
}


def times(data: Any, factor: float) -> Any:
    """Return the data in another unit."""
    names = ("outputs",) if isinstance(data, ms.Signals) else ("values", "feedthrough")
    return replace(data, **{name: factor * a for name in names if (a := getattr(data, name, None)) is not None})


@pytest.mark.parametrize("name", DATA)
def test_modes_do_not_depend_on_the_unit(name: str) -> None:
    """Up to 26 decades either way, to rounding."""
    plain = ms.analyze(DATA[name], orders=range(2, 19, 2)).modes
    for power in (-26, 26):
        other = ms.analyze(times(DATA[name], 10.0**power), orders=range(2, 19, 2)).modes
        assert np.allclose(other.frequencies, plain.frequencies, rtol=1e-6)
        assert np.allclose(other.damping_ratios, plain.damping_ratios, rtol=1e-4)
        assert np.allclose(ms.mac(other.shapes, plain.shapes).diagonal(), 1, atol=1e-6)


@pytest.mark.parametrize("name", DATA)
@pytest.mark.parametrize("power", [-300, -150, -60, 60, 150, 300])
def test_a_unit_that_numbers_cannot_be_computed_in_is_an_error(name: str, power: int) -> None:
    with pytest.raises(ms.DataError, match="in another unit"):
        ms.analyze(times(DATA[name], 10.0**power), orders=range(2, 19, 2))
