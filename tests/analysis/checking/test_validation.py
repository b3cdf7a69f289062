"""Modes tried on what they were not fitted to: true modes explain it as well as where they were, one input's own mode does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from tests.support import FIVE, add_noise, refused

POLES = FIVE["chain5"]().modes().poles


def modes(own: float = 0.0) -> ms.ModalModel:
    """Return five modes of five outputs and four inputs; the part `own` of the third belongs to the first input alone."""
    shapes = np.random.default_rng(5).standard_normal((5, 5))
    participation = np.array(shapes[:4].T)
    participation[2, 1:] *= 1 - own
    return ms.ModalModel(poles=POLES, shapes=shapes, participation=participation)


def lines(seed: int = 0, decibel: float = 40) -> ms.FrequencyResponse:
    return add_noise(modes().frequency_response(np.linspace(0.3, 8, 170)), decibel, seed)


@pytest.mark.parametrize("leaving", ["inputs", "outputs"])
def test_true_modes_explain_what_they_were_not_fitted_to_up_to_the_noise(leaving: str) -> None:
    seen = ms.validate(lines(), modes(), leaving=leaving)
    assert len(seen.parts) == (4 if leaving == "inputs" else 5)
    # noise of 1 % is left in either case
    assert np.all(np.abs(seen.fit_errors / 0.01 - 1) < 0.1)
    assert np.all(seen.fit_errors >= 0.999 * seen.fit_errors_with)
    assert seen.white
    assert str(seen.notes[0]).endswith("residual of all white")
    assert len(seen.table().splitlines()) == len(seen.parts) + 2


@pytest.mark.slow
def test_the_deviation_by_leaving_out_is_that_of_the_refinement() -> None:
    ratios = []
    for seed in range(5):
        data = lines(seed)
        seen, found = ms.validate(data, modes(), leaving="outputs"), ms.refine(data, modes())
        ratios += [getattr(seen, name) / getattr(found, name) for name in ("frequencies_std", "damping_ratios_std")]
    # five parts a set know a deviation to a third, 25 sets of two values to 7 %; shapes that are small in four outputs cost more
    assert 0.75 < np.median(ratios) < 1.4


def test_what_one_input_alone_shows_is_explained_worse_where_that_is_left_out() -> None:
    """A pole that lies elsewhere for one input: a roving mass. The others do not know it."""
    truth = modes()
    shifted = ms.ModalModel(poles=POLES * 1.01, shapes=truth.shapes, participation=truth.participation)
    f = np.linspace(0.3, 8, 170)
    values = np.array(truth.frequency_response(f).values)
    values[:, :, 0] = shifted.frequency_response(f).values[:, :, 0]
    data = add_noise(ms.FrequencyResponse(values=values, frequencies=f), 40, 0)
    seen = ms.validate(data, truth)
    assert int(np.argmax(seen.fit_errors)) == 0
    assert seen.fit_errors[0] > seen.fit_errors_with[0]
    assert not seen.white
    assert "parts" in repr(seen)
    assert repr(seen).endswith("residual coloured>")


def test_what_cannot_be_left_out_is_refused_in_words() -> None:
    few = lines().select(inputs=[0, 1])
    with pytest.raises(ms.DataError, match="there are 2"):
        ms.validate(few, modes().select(inputs=[0, 1]))
    record = ms.systems.chain5().simulate(inputs="ambient", samples=2000, sampling_rate=20.0, seed=0)
    with pytest.raises(ms.DataError, match="correlations or records"):
        ms.validate(record, modes())


def test_modes_of_which_none_is_significant_are_asked_for() -> None:
    response = lines()
    noise = np.random.default_rng(1).standard_normal((2, *response.values.shape))
    refused(
        "none of the 5 given ones is significant",
        ms.validate,
        replace(response, values=noise[0] + 1j * noise[1]),
        modes(),
    )
