"""What a plan says of the work, against what the work is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from modalscope import FrequencyResponse, ImpulseResponse, Signals, stabilize
from modalscope.data import DataError
from modalscope.identification.plan import plan
from modalscope.numerics.resources import allowed_memory, check_fits, in_words, set_allowed_memory
from tests.support import FIVE


def noise_lines(outputs: int, inputs: int, lines: int = 200) -> FrequencyResponse:
    rng = np.random.default_rng(0)
    values = rng.standard_normal((lines, outputs, inputs)) + 1j * rng.standard_normal((lines, outputs, inputs))
    return FrequencyResponse(values=values, frequencies=np.linspace(1, 50, lines), quantity="displacement")


def noise_samples(outputs: int, inputs: int, samples: int = 120) -> ImpulseResponse:
    values = np.random.default_rng(0).standard_normal((samples, outputs, inputs))
    return ImpulseResponse(values=values, sampling_rate=1.0)


@pytest.mark.parametrize(
    ("data", "options", "words"),
    [
        (noise_lines(10, 3), {}, "structured Gram matrix"),
        (noise_lines(200, 3), {}, "structured Gram matrix"),
        (
            noise_samples(30, 4, 240),
            {"method": "era", "block_rows": 40, "block_columns": 100},
            "structured Gram matrix",
        ),
        (noise_samples(200, 1), {"method": "alternate"}, "dense"),
    ],
)
def test_a_plan_names_the_matrix_and_the_way_that_are_taken(data, options: dict[str, Any], words: str) -> None:  # type: ignore[no-untyped-def]
    found = plan(data, orders=[2, 4, 6], **options)
    diagram = stabilize(data, orders=[2, 4, 6], deviations=False, **options)
    told = str(diagram.notes)
    assert found.matrix.split(";")[0] in told
    assert ("combinations" in found.matrix) == ("combinations" in told)
    assert found.way is not None
    assert words in told
    assert words.startswith({"gram": "structured", "dense": "dense"}[found.way.route])
    assert found.fits
    assert "<- taken" in str(found)


def test_more_orders_more_lines_and_more_outputs_take_longer() -> None:
    base = plan(noise_lines(10, 2), orders=[10, 20])
    assert plan(noise_lines(10, 2), orders=[10, 20, 30]).seconds > base.seconds
    assert plan(noise_lines(10, 2, 400), orders=[10, 20]).seconds > base.seconds
    assert plan(noise_lines(40, 2), orders=[10, 20]).memory > base.memory


def test_what_does_not_fit_is_said() -> None:
    try:
        set_allowed_memory(300_000)
        found = plan(noise_lines(10, 3), orders=[20])
        assert not found.fits
        assert found.way is None
        assert "Not enough memory" in str(found)
        with pytest.raises(DataError, match=r"takes about .* of memory, of 300 kB"):
            stabilize(noise_lines(10, 3), orders=[20])
    finally:
        set_allowed_memory(None)
    assert allowed_memory() > 10_000_000
    check_fits("little", 1000, "Nothing.")
    assert in_words(2.5e9) == "2.5 GB"


def test_every_kind_of_data_has_a_plan() -> None:
    records = Signals(outputs=np.random.default_rng(0).standard_normal((3000, 3)), sampling_rate=10.0)
    assert "correlat" in plan(records).data or plan(records).orders[-1] == 40
    sampled = FIVE["chain5"]().state_space(dt=0.05).impulse_response(200)
    for method in ("era", "polyreference", "prce", "alternate"):
        assert plan(sampled, method=method, orders=[10]).seconds > 0
    assert plan(noise_lines(4, 1), method="lscf", orders=[5, 10]).ways == ()


def test_a_plan_counts_the_inputs_of_records() -> None:
    run = FIVE["chain5"]().simulate(inputs="white", at=[0, 1], samples=600, sampling_rate=12.0, seed=0)
    assert "of 4 outputs and 2 inputs" in plan(run, orders=[10]).data
    assert "of 4 outputs and 1 input (" in plan(run.select(inputs=[0]), orders=[10]).data
