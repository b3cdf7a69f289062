"""Groups of inputs and runs: their default, and what keeps them."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import identify, merge
from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, Signals
from tests.support import FIVE

LINES = np.linspace(0.5, 4, 8)


def response(inputs: int = 4, **fields: object) -> FrequencyResponse:
    values = np.exp(1j * np.arange(8 * 2 * inputs)).reshape(8, 2, inputs)
    return FrequencyResponse(values=values, frequencies=LINES, **fields)  # type: ignore[arg-type]


def test_four_inputs_are_groups_and_three_are_not() -> None:
    assert response(4).groups == ("u1", "u2", "u3", "u4")
    assert response(3).groups is None
    assert response(4, groups=None).groups is None
    assert response(2, groups=["left", "right"]).groups == ("left", "right")
    assert ImpulseResponse(values=np.ones((3, 1, 4)), sampling_rate=1.0).groups == ("u1", "u2", "u3", "u4")
    assert Signals(outputs=np.ones((3, 1)), sampling_rate=1.0).groups is None
    assert Signals(outputs=np.ones((2, 3, 1)), sampling_rate=1.0).groups == ("run 1", "run 2")


def test_groups_stay_with_their_inputs() -> None:
    frf = response(4, groups=["a", "a", "b", "c"])
    assert frf.select(inputs=[3, 0]).groups == ("c", "a")
    assert frf.select(exclude="u1").band(1, 3).groups == ("a", "b", "c")
    assert frf.to_impulse_response().groups == frf.groups
    assert frf.to_impulse_response().to_frequency_response().groups == frf.groups
    assert response(4, groups=None).select(inputs=[0, 1, 2]).groups is None
    assert frf.at_lines(slice(0, 3)).processed("cut").groups == frf.groups


def test_merged_inputs_keep_their_groups() -> None:
    parts = [response(2, input_dofs=pair) for pair in (["1Z", "2Z"], ["3Z", "4Z"])]
    assert merge(parts).groups == ("1:+Z", "2:+Z", "3:+Z", "4:+Z")
    named = [response(2, input_dofs=["1Z", "2Z"], groups=["left", "left"]), parts[1]]
    assert merge(named).groups == ("left", "left", "3:+Z", "4:+Z")
    assert merge([parts[0], response(1, input_dofs=["3Z"])]).groups is None


def test_inputs_and_outputs_may_change_places() -> None:
    """What turns a response around, with other numbers of inputs than outputs, does not trip over its groups."""
    pulse = FIVE["chain5"]().impulse_response(60, sampling_rate=20.0, outputs=[0, 1], inputs=range(5))
    assert pulse.groups is not None
    assert len(identify(pulse, method="polyreference", form="controllable", order=10).modes)


@pytest.mark.parametrize(
    ("groups", "message"),
    [
        (["a"], "groups needs 4 labels, one per input, but 1 are given"),
        ("runs", "groups needs one label per input"),
        (3, "groups needs one label per input"),
    ],
)
def test_groups_that_do_not_fit_are_refused(groups: object, message: str) -> None:
    with pytest.raises(DataError, match=message):
        response(4, groups=groups)
