"""Tests lie as the sources do: the test of src/modalscope/X/Y.py is tests/X/test_Y.py, and none lies where nobody looks for it.

A file that is named after no module states facts on several: in the folder of a package on that package, in `methods` on every
method of the table, and here on the whole.
"""

from __future__ import annotations

from pathlib import Path

from modalscope.interfaces.cli.commands import names
from tests.support import ROOT
from tools.house import circles, imported, measures, modules

SOURCE, TESTS = ROOT / "src" / "modalscope", ROOT / "tests"

CLI = Path("interfaces/cli")

#: Facts on every method of the table, files of every kind of export, and attacks on all of it.
ACROSS = {"methods", "attack"}

MODULES = {path.relative_to(SOURCE).with_suffix("") for path in SOURCE.rglob("*.py") if path.stem != "__init__"}
FILES = sorted(path.relative_to(TESTS) for path in TESTS.rglob("test_*.py"))


def module_of(file: Path) -> Path:
    """Return the module that a test file is named after."""
    return file.parent / file.stem.removeprefix("test_")


def test_every_folder_of_tests_is_a_package() -> None:
    folders = {file.parent.as_posix() for file in FILES} - {".", *ACROSS}
    assert [folder for folder in sorted(folders) if not (SOURCE / folder / "__init__.py").exists()] == []


def test_a_test_named_after_a_module_lies_in_its_folder() -> None:
    """Tests of commands take the names of these, which say nothing about a place."""
    meant = {}
    for file in (file for file in FILES if len(file.parts) > 1):
        module = module_of(file)
        of_command = file.parent == CLI and module.name in names()
        if module not in MODULES and not of_command:
            meant[file] = [other for other in MODULES if other.name == module.name and other.parent != CLI]
    assert {file: others for file, others in meant.items() if others} == {}


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Imports inside functions, for types and through a package's `__init__` count."""
    files = modules()
    assert circles({name: imported(path.read_text(encoding="utf-8"), files) for name, path in files.items()}) == []


#: A budget may lie above what is found by this much; then it is lowered.
SLACK = {"lines of code": 200, "functions": 10, "modules": 5}


def test_the_house_stays_within_its_budgets() -> None:
    """What exceeds its figure in tools/budgets.toml wants something to go; a figure that is too high wants to be lowered."""
    beyond, slack = [], []
    for measure in measures():
        room = next((most for word, most in SLACK.items() if measure.name.startswith(word)), 10)
        beyond += [measure] if measure.found > measure.most else []
        slack += [measure] if measure.most - measure.found > room else []
    assert (beyond, slack) == ([], [])
