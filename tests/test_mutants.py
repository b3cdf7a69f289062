"""The runner of one-line faults: what it refuses, and that it tells a fault that is noticed from one that lives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests import mutants
from tests.mutants import Mutant, load, main, misfits, mutated

FAULT = Mutant("a fault", "rule.py", "a < b", "a <= b", ("tests/test_rule.py",))


def test_every_text_of_the_list_stands_in_the_library_exactly_once_and_every_test_is_there() -> None:
    assert misfits(load()) == []
    assert len(load()) >= 40


def test_a_test_that_is_not_there_is_told() -> None:
    known = load()[0]
    file = known.tests[0].partition("::")[0]
    (said,) = misfits([replace(known, tests=(f"{file}::test_that_nobody_wrote",))])
    assert said.endswith("there is no " + f"{file}::test_that_nobody_wrote")


def test_the_fault_takes_the_place_of_its_text() -> None:
    assert mutated("def rule(a, b):\n    return a < b\n", FAULT) == "def rule(a, b):\n    return a <= b\n"


@pytest.mark.parametrize(("source", "count"), [("a > b", 0), ("a < b or a < b", 2)])
def test_a_text_that_does_not_stand_there_exactly_once_is_an_error(source: str, count: int) -> None:
    with pytest.raises(ValueError, match=rf"a fault: 'a < b' occurs {count} times in rule.py, not once"):
        mutated(source, FAULT)


def test_a_replacement_that_changes_nothing_is_an_error() -> None:
    with pytest.raises(ValueError, match="the replacement is the text itself"):
        mutated("a < b", Mutant("none", "rule.py", "a < b", "a < b", ()))


LIBRARY = {
    "src/modalscope/__init__.py": "",
    "src/modalscope/rule.py": "def rule(a, b):\n    return a < b\n\n\ndef other(a):\n    return 2 * a\n",
    "tests/__init__.py": "",
    "tests/test_rule.py": "from modalscope.rule import rule\n\n\ndef test_rule():\n    assert not rule(1, 1)\n",
}

ENTRY = '[[mutant]]\nname = "{}"\nfile = "rule.py"\ntext = "{}"\nreplacement = "{}"\ntests = ["tests/test_rule.py"]\n'


@pytest.fixture(autouse=True)
def _light(monkeypatch: pytest.MonkeyPatch) -> None:
    """Load nothing that these little libraries do not use, and leave the environment as it was."""
    monkeypatch.setattr(mutants, "LOADED", ["pytest"])
    monkeypatch.setattr(mutants, "SURROUNDINGS", {})
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")


def tried(place: Path, *entries: tuple[str, str, str], word: str = "", part: str = "1/1", **files: str) -> int:
    for name, text in {**LIBRARY, **files}.items():
        path = place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    faults = place / "faults.toml"
    faults.write_text("\n".join(ENTRY.format(*entry) for entry in entries))
    return main([word, "--processes", "1", "--part", part], faults, place)


NOTICED = ("noticed", "a < b", "a <= b")
LIVING = ("living", "2 * a", "3 * a")


def test_what_lives_or_does_not_load_is_printed_and_fails(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert tried(tmp_path, NOTICED, LIVING, ("broken", "a < b", "a <")) == 1
    said = capfd.readouterr().out
    assert "LIVES: living (rule.py): '2 * a' -> '3 * a'" in said
    assert "BROKEN" in said
    assert "1 of 3 mutants noticed" in said
    assert (tmp_path / "src/modalscope/rule.py").read_text() == LIBRARY["src/modalscope/rule.py"]


def test_all_noticed_is_a_success_and_a_word_chooses(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert tried(tmp_path, NOTICED, LIVING, word="noticed") == 0
    assert "1 of 1 mutants noticed" in capfd.readouterr().out
    assert tried(tmp_path, NOTICED, word="nothing") == 1


@pytest.mark.slow
def test_parts_hold_every_fault_once(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert tried(tmp_path, NOTICED, LIVING, part="1/2") == 0
    assert tried(tmp_path, NOTICED, LIVING, part="2/2") == 1
    assert "LIVES: living" in capfd.readouterr().out
    with pytest.raises(SystemExit):
        tried(tmp_path, NOTICED, part="3/2")


def test_tests_that_fail_without_a_fault_prove_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert tried(tmp_path, NOTICED, **{"tests/test_rule.py": "def test_rule():\n    assert False\n"}) == 1
    assert "the tests fail without any fault" in capfd.readouterr().out


def test_tests_that_fail_once_without_a_fault_are_run_again(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    rule = "tests/test_rule.py"
    once = (
        "def test_once():\n    seen = Path('seen')\n    before = seen.exists()\n    seen.touch()\n    assert before\n"
    )
    assert tried(tmp_path, NOTICED, **{rule: f"from pathlib import Path\n{LIBRARY[rule]}\n\n{once}"}) == 0
    assert "1 of 1 mutants noticed" in capfd.readouterr().out


def test_a_list_that_does_not_fit_stops_before_anything_runs(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert tried(tmp_path, ("gone", "a > b", "a >= b"), NOTICED, NOTICED) == 1
    said = capfd.readouterr().out
    assert "noticed: named twice" in said
    assert "gone: 'a > b' occurs 0 times in rule.py, not once" in said
