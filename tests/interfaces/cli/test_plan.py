"""modalscope plan as a user runs it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modalscope import write
from modalscope.interfaces.cli import main
from tests.support import FIVE


def test_a_plan_is_printed_and_nothing_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "chain.uff"
    write(path, FIVE["chain5"]().frequency_response(np.linspace(0.5, 7, 200)))
    before = sorted(tmp_path.iterdir())
    assert main(["plan", str(path), "--orders", "2:20:2", "--band", "1", "6"]) == 0
    told = capsys.readouterr().out
    assert "orders 2 to 20" in told
    assert "on one thread" in told
    assert sorted(tmp_path.iterdir()) == before
