"""However a command ends, a user reads one line, and a shell gets the status it expects."""

from __future__ import annotations

import errno
from typing import Any

import pytest

from modalscope.interfaces.cli import commands, main
from modalscope.interfaces.cli.files import add_info


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (MemoryError(), 2, "modalscope: out of memory; use fewer orders, channels, lines"),
        (OSError(errno.ENOSPC, "No space left on device"), 2, "modalscope: the system refuses: no space left on device\n"),
        (KeyboardInterrupt(), 130, "modalscope: stopped; no file was written\n"),
        (BrokenPipeError(), 0, ""),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)  # fmt: skip
def test_what_no_command_can_help_is_one_line(
    error: BaseException, status: int, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def info(_: Any) -> None:
        raise error

    monkeypatch.setattr(commands, "COMMANDS", (commands.Command(info, add_info),))
    assert main(["info", "a.npz"]) == status
    told = capsys.readouterr()
    assert told.err.startswith(line)
    assert told.err.count("\n") == (1 if line else 0)
    assert not told.out


def test_a_fault_of_the_program_is_not_taken_for_one_of_the_data(monkeypatch: pytest.MonkeyPatch) -> None:
    def info(_: Any) -> None:
        raise ValueError("no DataError")

    monkeypatch.setattr(commands, "COMMANDS", (commands.Command(info, add_info),))
    with pytest.raises(ValueError, match="no DataError"):
        main(["info", "a.npz"])


def test_a_line_of_complaint_is_short_and_printable(capsys: pytest.CaptureFixture[str]) -> None:
    from modalscope.interfaces.cli.process import complain

    complain("a\x1b[2J\nb" + "c" * 3000)
    told = capsys.readouterr().err
    assert told.startswith("modalscope: a\\x1b[2J b")
    assert told.count("\n") == 1
    assert len(told) < 620
