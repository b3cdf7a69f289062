"""Steps of CONTRIBUTING that are easily forgotten: each has a test that fails without it."""

from __future__ import annotations

import ast
import re

import numpy as np
import pytest

import modalscope as ms
from modalscope.identification.method_names import methods
from modalscope.interfaces.reporting.modes import figures_of, modes_section
from modalscope.io.formats import FORMATS
from modalscope.systems import chain5
from tests.support import ROOT

#: Files in which a method is compared with a textbook formula, an identity, or structures of known modes.
PROOFS = ("methods", "extras", "identification/matrices", "selection/judging")

#: Modules that give reasons against a mode of a record without inputs.
RULES = ("evidence", "no_structure")


def words_of(*folders: str) -> str:
    """Return the text of all tests in folders."""
    files = [path for folder in folders for path in sorted((ROOT / "tests" / folder).rglob("*.py"))]
    return "\n".join(path.read_text(encoding="utf-8") for path in files)


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


@pytest.mark.parametrize("name", sorted({row.name for row in FORMATS.values()}))
def test_every_format_is_read_by_a_test(name: str) -> None:
    text = words_of("io") + words_of("extras")
    suffixes = [suffix for suffix, row in FORMATS.items() if row.name == name]
    assert any(re.search(rf"{re.escape(suffix)}\b", text) for suffix in suffixes), f"test {suffixes} in tests/io"


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
    tests = words_of("identification", "data")
    assert [name for name in modes.indicators if not re.search(rf"\b{name}\b", tests)] == [], "test its definition"


def test_every_column_of_the_reports_table_is_explained() -> None:
    modes = ms.analyze(chain5().impulse_response(300, noise=0.02, seed=0)).modes
    heads = re.findall(r"<th [^>]*>(.*?)</th>", modes_section(modes).body.partition("<details>")[0])
    assert {"grade", "± 95 %"} <= set(heads)
    page = (ROOT / "docs" / "trust.md").read_text(encoding="utf-8")
    assert [head for head in heads if f"`{head}`" not in page] == [], "explain it in docs/trust.md"


@pytest.mark.parametrize("module", RULES)
def test_every_reason_against_a_mode_is_tried(module: str) -> None:
    source = (ROOT / "src" / "modalscope" / "selection" / "judging" / f"{module}.py").read_text(encoding="utf-8")
    tests = words_of("selection/judging")
    added = [
        node.args[0]
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "against.append"
    ]
    assert added
    for reason in added:
        parts = [n.value for n in ast.walk(reason) if isinstance(n, ast.Constant) and isinstance(n.value, str)]
        longest = max(parts, key=len, default="").strip(" :,;")  # none where the text is that of a note
        assert longest in tests, f"test both sides of the limit of {longest!r} in tests/selection/judging"
