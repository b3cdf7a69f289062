"""One logger tells what a run tells; the command line shows or files it."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.systems import chain5


@pytest.fixture
def record(tmp_path: Path) -> Path:
    path = tmp_path / "irf.npz"
    ms.write(path, chain5().impulse_response(200, noise=0.01, seed=0))
    return path


def test_notes_of_a_run_are_records_and_nothing_is_printed(
    record: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    with caplog.at_level(logging.DEBUG, "modalscope"):
        result = ms.analyze(record)
    told = [(entry.levelname, entry.getMessage()) for entry in caplog.records if entry.name == "modalscope"]
    assert [text for level, text in told if level == "INFO"][2:] == [str(note) for note in result.notes]
    assert any(level == "DEBUG" and text.startswith("settings: ") for level, text in told)
    assert capsys.readouterr() == ("", "")


def test_a_log_holds_every_remark_once_with_its_time(record: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = record.with_name("run.log")
    assert main(["identify", str(record), "-q", "--log", str(log)]) == 0
    assert "note:" not in capsys.readouterr().out
    lines = log.read_text(encoding="utf-8").splitlines()
    texts = [line[32:].strip() for line in lines]
    assert all(line[:4].isdecimal() for line in lines)
    assert len(texts) == len(set(texts)) > 3
    assert main(["identify", "missing.npz", "--log", str(log)]) == 2
    assert "ERROR" in log.read_text(encoding="utf-8")[-200:]


@pytest.mark.parametrize(
    ("flag", "remarks", "settings"), [("-q", False, False), ("-v", True, True), (None, True, False)]
)
def test_quiet_and_verbose_are_levels_of_the_log(
    record: Path, capsys: pytest.CaptureFixture[str], flag: str | None, remarks: bool, settings: bool
) -> None:
    assert main(["identify", str(record), *([flag] if flag else [])]) == 0
    said = capsys.readouterr().out
    assert ("impulse responses" in said, "settings: " in said) == (remarks, settings)


def test_comparisons_and_models_tell_their_notes(caplog: pytest.LogCaptureFixture) -> None:
    data = chain5().impulse_response(200, noise=0.01, seed=0)
    with caplog.at_level(logging.INFO, "modalscope"):
        comparison = ms.compare(data, ["era/time", "least_squares/time"], orders=range(2, 13, 2))
        model = ms.realize(data, order=10)
    told = [entry.getMessage() for entry in caplog.records]
    assert {comparison.headline, comparison.verdict, *map(str, comparison.notes), *map(str, model.notes)} <= set(told)
