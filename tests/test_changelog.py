"""The changelog: one fragment a change, joined under the version of the project."""

from __future__ import annotations

from pathlib import Path

from tests.support import ROOT
from tools.changelog import WIDTH, fragments, joined

OLD = "# Changelog\n\nWhat changed.\n\n## [0.2.0]\n\n- Two.\n\n## [0.1.0] - 2020-01-01\n\n- One.\n"


def test_fragments_are_added_to_the_section_of_the_version() -> None:
    new = joined(OLD, "0.2.0", "2021-01-01", {Path("a.md"): "Three.", Path("b.md"): "Four."})
    assert new == OLD.replace("- Two.\n", "- Two.\n- Three.\n- Four.\n")


def test_a_new_version_opens_its_section_above_the_others() -> None:
    new = joined(OLD, "0.3.0", "2021-01-01", {Path("a.md"): "Three."})
    assert new == OLD.replace("## [0.2.0]", "## [0.3.0] - 2021-01-01\n\n- Three.\n\n## [0.2.0]")


def test_nothing_to_join_changes_nothing() -> None:
    assert joined(OLD, "0.3.0", "2021-01-01", {}) == OLD


def test_long_changes_are_wrapped_and_none_is_lost(tmp_path: Path) -> None:
    (tmp_path / "b.md").write_text("word " * 60 + "\nend.\n")
    (tmp_path / "a.md").write_text("First.\n")
    new = joined(OLD, "0.3.0", "2021-01-01", fragments(tmp_path))
    assert new.index("First.") < new.index("word")
    assert new.count("word") == 60
    assert max(map(len, new.splitlines())) <= WIDTH


def test_fragments_are_one_or_two_sentences() -> None:
    for path in sorted((ROOT / "changelog.d").glob("*.md")):
        text = path.read_text(encoding="utf-8").strip()
        assert text.endswith("."), path
        assert len(text.splitlines()) <= 3, path
        assert not text.startswith(("#", "-", "*")), path
