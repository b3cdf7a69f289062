"""Our own plug-ins are found as those of others are, and only where the table has no such name."""

from __future__ import annotations

import tomllib

import pytest

import modalscope as ms
from modalscope.identification import method_names
from modalscope.numerics.plugins import METHODS, added, names_added
from tests.support import ROOT


def test_every_entry_point_of_the_project_is_installed_and_its_rows_have_its_name() -> None:
    points = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    for group, listed in points.items():
        assert set(listed) <= set(names_added(group)), "make setup"
        assert all(added(group, name) for name in listed)
    for name in points[METHODS]:
        assert {row.name for row in added(METHODS, name)} == {name}
        assert set(added(METHODS, name)) <= set(ms.methods())
        assert not any(row.votes for row in added(METHODS, name)), "trust was calibrated with the votes of the table"


def test_rows_of_the_table_are_found_without_a_look_at_other_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    def looked() -> None:
        raise AssertionError("entry points are read")

    monkeypatch.setattr(method_names, "_rows_added", looked)
    assert ms.methods("PolyMAX")[0].name == "lscf"
    assert method_names.find_method("ssi-cov", None, "time").name == "alternate"
    assert [row.domain for row in method_names.rows_of("prce")] == ["time"]
    assert method_names.cell_label("era", "time") == "ERA"
    assert ms.identify(ms.systems.chain5().impulse_response(200), order=10).method == "era"


def test_a_misspelt_name_of_a_row_that_is_added_is_answered() -> None:
    with pytest.raises(ms.DataError, match="Did you mean 'vector-fitting'"):
        ms.methods("vectr-fitting")
