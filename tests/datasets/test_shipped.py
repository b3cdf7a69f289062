"""The measured tests that come with the program are there, whole, with licence, source and reference values."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import modalscope as ms
from modalscope.datasets import shipped
from tests.support import ROOT


@pytest.mark.parametrize("name", ms.datasets.names())
def test_every_set_has_data_licence_source_and_reference(name: str) -> None:
    data, reference = ms.datasets.load(name), ms.datasets.reference(name)
    assert data.source_path == ms.datasets.folder(name) / shipped.FILES[name]
    assert np.all(np.diff(reference.frequencies) > 0)
    assert np.all(reference.damping_ratios < 0.03)
    assert (ms.datasets.folder(name) / "LICENSE").is_file()
    assert "**Source.**" in ms.datasets.describe(name)


def test_a_wrong_name_is_answered_by_the_nearest() -> None:
    with pytest.raises(ms.DataError, match="Did you mean 'palisaden'"):
        ms.datasets.load("palisade")


def test_every_folder_of_examples_is_a_set() -> None:
    assert {path.name for path in (ROOT / "examples").iterdir() if path.is_dir()} == set(ms.datasets.names())


def test_the_program_does_not_load_them_unasked() -> None:
    code = "import sys, modalscope as ms; ms.read, ms.analyze; print('modalscope.datasets' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"
