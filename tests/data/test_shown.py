"""What data and results show of themselves: one line, a picture of bounded size, a table; nothing users wrote becomes markup."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.shown import summary_of
from modalscope.systems import chain5

CHAIN = chain5()
SAMPLES = CHAIN.impulse_response(200, noise=0.01, seed=0)
RESULT = ms.analyze(SAMPLES, orders=range(4, 15, 2))
SHOWN = {
    "lines": CHAIN.frequency_response(np.linspace(0.1, 8, 50)),
    "samples": SAMPLES,
    "records": CHAIN.simulate(samples=300, sampling_rate=20.0),
    "runs": ms.Records(runs=tuple(CHAIN.simulate(samples=n, sampling_rate=20.0) for n in (300, 400))),
    "modes": RESULT.modes,
    "diagram": RESULT.diagram,
    "result": RESULT,
    "model": CHAIN.state_space(dt=0.05),
    "identification": ms.identify(SAMPLES, method="era", order=10),
    "geometry": ms.Geometry(nodes=[1, 2], coordinates=[[0, 0, 0], [1, 0, 0]], lines=[[1, 2]]),
}


@pytest.mark.parametrize("name", SHOWN)
def test_everything_is_told_in_one_line_and_shown_as_whole_markup(name: str) -> None:
    thing = SHOWN[name]
    assert repr(thing) == f"<{summary_of(thing)}>"
    assert "\n" not in repr(thing)
    assert len(repr(thing)) < 300
    ElementTree.fromstring(thing._repr_html_())  # type: ignore[attr-defined]


def test_summaries_count_what_there_is() -> None:
    assert "50 lines from 0.1 to 8 Hz, 4 outputs, 2 inputs" in repr(SHOWN["lines"])
    assert "2 runs of 300, 400 samples at 20 Hz" in repr(SHOWN["runs"])
    assert "5 modes from 0.906 to" in repr(SHOWN["modes"])
    assert "10 states, 4 outputs, 2 inputs" in repr(SHOWN["model"])
    assert "2 nodes, 1 line, 0 faces" in repr(SHOWN["geometry"])
    assert repr(RESULT.modes[0]) == f"<mode 1: {RESULT.modes[0]}>"
    assert repr(RESULT.modes[:0]).startswith("<modes (displacement): 0 modes, ")


def test_a_table_has_a_row_a_mode() -> None:
    for name in ("modes", "result", "identification"):
        assert SHOWN[name]._repr_html_().count("<tr>") == 1 + 5  # type: ignore[attr-defined]


def test_labels_cannot_become_markup() -> None:
    modes = ms.ModalModel(
        poles=[-1 + 100j], shapes=[[1.0]], indicators={"<script>x</script>": [1.0]}, output_dofs=["<img>"]
    )
    assert not re.search(r"<script|<img", modes._repr_html_())
