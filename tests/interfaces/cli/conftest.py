"""What the tests of several commands share."""

from __future__ import annotations

from pathlib import Path
from shutil import copy

import pytest

from modalscope.interfaces.cli import main


@pytest.fixture(scope="session")
def kept_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kept") / "test.uff"
    assert main(["simulate", "chain5", "--noise", "40", "-o", str(path)]) == 0
    return path


@pytest.fixture
def test_file(tmp_path: Path, kept_file: Path) -> Path:
    """Return a universal file of a simulated test, 40 dB above its noise."""
    return Path(copy(kept_file, tmp_path))


@pytest.fixture(scope="session")
def kept_modes(kept_file: Path) -> str:
    path = kept_file.with_name("modes.json")
    assert main(["identify", str(kept_file), "--orders", "6:20:2", "-q", "-o", str(path)]) == 0
    return path.read_text()


@pytest.fixture
def modes_file(test_file: Path, kept_file: Path, kept_modes: str) -> Path:
    """Return the modes of that test, as they were found from this file."""
    path = test_file.with_name("modes.json")
    path.write_text(kept_modes.replace(str(kept_file), str(test_file)))
    return path
