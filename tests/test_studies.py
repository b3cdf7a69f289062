"""Tables of `docs/validation/`: what is measured again replaces its rows, all others are kept, and no figure stands without its seeds."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.studies import BEGIN, END, FOLDER, SUBJECTS, Run, Study, overview, write
from tests.support import ROOT

FIRST, SECOND = Run("2026-01-01", "aaaaaaa", "0.1"), Run("2026-02-02", "bbbbbbb", "0.2")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "index.md").write_text(f"# Validation\n\n{BEGIN}\n{END}\n\nafter\n", encoding="utf-8")
    return tmp_path


def measured(data: str, value: float, run: Run, subject: str = "selection") -> Study:
    study = Study(subject, data, "3 seeds, 0 to 2", run)
    study.row("found", value, least=2)
    return study


def rows(folder: Path, subject: str = "selection") -> list[str]:
    text = (folder / f"{subject}.md").read_text(encoding="utf-8")
    return [line for line in text.splitlines() if line.startswith("| ")][2:]


def test_rows_are_replaced_study_by_study_and_others_are_kept(folder: Path) -> None:
    write([measured("20 dB", 1, FIRST), measured("3 dB", 2, FIRST)], folder)
    old = rows(folder)
    assert [row.split(" | ")[0] for row in old] == ["| 3 dB", "| 20 dB"]  # numbers by their size
    write([measured("20 dB", 3, SECOND)], folder)
    assert rows(folder) == [old[0], "| 20 dB | found | 3 seeds, 0 to 2 | at least 2 | 3 | yes | 2026-02-02 | bbbbbbb |"]
    page = (folder / "selection.md").read_text(encoding="utf-8")
    assert page.startswith("# Selection of modes\n")
    assert "Last run: 2026-02-02, commit bbbbbbb, modalscope 0.2." in page
    assert sorted(path.name for path in folder.iterdir()) == ["index.md", "selection.md"]  # no temporary file


def test_the_overview_counts_figures_and_names_what_was_not_run(folder: Path) -> None:
    write([measured("20 dB", 1, FIRST), measured("3 dB", 2, SECOND)], folder)
    index = (folder / "index.md").read_text(encoding="utf-8")
    assert "| [Selection of modes](selection.md) | 2 | 1 of 2 | 2026-02-02 |" in index
    assert index.count("| not run |") == len(SUBJECTS) - 1
    assert index.endswith(f"{END}\n\nafter\n")
    write([measured("noise", 2, SECOND, "ambient")], folder)
    assert (folder / "index.md").read_text(encoding="utf-8").count(BEGIN) == 1


def test_figures_are_shown_with_what_was_asked_and_misses_are_kept() -> None:
    study = Study("selection", "a | b", "seed 0", FIRST)
    study.row("range", [0.123, 2.0], least=0.5, most=3, unit=" %")
    study.row("text", "3 of 4")
    study.row("not a number", float("nan"), most=1)
    cells = [row.split(" | ")[1:6] for row in study.rows]
    assert cells[0] == ["range", "seed 0", "at least 0.5, at most 3 %", "0.123 to 2 %", "no"]
    assert cells[1] == ["text", "seed 0", "", "3 of 4", ""]
    assert cells[2][-2:] == ["nan", "no"]
    assert study.rows[0].startswith("| a \\| b |")
    assert [missed.split(":")[0] for missed in study.missed] == ["range", "not a number"]


def test_no_figure_without_seeds_or_subject() -> None:
    with pytest.raises(ValueError, match="which seeds or cases"):
        Study("selection", "20 dB", " ", FIRST)
    with pytest.raises(ValueError, match="no subject 'selections'"):
        Study("selections", "20 dB", "seed 0", FIRST)


def test_a_study_that_found_nothing_leaves_its_rows(folder: Path) -> None:
    write([measured("20 dB", 1, FIRST)], folder)
    write([Study("selection", "20 dB", "seed 0", SECOND)], folder)
    assert len(rows(folder)) == 1


def test_every_row_of_the_pages_has_seeds_a_date_and_a_commit() -> None:
    for path in sorted(FOLDER.glob("*.md")):
        if path.stem in ("index", "spoilt-data", "jobs"):  # tables of another form
            continue
        for row in rows(FOLDER, path.stem):
            cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]
            assert len(cells) == 8, row
            assert all((cells[2], cells[4], re.fullmatch(r"\d{4}-\d\d-\d\d", cells[6]), cells[7])), row


def test_the_overview_is_that_of_the_pages() -> None:
    text = (FOLDER / "index.md").read_text(encoding="utf-8")
    assert text.partition(BEGIN)[2].partition(END)[0].strip().splitlines() == overview()


def test_every_study_names_its_subject() -> None:
    subjects = set()
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        marks = re.findall(r"pytest\.mark\.study\b(?:\(\"([\w-]+)\"\))?", path.read_text(encoding="utf-8"))
        assert all(marks) or path == Path(__file__), path
        subjects |= set(marks)
    assert subjects - {""} == set(SUBJECTS)
