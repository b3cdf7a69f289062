"""The version of the package is the one that its files and reports state."""

from __future__ import annotations

import tomllib

import modalscope
from modalscope.data.analysis import VERSION
from tests.support import ROOT


def test_the_package_its_files_and_its_project_file_state_one_version() -> None:
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert modalscope.__version__ == VERSION == stated
