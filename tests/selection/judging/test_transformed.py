"""Samples that were made of lines: what they say against noise is asked of the lines, so that every row is held against the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import FrequencyResponse
from tests.selection.judging.hard import Structure, gains_of, lines_of, random_structure, score

BEAM = Path(__file__).parents[3] / "examples" / "beam_hammer" / "beam_hammer.uff"


def even_lines(structure: Structure, decibel: float, seed: int) -> tuple[FrequencyResponse, np.ndarray]:
    """A noisy response on multiples of a step, not from zero: what can be made to samples; and the deviation of a real row of a channel."""
    low, high = (k * np.abs(structure.poles) / (2 * np.pi) for k in (0.7, 1.15))
    step = (high.max() - low.min()) / 499
    f = step * np.arange(round(low.min() / step), round(high.max() / step) + 1)
    H, rng = lines_of(structure, f), np.random.default_rng([seed, 3])
    sigma = np.sqrt(np.mean(np.abs(H) ** 2, axis=0) / 2) * 10 ** (-decibel / 20)
    H = H + sigma * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    return FrequencyResponse(values=H, frequencies=f, quantity=structure.quantity), sigma


@pytest.mark.slow
@pytest.mark.parametrize("decibel", [40, 20])
def test_lists_of_hard_structures_are_complete_from_transformed_lines(decibel: float) -> None:
    for seed in range(8700, 8703):
        structure = random_structure(seed)
        response, sigma = even_lines(structure, decibel, seed)
        found = score(structure, ms.select(ms.stabilize(response, domain="time")))
        assert found.perfect(gains_of(structure, response, sigma) > 30)


def test_a_mode_explains_as_much_whether_its_row_saw_lines_or_samples_made_of_them() -> None:
    response = even_lines(random_structure(8700), 30, 1)[0]
    lines, samples = (
        ms.select(ms.stabilize(response, method="alternate", domain=d, orders=range(10, 41, 6))) for d in ("s", "time")
    )
    assert len(lines) == len(samples)
    assert lines.gain is not None
    assert samples.gain is not None
    # the noise is that of a richer model, each row's own: known to a part of some hundred values
    assert np.allclose(samples.gain, lines.gain, rtol=0.02)
    # poles of samples made of a band are biased, and stay the row's own
    assert not np.allclose(samples.poles, lines.poles, rtol=1e-9)


def test_a_diagram_holds_the_lines_that_its_samples_were_made_of_and_no_other_data() -> None:
    response = even_lines(random_structure(8701), 40, 1)[0]
    low, high = response.frequencies[20], response.frequencies[-20]
    made = ms.stabilize(response, domain="time", band=(low, high), orders=[4, 6, 8])
    assert made.measured is not None
    assert made.measured is made.as_measured
    assert (made.response.grid, made.measured.span) == (None, (low, high))
    lines = ms.stabilize(response, domain="s", orders=[4, 6, 8])
    assert (lines.measured, lines.as_measured) == (None, lines.response)
    samples = response.to_impulse_response()
    measured = ms.stabilize(samples, orders=[4, 6, 8])
    assert (measured.measured, measured.as_measured) == (None, measured.response)
    # a transform of measured samples has lines, whose errors the likelihood of lines knows
    assert ms.stabilize(replace(samples, kind="pulse"), domain="z", orders=[4, 6, 8]).measured is None


@pytest.mark.slow
@pytest.mark.parametrize("method", ["alternate", "prce"])
def test_the_beam_by_rows_on_samples_has_its_modes_once_each(method: str) -> None:
    orders = range(12, 73, 6) if method == "prce" else range(2, 41, 2)
    diagram = ms.stabilize(ms.read(BEAM), method=method, domain="time", band=(100, 1700), orders=orders)
    modes = ms.select(diagram)
    # 569.9 Hz is a small mode that the hammer shows at its third point alone
    for f in (177.1, 477.4, 933.1, 1376.7, 1535.3):
        assert np.sum(np.abs(modes.frequencies / f - 1) < 0.002) >= 1
    # prce truncates nothing: noise moves its poles, and a few of the test's own lines are left among them; before there were 26
    others = len(modes) - int(np.any(np.abs(modes.frequencies / 569.9 - 1) < 0.002))
    assert others == 5 if method == "alternate" else others < 10


def test_samples_of_a_band_have_no_exact_rank_and_those_of_all_lines_have() -> None:
    # nothing lies below the band, so that few rows of the Hankel matrix are dependent to rounding, noise and all
    band = even_lines(random_structure(9047), 40, 9047)[0]
    assert ms.stabilize(band, method="prce", domain="time").exact_rank is None
    sampled = ms.systems.chain5().state_space(dt=0.05).impulse_response(3999).to_frequency_response()
    assert sampled.exact_samples
    assert ms.stabilize(sampled, domain="time", orders=range(2, 21, 2)).exact_rank == 10
