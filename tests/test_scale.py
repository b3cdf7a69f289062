"""The unit of the data is none of the method's business: the same modes whatever it is, or a clear error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope import preprocess
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


@pytest.mark.slow
@pytest.mark.parametrize("name", DATA)
def test_modes_do_not_depend_on_the_unit(name: str) -> None:
    """Up to 26 decades either way for records and 56 for responses, to rounding."""
    plain = ms.analyze(DATA[name], orders=range(2, 19, 2)).modes
    for power in (-26, 26) if isinstance(DATA[name], ms.Signals) else (-56, 56):
        other = ms.analyze(times(DATA[name], 10.0**power), orders=range(2, 19, 2)).modes
        assert np.allclose(other.frequencies, plain.frequencies, rtol=1e-6)
        assert np.allclose(other.damping_ratios, plain.damping_ratios, rtol=1e-4)
        assert np.allclose(ms.mac(other.shapes, plain.shapes).diagonal(), 1, atol=1e-6)


@pytest.mark.parametrize("name", DATA)
@pytest.mark.parametrize("power", [-300, -150, -70, 70, 150, 300])
def test_a_unit_that_numbers_cannot_be_computed_in_is_an_error(name: str, power: int) -> None:
    with pytest.raises(ms.DataError, match="in another unit"):
        ms.analyze(times(DATA[name], 10.0**power), orders=range(2, 19, 2))


#: What is computed of data, the power of their unit that it goes with, and where its numbers are.
VERBS: dict[str, tuple[str, Callable[[Any], Any], int]] = {
    "correlation": ("ambient", lambda data: ms.estimate_correlation(data).values, 2),
    "blocks of correlation": (
        "ambient",
        lambda data: preprocess.correlation_blocks(data, references=None, lags=20, blocks=4)[0],
        2,
    ),
    "singular values": ("ambient", lambda data: preprocess.decomposition(data).singular_values, 2),
    "frequency response": ("records", lambda data: ms.estimate_frf(data).values, 1),
    "Markov parameters": ("records", lambda data: ms.estimate_markov(data, observer_order=10).values, 1),
    "local models": ("records", lambda data: preprocess.local_models(data).values, 1),
    "coherence": ("records", lambda data: ms.estimate_frf(data).coherence, 0),
    "findings": ("records", lambda data: len(preprocess.examine(data)), 0),
    "residues": ("lines", lambda data: ms.fit_residues(data, chain5().modes()).residues, 1),
    "indicator function": ("lines", lambda data: ms.indicators.mmif(data)[0], 0),
    "dwell": ("lines", lambda data: ms.tuned_dwell(data).modes.frequencies, 0),
    "half spectra": ("correlation", lambda data: preprocess.half_spectra(data).values, 1),
}
DATA_OF_VERBS = {**DATA, "correlation": ms.estimate_correlation(DATA["ambient"])}


@pytest.mark.parametrize("name", VERBS)
def test_what_is_computed_goes_with_the_unit_or_the_unit_is_an_error(name: str) -> None:
    """In powers of two, so to rounding alone; beyond, squares of small numbers would be zero without a word."""
    of, verb, goes = VERBS[name]
    data = DATA_OF_VERBS[of]
    plain = verb(data)
    for power in (-80, 80):
        assert np.allclose(verb(times(data, 2.0**power)), plain * 2.0 ** (goes * power), rtol=1e-9)
    for power in (-900, -400, 400, 900):
        with pytest.raises(ms.DataError, match="in another unit"):
            verb(times(data, 2.0**power))
