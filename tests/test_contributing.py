"""Steps of CONTRIBUTING that are easily forgotten: each has a test that fails without it."""

from __future__ import annotations

import re

import numpy as np
import pytest

import modalscope as ms
from modalscope.identification.table import methods
from modalscope.io.formats import FORMATS
from modalscope.reporting.modes import figures_of
from modalscope.systems import chain5
from tests.support import ROOT

#: Files in which a method is compared with a textbook formula, an identity, or structures of known modes.
PROOFS = ("methods", "blocks", "judging")


@pytest.mark.parametrize("name", sorted({row.name for row in methods()}))
def test_every_method_is_tried_by_its_name_and_explained(name: str) -> None:
    tests = [path for folder in PROOFS for path in (ROOT / "tests" / folder).glob("test_*.py")]
    names = {name, *(alias for row in methods() if row.name == name for alias in row.aliases)}
    quoted = {word for path in tests for word in re.findall(r'"([\w -]+)"', path.read_text(encoding="utf-8"))}
    assert names & quoted, "add an identity with a neighbouring method"
    cells = (ROOT / "docs" / "_ext" / "cells.py").read_text(encoding="utf-8")
    assert cells.count(f'"{name}": ') >= 2, "add its equation and when to use it to docs/_ext/cells.py"
    table = (ROOT / "docs" / "one-table-many-names.md").read_text(encoding="utf-8")
    assert f'"{name}"' in table, "name it in docs/one-table-many-names.md"


@pytest.mark.parametrize("suffix", [suffix for suffix, row in FORMATS.items() if row.name != "mesh"])
def test_every_format_is_in_the_readme_or_the_page_of_files(suffix: str) -> None:
    text = "".join((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/files.md"))
    assert re.search(rf"\{suffix}\b", text), f"name {suffix} in docs/files.md"


@pytest.mark.parametrize("outputs", [1, 3])
@pytest.mark.parametrize("domain", ["time", "s"])
def test_indicators_are_a_real_number_a_mode_and_explained(domain: str, outputs: int) -> None:
    structure = chain5()
    made = (
        structure.impulse_response(120) if domain == "time" else structure.frequency_response(np.linspace(0.2, 8, 300))
    )
    modes = ms.identify(made.select(outputs=made.output_dofs[:outputs]), order=10, domain=domain).modes
    assert modes.indicators
    for name, values in modes.indicators.items():
        assert values.shape == (len(modes),), name
        assert np.asarray(values).dtype.kind == "f", name
    text = figures_of(modes)
    assert [
        name for name in modes.indicators if f"{name.replace('_', ' ')}:" not in text and f"{name}:" not in text
    ] == []
