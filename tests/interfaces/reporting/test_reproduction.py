"""The report reproduced: every published value on one page; what differs is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from modalscope.analysis.checking.selfcheck import recomputed
from modalscope.interfaces.cli import main
from modalscope.interfaces.reporting import reproduction


@pytest.mark.slow
def test_every_published_value_agrees_and_one_that_does_not_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", "-o", "all.html"]) == 0
    assert "45 of 45 published values agree" in capsys.readouterr().out
    assert Path("all.html").read_text(encoding="utf-8").count('<td class="words">yes</td>') == 45
    first, *others = recomputed()
    monkeypatch.setattr(reproduction, "recomputed", lambda: (replace(first, computed=2 * first.published + 1), *others))
    assert main(["reproduce", "-o", "all.html"]) == 2
    out, err = capsys.readouterr()
    assert "44 of 45" in out
    assert "1 differ" in err
