"""The version of the package is the one that its files and reports state."""

from __future__ import annotations

import tomllib
from pathlib import Path

import modalscope

PROJECT = Path(__file__).resolve().parents[1] / "pyproject.toml"


def test_the_package_and_its_project_file_state_one_version() -> None:
    assert modalscope.__version__ == tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["version"]
