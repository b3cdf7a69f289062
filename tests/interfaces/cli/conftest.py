"""What the tests of several commands share."""

from __future__ import annotations

from pathlib import Path

import pytest

from modalscope.interfaces.cli import main


@pytest.fixture
def test_file(tmp_path: Path) -> Path:
    """Return a universal file of a simulated test, 40 dB above its noise."""
    path = tmp_path / "test.uff"
    assert main(["simulate", "chain5", "--noise", "40", "-o", str(path)]) == 0
    return path
