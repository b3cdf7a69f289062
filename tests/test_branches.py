"""No stage asks for a class, a tag or a name: the row, the data matrix, the realization and the response say what is to be done."""

from __future__ import annotations

import ast

import pytest

from tools.branches import branches, found


@pytest.mark.slow
def test_there_is_no_branch_outside_the_table_and_the_data_matrices() -> None:
    assert found() == []


@pytest.mark.parametrize(
    "text",
    [
        "isinstance(matrix, Hankel)",
        "isinstance(response, FrequencyResponse | Signals)",
        'method == "lscf"',
        'cell.domain != "time"',
        'cell.name in ("prce", "lscf")',
        'response.kind == "correlation"',
        "method.takes is not None and method.takes == Takes.PAST",
    ],
)
def test_questions_are_counted(text: str) -> None:
    assert len(list(branches(ast.parse(text), {"Hankel", "FrequencyResponse"}))) == 1


@pytest.mark.parametrize(
    "text", ["isinstance(settings, Mapping)", 'kind == "mode"', "domain in cells", 'name == "file"']
)
def test_other_conditions_are_not(text: str) -> None:
    assert not list(branches(ast.parse(text), {"Hankel", "FrequencyResponse"}))
