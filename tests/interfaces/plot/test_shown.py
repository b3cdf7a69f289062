"""`.plot()` draws what a thing is."""

from __future__ import annotations

from typing import Any

import pytest

import modalscope as ms
from tests.interfaces.plot import examples
from tests.support import refused

CHAIN = ms.systems.chain5()
RECORD = CHAIN.simulate(samples=600, sampling_rate=20.0)


@pytest.mark.parametrize(
    ("thing", "label"),
    [
        (examples.diagram(), "model order (states)"),
        (examples.modes(), ""),
        (examples.diagram().response, "singular values"),
        (RECORD, "singular values"),
        (ms.Records(runs=(RECORD, RECORD)), "singular values"),
        (CHAIN.simulate(inputs="ambient", samples=600, sampling_rate=20.0), "power spectral density"),
        (CHAIN.state_space(dt=0.05), "imaginary part"),
        (ms.identify(CHAIN.impulse_response(60), method="era", order=10), "singular values"),
        (ms.Geometry(nodes=[1, 2], coordinates=[[0, 0, 0], [1, 0, 0]], lines=[[1, 2]]), ""),
    ],
    ids=lambda value: type(value).__name__,
)
def test_each_kind_has_its_picture(thing: Any, label: str) -> None:
    from matplotlib import pyplot

    assert label in thing.plot().get_ylabel()
    pyplot.close("all")


def test_what_has_no_picture_says_so() -> None:
    from modalscope.interfaces.plot.shown import drawn

    refused("has none", drawn, 3)
