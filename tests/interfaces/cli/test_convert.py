"""modalscope convert: every number arrives, and what a format cannot hold is told."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main


def test_convert_keeps_every_number(test_file, tmp_path):
    target = tmp_path / "test.npz"
    assert main(["convert", str(test_file), str(target)]) == 0
    assert np.array_equal(ms.read(target).values, ms.read(test_file).values)


@pytest.mark.slow
def test_what_a_universal_file_cannot_hold_of_modes_is_said(test_file, tmp_path, capsys):
    kept, lost = tmp_path / "modes.json", tmp_path / "modes.uff"
    assert main(["identify", str(test_file), "-o", str(kept)]) == 0
    assert main(["convert", str(kept), str(lost)]) == 0
    assert "participation, spreads, indicators and reasons are left out" in capsys.readouterr().out
