"""The report reproduced: every published value and every section, on one page; what fails is said there."""

from __future__ import annotations

from pathlib import Path

import pytest

from modalscope.interfaces.cli import main
from modalscope.interfaces.reporting import reproduction


@pytest.mark.slow
def test_the_whole_report_runs_and_every_published_value_agrees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", "-o", "all.html"]) == 0
    said = capsys.readouterr().out
    assert "45 of 45 published values agree" in said
    assert "9 of 9 sections of the report ran" in said
    page = (tmp_path / "all.html").read_text(encoding="utf-8")
    assert page.count("<section") == 10
    assert page.count("data:image/png") >= 9
    assert "Eq. 28, poles:" in page


def test_a_section_that_fails_is_said_and_ends_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = 'print("begun")\n1 / 0\n# %%\n# Later.\nprint("later")\n'
    (tmp_path / "plot_1_broken.py").write_text(f'"""\nBroken\n======\n\nA page.\n"""\n{code}')
    monkeypatch.setattr(reproduction, "_PLACES", (tmp_path,))
    assert main(["reproduce", "-o", str(tmp_path / "all.html")]) == 2
    out, err = capsys.readouterr()
    assert "0 of 1 sections" in out
    assert "Broken: ZeroDivisionError: division by zero" in err
    page = (tmp_path / "all.html").read_text(encoding="utf-8")
    assert "<b>begun</b>" in page
    assert "Later." not in page
