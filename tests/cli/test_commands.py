"""The list of commands, in the order of the help, which costs the import of no numerical library."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

import modalscope
from modalscope.cli import main
from modalscope.cli.commands import COMMANDS, Command


def test_every_command_stands_in_the_help_in_order(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    listed = re.findall(r"^    (\w+)(?:  |$)", capsys.readouterr().out, re.MULTILINE)
    assert listed == [command.name for command in COMMANDS]


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


@pytest.mark.parametrize("question", ["--help", "--version"])
def test_a_question_alone_loads_no_numerical_library(question: str) -> None:
    command = [sys.executable, "-X", "importtime", "-m", "modalscope", question]
    loaded = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    assert "modalscope.cli.identify" in loaded
    assert re.findall(r"\b(?:numpy|scipy|matplotlib|tqdm)\b", loaded) == []
