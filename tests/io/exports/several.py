"""Several files of one test, and several tests in one file, as exports. `python -m tests.io.exports.several FIRST COUNT [-v]`."""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, savemat

import modalscope as ms
from modalscope.analysis.workflow.sources import opened
from modalscope.interfaces.cli.commands import build_parser
from modalscope.interfaces.cli.reading import reading_options
from modalscope.io.contents import SeveralTests
from tests.io.exports.draw import HALVES, Choices, draw_choices
from tests.io.exports.truth import Truth, accelerances, draw_record, structure
from tests.io.exports.verdict import obeyed, same, suggestions
from tests.io.exports.write import Drawn, write

#: What several files are, and what one file of several tests is.
FILES = ("roving hammer", "repeated hits", "roving sensor", "roving input", "a channel each")
TESTS = ("sheets", "blocks", "structs")
#: How files of one test are named; how tests in a file are.
_NAMES = ("P{k}", "point_0{k}", "beam {k}", "{k}Z_1Z", "run{k}a")
_CALLED = ("plate", "beam"), ("Run 1", "Run 2"), ("deck north", "deck south")


@dataclass
class Test:
    """What was written: files, what they are of, the drawn files, and the names of tests in one file."""

    paths: list[Path]
    kind: str
    drawn: list[Drawn]
    names: tuple[str, ...] = ()


def drawn_test(folder: Path, seed: int) -> Test:
    """Write the files of a seed into a folder."""
    rng = np.random.default_rng([seed, 2])
    kind = str(rng.choice([*FILES, *TESTS]))
    half = list(HALVES)[seed % 2]
    choices = draw_choices(np.random.default_rng([seed, 0]), half)
    choices |= dict.fromkeys(("oddity", "other", "extra", "more", "drive", "coherence"), "absent") | {"telling": "yes"}
    known = ("s", "ms", "us", "stamps", "clock", "epoch", "epoch ms")
    choices["axis"] = choices["axis"] if choices["axis"] in known else "s"
    return _files(rng, folder, seed, choices, kind) if kind in FILES else _tests(rng, folder, seed, choices, kind)


def _files(rng: np.random.Generator, folder: Path, seed: int, choices: Choices, kind: str) -> Test:
    """Write several files of one structure: one place or channel a file, or hits on one place."""
    count, places = int(rng.integers(3, 6)), int(rng.integers(3, 6))
    count = places if kind != "repeated hits" else count
    of, style = structure(rng, places), str(rng.choice(_NAMES))
    if choices["container"] in ("npy", "mat matrix"):  # nothing says what is a force, or a unit
        choices["container"] = "csv"
    lines = kind in ("roving sensor", "roving input")
    choices["content"] = str(rng.choice(("parts", "polar degrees"))) if lines else "hammer"
    choices["axis"] = "Hz" if lines else choices["axis"]
    choices["head"] = "names" if kind == "a channel each" and choices["head"] == "none" else choices["head"]
    if kind == "a channel each":
        choices["content"] = "ambient"
    rate, seed_of = float(rng.choice((200.0, 512.0, 1000.0))), int(rng.integers(1 << 30))
    drawn = []
    for k in range(count):
        truth = _truth(kind, of, k, rate, seed_of)
        drawn.append(write(folder, seed, choices, truth, f"{seed} {style.format(k=k + 1)}"))
    return Test([each.path for each in drawn], kind, drawn)


def _truth(kind: str, of: tuple[np.ndarray, ...], k: int, rate: float, seed: int) -> Truth:
    """Return what the k-th file holds."""
    places = len(of[2])
    if kind in ("roving sensor", "roving input"):
        f = np.arange(300.0)
        rng = np.random.default_rng([seed, k])
        H = accelerances(f, f[-1], of, 0 if kind == "roving sensor" else k)
        H = H[:, [k]] if kind == "roving sensor" else H[:, [0]]
        noise = rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)
        return Truth("parts", f, H + 0.003 * np.sqrt(np.mean(np.abs(H) ** 2)) * noise)
    content = "ambient" if kind == "a channel each" else "hammer"
    rng = np.random.default_rng([seed, 0 if kind == "a channel each" else k])
    place = k if kind == "roving hammer" else 0
    truth = draw_record(rng, content, places, rate, lambda f, top: accelerances(f, top, of, place))
    rows = 260  # each as long as the others
    truth.axis, truth.outputs = truth.axis[:rows], truth.outputs[:rows]
    truth.inputs = None if truth.inputs is None else truth.inputs[:rows]
    if kind == "a channel each":
        truth.outputs = truth.outputs[:, [k]]
    return truth


def _tests(rng: np.random.Generator, folder: Path, seed: int, choices: Choices, kind: str) -> Test:
    """Write two tests into one file: as sheets, below each other under heads of their own, or as two structs of MATLAB."""
    names = _CALLED[int(rng.integers(len(_CALLED)))]
    choices["container"] = {"sheets": "xlsx", "blocks": "csv", "structs": "mat struct"}[kind]
    choices["encoding"], choices["quotes"] = "utf-8", "absent"
    choices["decimal"] = "point" if kind != "blocks" or choices["separator"] == "comma" else choices["decimal"]
    choices["content"] = str(rng.choice(("hammer", "ambient", "parts")))
    lines = choices["content"] == "parts"
    choices["axis"] = "Hz" if lines else "s" if choices["axis"] in ("ms", "us") else choices["axis"]
    if kind == "structs" and choices["axis"] not in ("s", "Hz"):
        choices["axis"] = "s"
    if kind == "blocks" and choices["header"] == "absent":
        choices["header"] = "colon"
    choices["header"] = "absent" if choices["header"] in ("comments", "sections") else choices["header"]
    choices["header"] = "colon" if kind == "blocks" and choices["header"] == "absent" else choices["header"]
    drawn = [write(folder, seed + 10_000_000 * k, choices, name=f"{seed} {k}") for k in range(2)]
    path = folder / f"{seed}{drawn[0].path.suffix}"
    if kind == "structs":
        held = [loadmat(each.path)[{"near": "test", "far": "Data"}[choices["half"]]] for each in drawn]
        names = tuple(name.replace(" ", "_") for name in names)
        savemat(path, dict(zip(names, held, strict=True)))
    elif kind == "blocks":
        texts = [each.path.read_text("utf-8") for each in drawn]
        key = {"colon": "Test: ", "equals": "Test=", "cells": "Test: "}[choices["header"]]
        path.write_text("".join(f"{key}{name}\n{text}" for name, text in zip(names, texts, strict=True)), "utf-8")
    else:
        _joined_sheets(path, [each.path for each in drawn], names)
    return Test([path], kind, drawn, names)


def _joined_sheets(path: Path, books: list[Path], names: tuple[str, ...]) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, one in zip(names, books, strict=True):
        sheet = book.create_sheet(name)
        for row in openpyxl.load_workbook(one).active.iter_rows(values_only=True):
            sheet.append(row)
    book.save(path)


# verdicts


def verdict(test: Test) -> tuple[str, str]:
    """Return how files are read: "wrong and said" where an option that is printed mends it, "refused, remedy works" likewise."""
    try:
        if test.kind in TESTS:
            return _of_tests(test)
        good, notes = _of_files(test, [])
    except ms.DataError as error:
        ways = suggestions(error.args[0])
        return ("refused, remedy works" if any(_mends(test, way) for way in ways) else "refused"), str(error)
    except Exception as error:  # noqa: BLE001 - whatever it is, a user sees a traceback
        return "crash", f"{type(error).__name__}: {error}"
    if good:
        return "right", ""
    return ("wrong and said" if any(_mends(test, way) for way in suggestions(notes)) else "wrong in silence"), notes


def _mends(test: Test, way: list[str]) -> bool:
    try:
        return _of_files(test, way)[0] if test.kind in FILES else False
    except (ms.DataError, SystemExit):
        return False


def _of_files(test: Test, words: list[str]) -> tuple[bool, str]:
    """Return whether files together are what was measured, and the notes."""
    rate = test.drawn[0].truth.rate
    words = [f"{rate or 1000.0:.9g}" if word == "HZ" else word for word in words]
    parsed = build_parser().parse_args(["info", *map(str, test.paths), *words])
    data, _, notes = opened(test.paths, [reading_options(parsed, path) for path in test.paths])
    said = f"{type(data).__name__} | {'; '.join(str(note) for note in notes)}"
    return _is_whole(test, data), said


def _is_whole(test: Test, data: Any) -> bool:
    """Whether data have the channels, places and runs of a test, with its values."""
    truths, count = [each.truth for each in test.drawn], len(test.drawn)
    if test.kind in ("roving sensor", "roving input"):
        if not isinstance(data, ms.FrequencyResponse):
            return False
        wanted = np.stack([truth.outputs[:, 0] for truth in truths], axis=1)
        shape = (count, 1) if test.kind == "roving sensor" else (1, count)
        return data.values.shape[1:] == shape and _alike(data.values.reshape(len(data.values), -1), wanted)
    if test.kind == "a channel each":
        wanted = np.concatenate([truth.outputs for truth in truths], axis=1)
        return isinstance(data, ms.Signals) and data.outputs.shape == wanted.shape and _alike(data.outputs, wanted)
    places = count if test.kind == "roving hammer" else 1
    inputs = getattr(data, "input_dofs", ())
    return len(set(inputs)) == places and len(data.output_dofs) == truths[0].outputs.shape[1]


def _alike(found: np.ndarray, wanted: np.ndarray) -> bool:
    """Whether values are those that were measured but for one factor: units."""
    factor = np.vdot(found, wanted) / np.vdot(found, found)
    return bool(np.abs(factor * found - wanted).max() < 1e-4 * np.abs(wanted).max())


def _of_tests(test: Test) -> tuple[str, str]:
    """Return the verdict on several tests in one file."""
    path = test.paths[0]
    try:
        survey = obeyed(path, [])
    except SeveralTests as several:
        right = [
            same(each, _chosen(path, name)) != "wrong" for each, name in zip(test.drawn, several.names, strict=False)
        ]
        if len(several.names) == len(test.drawn) and all(right):
            return "right", ""
        return "refused", f"{several.names}, {right}"
    notes = " ".join(map(str, survey.notes))
    ways = suggestions(notes)
    others = [same(each, obeyed(path, way).thing) != "wrong" for each in test.drawn for way in ways]
    if any(same(each, survey.thing) != "wrong" for each in test.drawn) and any(others):
        return "right", ""
    return ("wrong and said" if any(others) else "wrong in silence"), f"{survey.result} | {notes}"


def _chosen(path: Path, name: str) -> Any:
    return obeyed(path, ["--test", name]).thing


def measure(first: int, count: int, report: bool = False) -> list[tuple[str, str]]:
    """Return kind and verdict of so many seeds."""
    rows = []
    for seed in range(first, first + count):
        with tempfile.TemporaryDirectory() as name:
            test = drawn_test(Path(name), seed)
            word, message = verdict(test)
            rows.append((test.kind, word))
            if report and word != "right":
                print(f"--- {seed} {test.kind}: {word}: {test.drawn[0].choices}\n    {message[:500]}")
    return rows


def table(rows: list[tuple[str, str]]) -> str:
    """Return how often each verdict fell, in all and by kind."""
    counts = Counter(word for _, word in rows)
    lines = [f"all {len(rows)}: {dict(counts)}"]
    return "\n".join(lines + [f"{kind}: {dict(Counter(w for k, w in rows if k == kind))}" for kind in (*FILES, *TESTS)])


if __name__ == "__main__":
    print(table(measure(int(sys.argv[1]), int(sys.argv[2]), "-v" in sys.argv)))
