"""The list of commands, in the order of the help, which costs the import of no numerical library."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

import modalscope
from modalscope.interfaces.cli import main
from modalscope.interfaces.cli.commands import COMMANDS, Command


def test_every_command_stands_in_the_help_in_order(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    listed = re.findall(r"^    (\w+)(?:  |$)", capsys.readouterr().out, re.MULTILINE)
    assert listed == [command.name for command in COMMANDS]


@pytest.mark.parametrize("words", [[], ["-q"]])
def test_no_command_prints_what_there_is_in_groups(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 0
    said = capsys.readouterr().out
    assert re.findall(r"^(\w+)$", said, re.MULTILINE) == ["first", "look", "check", "models", "files"]
    assert "\n  modalscope identify test.uff -o report.html\n" in said


def test_options_stand_in_groups_and_the_usage_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["identify", "--help"])
    said = capsys.readouterr().out
    assert said.startswith("usage: modalscope identify [options] FILE [FILE ...]\n")
    titles = re.findall(r"^([\w ,.()]+):$", said, re.MULTILINE)
    assert titles.index("method and orders") < titles.index("output") < titles.index("tables and bare numbers")


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_every_command_explains_itself(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main([command.name, "--help"])
    assert stop.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: modalscope {command.name}")


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out.strip() == modalscope.__version__


def test_the_help_lists_what_most_need_and_that_of_experts_all(capsys: pytest.CaptureFixture[str]) -> None:
    listed = []
    for words in ([], ["expert"]):
        with pytest.raises(SystemExit):
            main(["identify", "--help", *words])
        listed.append(set(re.findall(r"^  (?:-\w.*, )?(--[\w-]+)", capsys.readouterr().out, re.MULTILINE)))
    usual, everything = listed
    assert usual < everything
    assert len(usual) <= 32
    assert {"--row-shifts", "--scheduler", "--max-memory"} <= everything - usual


@pytest.mark.parametrize("question", ["--help", "--version"])
def test_a_question_alone_loads_no_numerical_library(question: str) -> None:
    command = [sys.executable, "-X", "importtime", "-m", "modalscope", question]
    loaded = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    assert "modalscope.interfaces.cli.identify" in loaded
    assert re.findall(r"\b(?:numpy|scipy|matplotlib|tqdm)\b", loaded) == []
