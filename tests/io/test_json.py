"""Modes as JSON: poles are not needed, names are."""

import pytest

import modalscope.io as mio
from tests.support import refused


def test_modes_json_without_poles_is_read_by_frequency_and_damping(tmp_path):
    path = tmp_path / "modes.json"
    path.write_text(
        '{"modalscope": "0.1", "data": {}, "method": "era", "domain": "time", "orders": null, '
        '"modes": [{"frequency_hz": 2.0, "damping_ratio": 0.01,'
        ' "frequency_spread_hz": null, "shape": {"dof": ["1:+Z", "2:+Z"], "real": [1, -1], "imag": [0, 0]}}]}'
    )
    modes = mio.read(path)
    assert modes.frequencies == pytest.approx([2.0])
    assert modes.damping_ratios == pytest.approx([0.01])
    assert (modes.output_dofs, modes.frequencies_spread, modes.participation) == (("1:+Z", "2:+Z"), None, None)
    whole = path.read_text()
    for name in ("real", "frequency_hz", "modes"):
        path.write_text(whole.replace(f'"{name}"', f'"no {name}"'))
        refused(": |needs", mio.read, path)
