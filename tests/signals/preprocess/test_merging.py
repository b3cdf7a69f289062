"""Merging by labels: runs, roving sensors under measured forces, ambient setups with common references."""

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, Signals
from modalscope.signals.preprocess import estimate_frf, merge
from modalscope.signals.preprocess.excitation import moved_by_base
from modalscope.systems import chain5
from tests.support import random_system, relative

LINES = np.linspace(1, 2, 5)


def part(outputs, inputs=("u",), value=1j, **options):
    values = np.full((5, len(outputs), len(inputs)), value)
    return FrequencyResponse(values=values, frequencies=LINES, output_dofs=outputs, input_dofs=inputs, **options)


def test_ten_runs_of_two_sensors_become_one_response_of_twenty():
    structure = chain5()
    runs, parts = [], []
    for k in range(10):
        u = np.random.default_rng(k).standard_normal((1000, 1))
        u[600:] = 0
        run = structure.simulate(inputs=u, at=[0], sampling_rate=20.0, outputs=[1, 3])
        labelled = Signals(
            outputs=run.outputs * (k + 1),
            inputs=run.inputs,
            sampling_rate=20.0,
            output_dofs=[f"{2 * k + 1}:+Z", f"{2 * k + 2}:+Z"],
            input_dofs=["shaker"],
            quantities="acceleration",
        )
        runs.append(labelled)
        parts.append(estimate_frf(labelled))
    merged = merge(runs)
    assert merged.output_dofs == tuple(f"{i}:+Z" for i in range(1, 21))
    assert merged.values.shape == (501, 20, 1)
    assert np.array_equal(merged.values, merge(parts).values)
    assert np.array_equal(merged.values[:, 6:8], parts[3].values)
    assert merged.quantity == "acceleration"


def test_roving_hammer_adds_inputs():
    merged = merge([part(["1Z", "2Z"], ["1Z"], 1j), part(["1Z", "2Z"], ["2Z"], 2j)])
    assert merged.input_dofs == ("1:+Z", "2:+Z")
    assert np.array_equal(merged.values[0], [[1j, 2j], [1j, 2j]])


def test_what_several_parts_hold_is_averaged_by_weight():
    ones = np.ones((5, 1, 1))
    a = part(["1Z"], value=1j, averages=3, variance=ones, coherence=np.full((5, 1), 0.9))
    b = part(["1Z"], value=5j, averages=1, variance=3 * ones, coherence=np.full((5, 1), 0.5))
    merged = merge([a, b])
    assert np.allclose(merged.values, 2j)
    assert np.allclose(merged.variance, (9 * 1 + 1 * 3) / 16)
    assert np.allclose(merged.coherence, 0.8)
    assert merged.averages == 1  # what holds for every channel


def test_records_of_the_same_channels_become_runs():
    a, b = (Signals(outputs=np.full((4, 2), k), inputs=np.full((4, 1), -k), sampling_rate=1.0) for k in (1.0, 2.0))
    merged = merge([a, merge([a, b])])
    assert merged.outputs.shape == (3, 4, 2)
    assert merged.inputs.shape == (3, 4, 1)
    assert merged.outputs[:, 0, 0].tolist() == [1, 1, 2]
    assert "3 runs" in merged.processing[-1]


def setups(gains):
    """Exact correlations C A^k G of two setups of one structure, outputs 0 and 1 common, driven mode by mode differently."""
    rng = np.random.default_rng(0)
    model = random_system(rng, outputs=6, inputs=2, modes=4, damping=(0.01, 0.05))
    powers = [np.linalg.matrix_power(model.A, k) for k in range(200)]
    parts, wholes = [], []
    for rows, gain in zip(([0, 1, 2, 3], [0, 1, 4, 5]), gains, strict=True):
        G = np.random.default_rng(gain).standard_normal((8, 2)) if gain else model.B
        R = np.array([model.C @ P @ G for P in powers])
        wholes.append(R)
        parts.append(
            ImpulseResponse(
                values=R[:, rows],
                sampling_rate=1.0,
                kind="correlation",
                output_dofs=[f"{r}:+X" for r in rows],
                input_dofs=["0:+X", "1:+X"],
            )
        )
    return parts, wholes


def test_setups_under_different_forces_merge_exactly():
    parts, wholes = setups([0, 7])
    merged = merge(parts)
    assert merged.output_dofs == tuple(f"{i}:+X" for i in range(6))
    count = merged.samples
    scales = [np.sqrt(np.mean(p.values[:, :2] ** 2)) for p in parts]
    expected = (wholes[0] + wholes[1] * scales[0] / scales[1])[
        :count
    ] / 2  # the references' mean, each setup at its own level
    # least squares on the singular values above rounding
    assert relative(merged.values, expected) < 1e-6


def test_ambient_records_with_common_outputs_become_one_correlation():
    structure = chain5()
    records = [
        structure.simulate(inputs="ambient", samples=60_000, sampling_rate=20.0, outputs=outputs, seed=k)
        for k, outputs in enumerate(([0, 1, 2], [0, 1, 3, 4]))
    ]
    merged = merge(records, lags=200)
    assert merged.output_dofs == ("1:+X", "2:+X", "3:+X", "4:+X", "5:+X")
    assert merged.input_dofs == ("1:+X", "2:+X")
    assert merged.kind == "correlation"


@pytest.mark.parametrize(
    ("parts", "text"),
    [
        ([], "the list is empty"),
        ([part(["1Z"]), Signals(outputs=LINES[:, None], sampling_rate=1.0)], "parts to merge need to be of one kind"),
        ([part(["1Z"], ["a"]), part(["2Z"], ["b"])], "no part contains 1:\\+Z / b"),
        ([part(["1Z"], quantity="velocity"), part(["2Z"])], "the same quantity"),
        ([part(["1Z"]), part(["2Z"]).band(1, 1.5)], "parts to merge need the same lines"),
        ([part(["1Z"], units="m"), part(["1Z"], units="mm")], "in m in one and in mm in another"),
        ([Signals(outputs=np.ones((4, 1)), sampling_rate=f) for f in (1.0, 2.0)], "of the same sampling rate"),
        (
            [Signals(outputs=np.ones((4, 2)), sampling_rate=1.0, output_dofs=list(d)) for d in ("ab", "cd")],
            "they have none in common",
        ),
    ],
)
def test_what_cannot_be_merged_is_said(parts, text):
    with pytest.raises(DataError, match=text):
        merge(parts)


def test_setups_need_their_references():
    parts, _ = setups([0, 7])
    with pytest.raises(DataError, match="setup 2 lacks 1:\\+X"):
        merge([parts[0], _without(parts[1])])


def _without(part):
    keep = [0, 2, 3]
    return ImpulseResponse(
        values=part.values[:, keep],
        sampling_rate=1.0,
        kind="correlation",
        output_dofs=[part.output_dofs[i] for i in keep],
        input_dofs=part.input_dofs,
    )


def channel(name: str, values: np.ndarray, rate: float = 100.0, unit: str = "m/s^2") -> Signals:
    quantity = None if unit == "N" else "acceleration"
    return Signals(
        outputs=values[:, None], sampling_rate=rate, output_dofs=[name], units=([unit], []), quantities=quantity
    )


def test_records_of_one_channel_each_are_one_record():
    t = np.arange(600) / 100.0
    y = np.sin(2 * np.pi * 3 * t)
    found = merge([channel("a", y), channel("b", 2 * y[:500]), channel("hammer", 3 * y, unit="N")])
    assert (found.output_dofs, found.input_dofs, found.samples) == (("a", "b"), ("hammer",), 500)
    np.testing.assert_array_equal(found.outputs, np.stack([y, 2 * y], axis=1)[:500])
    np.testing.assert_array_equal(found.inputs[:, 0], 3 * y[:500])
    assert "cut to the 500 samples of the shortest" in found.processing[-1]


def test_channels_of_higher_rates_are_decimated_to_the_lowest():
    slow, fast = np.arange(600) / 50.0, np.arange(1800) / 150.0
    found = merge([channel("a", np.sin(7 * slow), 50.0), channel("b", np.sin(7 * fast), 150.0)])
    assert (found.sampling_rate, found.samples) == (50.0, 600)
    np.testing.assert_allclose(found.outputs[50:-50, 1], found.outputs[50:-50, 0], atol=2e-3)
    with pytest.raises(DataError, match="resample=HZ"):
        merge([channel("a", np.sin(7 * slow), 50.0), channel("b", np.sin(7 * fast), 130.0)])


def test_an_event_is_driven_by_its_base_and_ambient_vibration_is_not():
    rng = np.random.default_rng(0)
    shaken = np.exp(-(((np.arange(4000) - 800) / 200.0) ** 2))[:, None] * rng.standard_normal((4000, 3))
    names = ["1 deck", "2 footing 90", "3 free field"]
    event = Signals(outputs=shaken, sampling_rate=100.0, output_dofs=names, quantities="acceleration")
    driven, (note,) = moved_by_base(event)
    assert (driven.output_dofs, driven.input_dofs) == (("1 deck",), ("2 footing 90", "3 free field"))
    np.testing.assert_array_equal(driven.inputs, shaken[:, 1:])
    assert "2 footing 90" in note.text
    for other in (
        replace(event, outputs=rng.standard_normal((4000, 3))),
        replace(event, output_dofs=["1 deck", "2 deck", "3 roof"]),
        replace(event, output_dofs=["1 base", "2 footing", "3 free field"]),
        replace(event, quantities="displacement"),
    ):
        assert moved_by_base(other) == (other, ())
