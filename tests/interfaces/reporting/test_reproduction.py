"""The report reproduced: every published value, identity and misprint on one page; what differs is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from modalscope.analysis.checking.selfcheck import recomputed
from modalscope.interfaces.cli import main
from modalscope.interfaces.reporting import reproduction

Captured = pytest.CaptureFixture[str]


@pytest.mark.slow
def test_the_page_has_every_value_identity_and_misprint_and_all_hold(tmp_path: Path, capsys: Captured) -> None:
    assert main(["reproduce", "-o", str(tmp_path / "all.html")]) == 0
    said = capsys.readouterr().out.splitlines()[:-1]
    counts = [line.partition(" of ")[2].partition(":")[0] for line in said]
    assert all(line.startswith(f"{count} of ") for line, count in zip(said, counts, strict=True))
    # published values; II-1 to II-6, III, measured data; misprints, each as printed and corrected
    assert [int(count) for count in counts] == [45, 6, 4, 6, 3, 4, 5, 22, 4, 58]
    page = (tmp_path / "all.html").read_text(encoding="utf-8")
    assert page.count('<td class="words">yes</td>') == sum(map(int, counts))
    assert page.count("as printed,") == page.count("corrected,") == 29


SECTION = '"""\nA section\n=========\n"""\nprint("an identity: {} (at most 1e-12)")\n{}'


@pytest.mark.parametrize(
    ("number", "then", "fault"),
    [
        ("1.01e-12", "", "an identity: 1.01e-12, expected at most 1e-12"),
        ("nan", "", "an identity: nan"),
        ("0.99e-12", "1 / 0", "stopped by ZeroDivisionError division by zero"),
        ("0.99e-12", 'print("as printed: 0.099 (at least 0.1)")', "as printed: 0.099, expected at least 0.1"),
        ("1e-12", 'print("as printed: 0.1 (at least 0.1)")', None),
        ("0", 'print("M: expected 4.5, computed 4.6, apart by 0.11 (at most 0.1)")', "M: 4.6, expected 4.5"),
        ("0", 'print("M: expected 4.5, computed 4.6, apart by 0.1 (at most 0.1)")', None),
    ],
)
def test_a_number_that_moves_over_its_limit_ends_in_an_error(
    number: str, then: str, fault: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    (tmp_path / "plot_1_section.py").write_text(SECTION.format(number, then), encoding="utf-8")
    monkeypatch.setattr(reproduction, "_PLACES", (tmp_path,))
    monkeypatch.setattr(reproduction, "recomputed", tuple)
    assert main(["reproduce", "-o", str(tmp_path / "all.html")]) == (0 if fault is None else 2)
    out, err = capsys.readouterr()
    assert "A section" in out
    assert "1 differ, first" in err if fault else not err
    assert (fault or "") in err
    assert ("NO" in (tmp_path / "all.html").read_text(encoding="utf-8")) == bool(fault)


def test_a_row_holds_what_is_expected_what_is_computed_and_how_far_they_are_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stated = 'print("M: expected 4.5, computed 4.6, apart by 0.02 (at most 0.1)")'
    (tmp_path / "plot_1_section.py").write_text(SECTION.format("2e-13", stated), encoding="utf-8")
    monkeypatch.setattr(reproduction, "_PLACES", (tmp_path,))
    monkeypatch.setattr(reproduction, "recomputed", tuple)
    assert reproduction.reproduce(tmp_path / "all.html")["A section"] == [
        ("an identity", "at most 1e-12", "2e-13", "2e-13", "yes"),
        ("M", "4.5", "4.6", "0.02", "yes"),
    ]


def test_a_published_value_that_moves_by_a_digit_ends_in_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    first = recomputed()[0]
    monkeypatch.setattr(reproduction, "_PLACES", (tmp_path,))
    for off, status in ((0.49, 0), (0.53, 2)):  # a printed number is rounded
        moved = replace(first, computed=first.published + off * 10.0**-first.digits)
        monkeypatch.setattr(reproduction, "recomputed", lambda moved=moved: (moved,))
        assert main(["reproduce", "--force", "-o", str(tmp_path / "all.html")]) == status
    assert "1 differ, first three masses, structure, f Hz, row 1" in capsys.readouterr().err
