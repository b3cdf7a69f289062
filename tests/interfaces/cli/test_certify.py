"""modalscope certify as a user runs it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.systems import chain5


def loud(tmp_path):
    """Return a file whose intervals by ERA do not all hold: 20 dB."""
    path = tmp_path / "loud.npz"
    ms.write(path, chain5().impulse_response(400, noise=0.1, seed=0))
    return path


CHOICES = ("--method", "era", "--orders", "2:24:2", "--no-refine", "--replicates", "10")


@pytest.mark.slow
def test_a_file_is_certified_and_its_modes_are_written_with_intervals_that_hold(tmp_path, capsys):
    target = tmp_path / "modes.json"
    assert main(["certify", str(loud(tmp_path)), *CHOICES, "-o", str(target)]) == 0
    out = capsys.readouterr().out
    assert "does not hold" in out
    assert re.search(r"The interval of the frequency at 6\.1\d+ Hz does not hold: bias", out)
    written = json.loads(target.read_text())
    # the analysis that the result carries gives it again, and certifies to the same numbers
    assert main(["certify", str(target), "--replicates", "10"]) == 0
    assert capsys.readouterr().out.split("with corrected intervals")[0] == out.split("with corrected intervals")[0]
    assert main(["identify", str(loud(tmp_path)), *CHOICES[:-2], "-o", str(target)]) == 0
    first = [mode["damping_ratio_std"] for mode in json.loads(target.read_text())["modes"]]
    wider = [mode["damping_ratio_std"] for mode in written["modes"]]
    assert any(new > 1.3 * old for old, new in zip(first, wider, strict=True))


@pytest.mark.slow
def test_a_certificate_is_a_section_of_the_report(tmp_path, capsys):
    target = tmp_path / "report.html"
    assert main(["certify", str(loud(tmp_path)), *CHOICES, "-o", str(target)]) == 0
    page = target.read_text()
    assert "Coverage of the intervals" in page
    assert "Simulated deviations of every mode&#x27;s damping" in page
    assert "are replaced by the scatter of the simulations" in page


def test_a_negative_seed_is_answered_in_words(test_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["certify", str(test_file), "--orders", "10:10", "--no-refine", "--seed", "-1"]) == 2
    assert "seed needs a whole number of at least 0" in capsys.readouterr().err
