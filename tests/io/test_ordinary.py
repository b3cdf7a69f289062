"""Ordinary files: each is read as it is, or refused with the option that reads it, and that option then gives the right numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
import modalscope.io as mio
from benchmarks.exports.verdict import dead_ends, message, obeyed, suggestions
from tests.io.ordinary import CASES, FREQUENCIES, HITS, RATE, RESPONSES, Case
from tests.support import refused

#: Files that hold less than it takes: no header, no unit, no rate, or a doubt that only the user can settle.
REFUSED = {
    "three bare columns without a rate": "--sampling-rate",
    "an uneven clock": "--ignore",
    "a clock that stood still once": "--rows",
    "a clock of another rate than the header": "--sampling-rate",
    "two clocks of different rates": "--ignore",
    "an index before the columns": "--sampling-rate",
    "one column of decimal commas": "--sampling-rate",
    "one column of commas that may part two": "--decimal",
    "times printed to a millisecond": "--sampling-rate",
    "semicolons and numbers that may be thousands": "--decimal",
    "every row a channel with its name": "--transpose",
    "every row a channel without a name": "--transpose",
    "a gap in all channels": "--rows",
    "one array without a rate": "--sampling-rate",
    "one array with channels in rows": "--transpose",
    "hits as columns": "--axes",
    "a workbook of two tables": "--test",
    "a column that says overload": "--ignore",
}


def is_right(thing: Any, case: Case) -> bool:
    if case.kind == "lines":
        if not isinstance(thing, ms.FrequencyResponse) or thing.values.shape != (*RESPONSES.shape, 1):
            return False
        return np.allclose(thing.frequencies, FREQUENCIES) and np.allclose(thing.values[:, :, 0], RESPONSES, atol=1e-6)
    if case.kind != "record":
        outputs = HITS[:, :, 1:] if case.kind == "hits" else HITS[:, :, 1:2]
        same = thing.outputs.shape == outputs.shape and thing.inputs.shape == HITS[:, :, :1].shape
        return same and np.array_equal(thing.outputs, outputs) and np.array_equal(thing.inputs, HITS[:, :, :1])
    if not isinstance(thing, ms.Signals) or not np.isclose(thing.sampling_rate, RATE, rtol=1e-9):
        return False
    held = [] if thing.inputs is None else [thing.inputs]
    wanted = [case.channels[:, case.outputs]] + ([case.channels[:, case.inputs]] if case.inputs else [])
    return all(
        a.shape == b.shape and np.allclose(a, b, atol=2e-6) for a, b in zip([thing.outputs, *held], wanted, strict=True)
    )


def attempts(path: Path, limit: int = 3) -> tuple[list[list[str]], list[Any]]:
    """Read a file as its messages say, at most so often: the words of each way, and the things that ways ended in."""
    waiting: list[list[str]] = [[]]
    tried: list[list[str]] = []
    things = []
    for _ in range(limit):
        further = []
        for words in waiting:
            tried.append(words)
            try:
                things.append(obeyed(path, words, RATE).thing)
            except ms.DataError as error:
                further += [[*words, *more] for more in suggestions(error.args[0])]
        waiting = further
    return tried, things


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_an_ordinary_file_is_read_or_names_the_option_that_reads_it(tmp_path: Path, name: str) -> None:
    case = CASES[name]
    path = tmp_path / f"file{case.suffix}"
    case.write(path)
    tried, things = attempts(path)
    assert any(is_right(thing, case) for thing in things)
    assert not dead_ends(path, message(path), RATE)
    if name in REFUSED:
        assert any(REFUSED[name] in words for words in tried)
    else:
        assert tried == [[]]
        assert mio.survey(path).found


def test_there_are_more_than_forty_and_most_are_read_at_once() -> None:
    assert len(CASES) >= 40
    assert len(REFUSED) < len(CASES) / 3


def test_rows_of_another_length_and_texts_among_numbers_are_named_by_their_line(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    good = [f"{k / 100:.2f},{k % 7},{k % 5}" for k in range(900)]
    path.write_text("Time,Force,AccA\n" + "\n".join([*good[:700], "7.0,1", *good[701:]]))
    refused(r"line 702 has 2: \['7.0', '1'\]", ms.read, path)
    path.write_text("Time,Force,AccA\n" + "\n".join([*good[:700], "7.00,1,OVL", *good[701:]]))
    refused(r"line 702 holds 'OVL' there(.|\n)*ignore=\[3\]", ms.read, path)
    path.write_text(
        "Time,Force,AccA,AccB\n" + "\n".join(f"{line},{'OVL' if k == 700 else 1}" for k, line in enumerate(good))
    )
    assert ms.read(path, ignore=4).output_dofs == ("AccA",)


def test_rows_of_many_samples_are_read_when_they_are_said_to_be_channels(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("".join(",".join(map(str, row)) + "\n" for row in np.arange(60_000).reshape(2, 30_000) % 7))
    refused("29999 cells in line 1(.|\n)*transpose=True", ms.read, path, sampling_rate=100.0)
    assert ms.read(path, sampling_rate=100.0, transpose=True).outputs.shape == (30_000, 2)
