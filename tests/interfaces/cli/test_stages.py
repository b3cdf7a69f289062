"""What a terminal shows while a command works: the stage that it is in, and its end."""

from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby
from pathlib import Path

import pytest

from modalscope.interfaces.cli import main, process
from modalscope.interfaces.cli.process import VOICE, listen, progress, say

#: What an analysis names.
ANALYSIS = ("reading", "preparing", "factoring", "selecting", "refining", "examining")

#: Command, with its files by suffix -> the stages that it names.
COMMANDS = {
    "info record.npz": ["reading", "examining"],
    "convert record.npz other.npz": ["reading", "writing other.npz"],
    "merge record.npz record.npz -o both.npz": ["reading", "writing both.npz"],
    "simulate chain5 -o new.npz": ["simulating", "writing new.npz"],
    "frf record.npz -o frf.npz -o frf.svg": [
        *("reading", "estimating responses", "writing frf.npz", "drawing frf.svg", "examining")
    ],
    "psd record.npz -o psd.svg": ["reading", "estimating spectra", "finding peaks", "drawing psd.svg"],
    "ods record.npz --time 1 -o shapes.npz": ["reading", "computing shapes", "writing shapes.npz"],
    "plot record.npz -o picture.svg": ["reading", "drawing picture.svg"],
    "realize record.npz --order 10 -o model.npz": ["reading", "identifying", "writing model.npz"],
    "validate model.npz record.npz -o seen.svg": ["reading", "validating", "drawing seen.svg"],
    "identify test.uff --orders 6:12:2 -o modes.json -o report.html": [
        *("identifying", *ANALYSIS, "writing modes.json", "writing report.html")
    ],
    "refine test.uff --modes modes.json -o refined.csv": ["reading", "refining", "writing refined.csv"],
    "certify test.uff --orders 10:10 --no-refine --replicates 2": [
        *("identifying", "reading", "preparing", "factoring", "selecting", "examining", "simulating")
    ],
    "report modes.json -o again.html": ["identifying", *ANALYSIS, "writing again.html"],
    "mac modes.json modes.json -o mac.svg": ["reading", "drawing mac.svg"],
    "compare test.uff --methods era/z lscf --orders 6:10:2 -o -": [
        *("reading", "comparing", "weighing the candidates of all", "selecting", "factoring"),
        *("identifying by the usual method", "preparing", "refining", "examining", "writing"),
    ],
}


@pytest.fixture
def shown(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[[], str]:
    """Return a function that gives what stderr, a terminal, was told since it was called."""
    monkeypatch.setattr(process, "_on_terminal", lambda: True)
    return lambda: capsys.readouterr().err


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Return how time goes on: by hand."""
    now = [0.0]
    monkeypatch.setattr(process, "monotonic", lambda: now[0])

    def wait(seconds: float) -> None:
        now[0] += seconds

    return wait


def stages_of(text: str) -> list[str]:
    """Return the names of stages that were shown, one after the other."""
    return re.findall(r"([^\r\n.]+(?:\.\w+)?) \.\.\.", text)


@pytest.mark.slow
def test_every_command_names_its_stages(
    tmp_path: Path, shown: Callable[[], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert (
        main(["simulate", "chain5", "--kind", "records", "--samples", "2000", "--noise", "40", "-o", "record.npz"]) == 0
    )
    assert main(["simulate", "chain5", "--samples", "200", "--noise", "40", "-o", "test.uff"]) == 0
    for words, stages in COMMANDS.items():
        shown()
        assert main(words.split()) == 0, words
        assert list(dict.fromkeys(stages_of(shown()))) == stages, words


@pytest.mark.parametrize(("seconds", "told"), [(1.0, ""), (1.1, "reading: done in 1.1 s\n")])
def test_the_end_of_a_stage_is_told_from_a_second_on(
    seconds: float, told: str, shown: Callable[[], str], clock: Callable[[float], None]
) -> None:
    with progress("reading"):
        clock(seconds)
    assert shown() == f"reading ...\r{' ' * 11}\r{told}"


@pytest.mark.parametrize(
    ("verbose", "times"),
    [
        (False, ["identifying: done in 14.0 s"]),
        (True, ["reading: done in 3.0 s", "selecting: done in 5.0 s", "identifying: done in 6.0 s"]),
    ],
)
def test_a_stage_within_another_gives_the_line_back_and_verbose_has_its_own_time(
    verbose: bool, times: list[str], shown: Callable[[], str], clock: Callable[[float], None]
) -> None:
    listen(False, verbose, None)
    with progress("identifying") as show:
        clock(2.0)
        with progress("reading"):
            clock(3.0)
        show(1, 2)
        clock(4.0)
        show(2, 2)
        with progress("selecting"):
            clock(5.0)
        with progress("refining"):  # no time is told
            pass
    listen(False, False, None)
    told = shown()
    named = [name for name, _ in groupby(stages_of(told))]
    assert named == ["identifying", "reading", "identifying", "selecting", "identifying", "refining", "identifying"]
    assert "identifying:  50%" in told
    assert [line for line in re.split(r"[\r\n]+", told) if "done" in line] == times


def test_what_is_counted_keeps_its_bar_whatever_stages_are_within(
    shown: Callable[[], str], clock: Callable[[float], None]
) -> None:
    with progress("simulating") as show:
        show(1, 3)
        with progress("factoring"):
            clock(5.0)
        show(3, 3)
        with progress("examining"):
            clock(2.0)
    told = shown()
    assert list(dict.fromkeys(stages_of(told))) == ["simulating", "examining"]
    assert told.endswith("simulating: done in 7.0 s\n")


def test_the_work_of_another_thread_has_no_line(shown: Callable[[], str]) -> None:
    with ThreadPoolExecutor(1) as pool, progress("comparing"):
        pool.submit(progress("selecting").__enter__).result()
    assert stages_of(shown()) == ["comparing"]


def test_what_may_count_nothing_is_named_when_it_counts(
    shown: Callable[[], str], clock: Callable[[float], None]
) -> None:
    with progress("summing", "stretch", at_once=False) as show, progress("identifying"):
        clock(5.0)
        show(1, 2)
        clock(5.0)
        show(2, 2)
    told = shown()
    assert stages_of(told) == ["identifying", "identifying"]
    assert "summing:  50%" in told
    assert told.endswith("identifying: done in 10.0 s\nsumming: done in 5.0 s\n")
    with progress("summing", "stretch", at_once=False):
        clock(5.0)
    assert not shown()


def test_results_stand_on_lines_of_their_own(shown: Callable[[], str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(VOICE, "aside", True)  # one terminal shows both
    with progress("comparing"):
        say("era: 3 modes")
    assert f"\r{' ' * 13}\rera: 3 modes\ncomparing ..." in shown()


def test_a_stage_that_fails_leaves_an_empty_line(shown: Callable[[], str], clock: Callable[[float], None]) -> None:
    def fail() -> None:
        with progress("reading"):
            clock(5.0)
            raise ValueError("no file")

    with pytest.raises(ValueError, match="no file"):
        fail()
    assert shown() == f"reading ...\r{' ' * 11}\r"


def test_without_a_terminal_or_with_quiet_no_stage_is_named(
    test_file: Path, shown: Callable[[], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["info", str(test_file), "--quiet"]) == 0
    assert not shown()
    monkeypatch.undo()
    assert main(["info", str(test_file)]) == 0
    assert not shown()
