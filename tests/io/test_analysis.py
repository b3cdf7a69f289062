"""An analysis as JSON comes back with every digit, and a damaged one is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from modalscope.data.analysis import Analysis, SourceFile
from modalscope.io.analysis import analysis_to, read_analysis, write_analysis
from tests.support import refused


def test_an_analysis_comes_back_with_its_arrays(tmp_path):
    rng = np.random.default_rng(0)
    options = {"weights": rng.normal(size=(3, 2)), "turn": rng.normal(size=2) + 1j, "band": (1.0, 2.0), "rows": 7}
    document = Analysis(files=(SourceFile(path="a.uff", size=3, sha256="00"),), options=options)
    write_analysis(tmp_path / "a.analysis.json", document)
    back = read_analysis(tmp_path / "a.analysis.json")
    assert analysis_to(back) == analysis_to(document)
    np.testing.assert_array_equal(back.options["weights"], options["weights"])
    np.testing.assert_array_equal(back.options["turn"], options["turn"])


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ("[", "it is no JSON"),
        ("[1, 2]", 'it has no "analysis"'),
        ('{"analysis": 3}', 'it has no "analysis"'),
        ('{"analysis": {"colour": 1}}', "colour, which this version does not know"),
        ('{"analysis": {"options": {"a": {"array": [[1], [1, 2]]}}}}', "its fields are damaged"),
        ('{"analysis": {"options": {"a": {"array": ["x", 1]}}}}', "an array holds more than numbers"),
        ('{"analysis": {"options": {"a": {"array": [1], "imag": [1, 2]}}}}', "its parts are"),
        ('{"analysis": {"files": [3]}}', "its fields are damaged"),
    ],
)
def test_a_damaged_analysis_is_refused(tmp_path, document, said):
    (tmp_path / "a.json").write_text(document)
    refused(said, read_analysis, tmp_path / "a.json")
    refused("there is no such file", read_analysis, tmp_path / "none.json")


def test_modes_without_an_analysis_say_so(tmp_path):
    (tmp_path / "modes.json").write_text(json.dumps({"modalscope": "1", "modes": [], "analysis": None}))
    refused('it has no "analysis"', read_analysis, tmp_path / "modes.json")
