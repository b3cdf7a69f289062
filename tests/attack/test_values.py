"""Values that mean nothing are answered where they come in: by what was expected, and at once."""

from __future__ import annotations

import time
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest

import modalscope as ms

ENDLESS = range(10**12)
HUGE = 10**9
CHAIN = ms.systems.chain5()
SIGNALS = np.ones((9, 2))


@cache
def lines() -> ms.FrequencyResponse:
    return CHAIN.frequency_response(np.linspace(0.2, 8, 120), quantity="acceleration", noise=0.02, seed=1)


@cache
def samples() -> ms.ImpulseResponse:
    return CHAIN.impulse_response(300, noise=0.01, seed=0)


@cache
def record() -> ms.Signals:
    return CHAIN.simulate(samples=1000, sampling_rate=20.0, noise=0.02, seed=0)


@cache
def correlation() -> ms.ImpulseResponse:
    return ms.preprocess.estimate_correlation(record(), lags=100)


def signals(**fields: Any) -> Any:
    return ms.Signals(**{"outputs": SIGNALS, "sampling_rate": 1.0, **fields})


#: Call, and what its message names.
CALLS: dict[str, tuple[Callable[[], Any], str]] = {
    "labels without end": (lambda: signals(output_dofs=ENDLESS), "output_dofs needs labels, at most"),
    "units without end": (lambda: signals(units=ENDLESS), "units needs"),
    "quantities without end": (lambda: signals(quantities=ENDLESS), "quantities needs"),
    "samples without end": (lambda: signals(outputs=ENDLESS), "outputs needs axes"),
    "lines without end": (lambda: CHAIN.frequency_response(ENDLESS), "frequencies needs axes"),
    "nodes without end": (lambda: ms.Geometry(nodes=ENDLESS, coordinates=np.ones((3, 3))), "nodes needs names"),
    "orders without end": (lambda: ms.analyze(lines(), orders=ENDLESS), "orders needs whole numbers, at most 10000"),
    "10 001 orders": (lambda: ms.stabilize(lines(), orders=range(2, 10_003)), "there are 10001"),
    "channels without end": (lambda: ms.analyze(lines(), exclude=ENDLESS), "exclude needs labels"),
    "outputs without end": (lambda: lines().select(outputs=ENDLESS), "needs labels, at most"),
    "frequencies without end": (lambda: ms.analyze(lines(), frequencies=ENDLESS), "frequencies needs numbers in Hz"),
    "parts without end": (lambda: ms.merge(ENDLESS), "parts to merge"),
    "a span of time as count": (lambda: CHAIN.impulse_response(np.timedelta64(5)), "samples needs a whole number"),
    "a span of time as order": (
        lambda: ms.identify(lines(), order=np.timedelta64(8, "s")),
        "order needs a whole number",
    ),
    "a span of time as blocks": (
        lambda: ms.identify(samples(), order=10, block_rows=np.timedelta64(8)),
        "block_rows needs a whole",
    ),
    "broken orders": (
        lambda: ms.stabilize(lines(), orders=[Fraction(4), Fraction(9, 2)]),
        "order needs a whole number",
    ),
    "one number as orders": (
        lambda: ms.stabilize(lines(), orders=np.array(4)),
        "orders needs whole numbers, but it is ndarray",
    ),
    "one text as labels": (lambda: signals(output_dofs=np.array("a")), "output_dofs needs labels, but it is ndarray"),
    "one text as channels": (lambda: ms.analyze(lines(), exclude=np.array("a")), "exclude needs labels"),
    "one number as band": (lambda: ms.analyze(lines(), band=np.array(4)), "band needs two frequencies"),
    "one number to take": (lambda: ms.analyze(lines(), take=np.array(4), orders=[8]), "take needs numbers in Hz"),
    "one text as methods": (
        lambda: ms.compare(lines(), methods=np.array("era")),
        "methods needs names of rows or cells",
    ),
    "one number as shapes": (lambda: ms.indicators.mac(np.array(1.0), np.array(1.0)), "shapes_a needs axes"),
    "blocks of samples": (lambda: ms.identify(samples(), order=10, block_rows=HUGE), "block_rows=1000000000"),
    "blocks of lines": (lambda: ms.identify(lines(), order=10, block_rows=HUGE), "block_rows=1000000000"),
    "blocks of records": (lambda: ms.identify(record(), order=10, block_rows=HUGE), "GB"),
    "half spectra": (
        lambda: ms.preprocess.half_spectra(correlation(), lines=HUGE * 100),
        "half spectra on 100000000000 lines",
    ),
    "samples of a response": (lambda: CHAIN.impulse_response(10**12), "a response of 1000000000000 samples"),
    "replicates of a comparison": (
        lambda: ms.compare(lines(), methods=["era"], replicates=10**12),
        "replicates needs at most 100000",
    ),
    "replicates without end": (
        lambda: ms.certify(ms.analyze(lines(), orders=[8, 10]), replicates=10**12),
        "replicates needs at most 100000",
    ),
    "elements of a beam": (lambda: ms.systems.clamped_beam(10**12), "a beam of 1000000000000 elements"),
    "samples of a record": (
        lambda: CHAIN.simulate(samples=10**12, sampling_rate=9.0),
        "a record of 1000000000000 samples",
    ),
}


@pytest.fixture(autouse=True, scope="module")
def warm() -> None:
    """Load what calls load when they are first made."""
    ms.analyze(lines(), orders=[8, 10])
    ms.identify(record(), order=10)
    ms.compare(lines(), methods=["era"], orders=[8, 10])
    correlation()
    samples()


@pytest.mark.parametrize("name", CALLS)
def test_what_means_nothing_is_answered_at_once(name: str) -> None:
    call, words = CALLS[name]
    begun = time.process_time()
    with pytest.raises(ms.DataError) as told:
        call()
    assert words in str(told.value)
    # of records on lines the transforms come first, 0.07 s; what is not refused takes minutes
    assert time.process_time() - begun < 2


def test_one_shape_has_a_deviation_of_its_phase() -> None:
    assert ms.indicators.mpd(np.array([1.0, 2.0, -1.0])) == pytest.approx(0, abs=1e-12)


def test_what_does_not_fit_into_the_memory_is_an_error_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any, **__: Any) -> Any:
        raise MemoryError("Unable to allocate 14.6 TiB")

    monkeypatch.setattr("modalscope.systems.records._forces", full)
    with pytest.raises(
        ms.DataError, match=r"simulate\(\) needs more memory than there is.*\(Unable to allocate 14\.6 TiB\)"
    ):
        CHAIN.simulate(samples=100, sampling_rate=9.0)
