"""What version 0.2.0 wrote is read for ever: its data, modes, diagrams, models and documents (tests/io/written)."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope import systems
from modalscope.data.mode_fields import DERIVED
from tests.support import refused

WRITTEN = Path(__file__).parent / "written"

#: The five masses themselves: what no file changes.
TRUE = systems.chain5().modes()

#: Formats with every digit, and universal files, which hold single precision.
DIGITS = {".npz": 0.0, ".h5": 0.0, ".mat": 0.0, ".json": 0.0, ".csv": 1e-9, ".uff": 1e-6}

#: Of the list in `result.json`: the mode at 4.17 Hz was refused by hand.
FREQUENCIES = [0.9059949020888388, 2.6447147, 5.3557858, 6.10856808]
DAMPING = [0.00245245195, 0.00598435, 0.01018206, 0.01594406]


@pytest.fixture
def there(monkeypatch):
    """Stand in the folder: the documents name their data from there."""
    monkeypatch.chdir(WRITTEN)


def near(values, expected, suffix):
    scale = np.abs(expected).max()
    np.testing.assert_allclose(values, expected, rtol=0, atol=DIGITS[suffix] * scale)


@pytest.mark.parametrize("suffix", [".npz", ".uff", ".csv"])
def test_a_frequency_response_is_read(suffix):
    found = ms.read(WRITTEN / f"response{suffix}")
    lines = np.arange(8, 321, 2) / 40
    made = systems.chain5().frequency_response(lines, outputs=[0, 2, 4], inputs=[0], noise=0.02, seed=1)
    assert isinstance(found, ms.FrequencyResponse)
    assert (found.output_dofs, found.input_dofs) == (("1:+X", "3:+X", "5:+X"), ("1:+X",))
    assert found.quantity == "displacement"
    near(found.frequencies, lines, suffix)
    # noise of the generator and sums of the structure: a later NumPy may differ by rounding
    np.testing.assert_allclose(found.values, made.values, rtol=0, atol=1e-6 * np.abs(made.values).max())


def test_an_impulse_response_is_read():
    found = ms.read(WRITTEN / "impulse.npz")
    assert isinstance(found, ms.ImpulseResponse)
    assert (found.values.shape, found.sampling_rate) == ((150, 3, 1), 20.0)


@pytest.mark.parametrize("suffix", [".npz", ".uff", ".csv"])
def test_a_record_is_read(suffix):
    found, reference = ms.read(WRITTEN / f"record{suffix}"), ms.read(WRITTEN / "record.npz")
    assert isinstance(found, ms.Signals)
    assert found.sampling_rate == pytest.approx(20.0, rel=1e-6)
    assert (found.outputs.shape, found.inputs.shape, found.quantity) == ((1200, 2), (1200, 1), "acceleration")
    near(found.outputs, reference.outputs, suffix)
    near(found.inputs, reference.inputs, suffix)


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".mat"])
def test_runs_are_read(suffix):
    found, reference = ms.read(WRITTEN / f"runs{suffix}"), ms.read(WRITTEN / "runs.npz")
    assert (found.outputs.shape, found.inputs.shape, found.runs) == ((2, 200, 2), (2, 200, 1), 2)
    near(found.outputs, reference.outputs, suffix)


@pytest.mark.parametrize("name", ["modes.npz", "modes.h5", "modes.mat", "modes.json", "modes.uff", "result.json"])
def test_modes_are_read(name):
    found, suffix = ms.read(WRITTEN / name), Path(name).suffix
    assert isinstance(found, ms.ModalModel)
    loose = 1e-5 if suffix == ".uff" else 1e-7
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, rtol=loose)
    np.testing.assert_allclose(found.damping_ratios, DAMPING, rtol=max(loose, 1e-6))
    assert found.shapes.shape == (3, 4)
    if suffix != ".uff":
        assert [round(each.frequency, 2) for each in found.left_out] == [4.17]
        assert found.converged
        assert {"mpc", "mpd", "msv"} <= set(found.indicators)
        assert (found.frequencies_std > 0).all()
        assert {"orders_found", "persistence", "signal_to_noise", "text"} <= set(found.reasons[0])


def test_a_table_of_modes_keeps_its_columns(tmp_path):
    modes = ms.read(WRITTEN / "modes.npz")
    ms.write(tmp_path / "modes.csv", modes)
    now, before = (
        place.read_text().splitlines()[0].split(",") for place in (tmp_path / "modes.csv", WRITTEN / "modes.csv")
    )
    assert [name for name in now if name not in DERIVED] == before


@pytest.mark.parametrize("name", ["compared.json", "certified.json"])
def test_lists_of_commands_are_read(name):
    found = ms.read(WRITTEN / name)
    assert len(found) == 5
    np.testing.assert_allclose(found.frequencies, TRUE.frequencies, rtol=1e-3)


@pytest.mark.parametrize("suffix", [".npz", ".json"])
def test_a_diagram_is_read_and_selected_from(suffix):
    found = ms.read(WRITTEN / f"diagram{suffix}")
    assert isinstance(found, ms.StabilizationDiagram)
    assert (found.method, found.domain, found.orders) == ("lscf", "z", (2, 4, 6, 8, 10, 12))
    assert found.poles.size == 9
    for modes in (ms.select(found), ms.select(found, frequencies=[2.645])):
        apart = np.abs(modes.frequencies[:, None] / TRUE.frequencies - 1).min(axis=1)
        assert len(modes) >= 1
        assert apart.max() < 1e-2


@pytest.mark.parametrize("suffix", [".npz", ".json"])
def test_a_model_is_read(suffix):
    found = ms.read(WRITTEN / f"model{suffix}")
    assert (found.order, found.dt) == (10, 0.05)
    frequencies = np.sort(np.abs(found.continuous_poles))[::2] / (2 * np.pi)
    np.testing.assert_allclose(frequencies, TRUE.frequencies, rtol=2e-3)  # 2 % of noise


@pytest.mark.parametrize("suffix", [".npz", ".uff"])
def test_a_geometry_is_read(suffix):
    found = ms.read(WRITTEN / f"geometry{suffix}")
    assert found.nodes == systems.chain5().geometry.nodes
    np.testing.assert_allclose(found.coordinates, systems.chain5().geometry.coordinates)


@pytest.mark.usefixtures("there")
def test_a_result_is_replayed():
    again, written = ms.replay(WRITTEN / "result.json"), ms.read(WRITTEN / "result.json")
    np.testing.assert_allclose(again.modes.frequencies, written.frequencies, rtol=1e-6)
    np.testing.assert_allclose(again.modes.damping_ratios, written.damping_ratios, rtol=1e-4)
    assert (again.analysis.method, again.analysis.refused, again.analysis.schema) == ("lscf", (4.17,), 2)


def test_an_analysis_is_replayed_on_data_elsewhere(tmp_path):
    shutil.copy(WRITTEN / "choices.analysis.json", tmp_path)
    refused("response.npz", ms.replay, tmp_path / "choices.analysis.json")
    again = ms.replay(tmp_path / "choices.analysis.json", WRITTEN / "response.npz")
    np.testing.assert_allclose(again.modes.frequencies, FREQUENCIES, rtol=1e-6)


@pytest.mark.usefixtures("there")
def test_the_result_of_a_record_is_replayed():
    again, written = ms.replay(WRITTEN / "record.result.json"), ms.read(WRITTEN / "record.result.json")
    assert len(written) == 2
    np.testing.assert_allclose(again.modes.frequencies, written.frequencies, rtol=1e-6)


@pytest.mark.usefixtures("there")
def test_what_is_written_today_has_the_same_keys(tmp_path):
    ms.write(tmp_path / "result.json", ms.replay(WRITTEN / "result.json"))
    today, then = (json.loads((each / "result.json").read_text()) for each in (tmp_path, WRITTEN))
    assert set(then) <= set(today)
    assert set(then["analysis"]) <= set(today["analysis"])
    assert set(then["modes"][0]) <= set(today["modes"][0])
    assert set(then["left_out"][0]) <= set(today["left_out"][0])
