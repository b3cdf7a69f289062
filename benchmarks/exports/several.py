"""Several files of one test, and several tests in one file, as exports. `python -m benchmarks.exports.several FIRST COUNT [-v]`."""

from __future__ import annotations

import re
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.io import loadmat, savemat

import modalscope as ms
from benchmarks.exports.draw import HALVES, Choices, draw_choices
from benchmarks.exports.truth import Truth, accelerances, draw_record, structure
from benchmarks.exports.verdict import obeyed, same, suggestions
from benchmarks.exports.write import Drawn, write
from modalscope.analysis.workflow.sources import opened
from modalscope.interfaces.cli.commands import build_parser
from modalscope.interfaces.cli.reading import reading_options
from modalscope.io.contents import SeveralTests

#: What several files are, and what one file of several tests is.
FILES = (
    "roving hammer", "repeated hits", "places and runs", "roving sensor", "roving input", "moved sensor", "a channel each", "nodes",
    "structures",
)  # fmt: skip
TESTS = ("sheets", "blocks", "structs")
#: Names that say nothing of a place, and those of places; a direction, and what is not varied, stand beside some.
_SILENT = ("beam {k}", "data{k}", "rec_0{k}", "M{k}", "bridge-{k}b")
_POINTS = (
    "P{k}",
    "point_0{k}",
    "{k}Z",
    "deck {k} +Z",
    "Pt {k} test 2",
    "pos{k}",
    "MP-0{k}",
    "X{k}",
    "{k}x_frf",
    "plate_p{k}_v2",
    "node{k}",
    "P{k}-Z",
    "MP {k}(-Z)",
)
#: Names of places and runs, and of runs.
_BOTH = ("P{k}_run{r}", "point {k} hit {r}", "{k}Z_{r}", "pos{k}({r})", "P{k}_0{r}")
_RUNS = ("run{k}a", "hit_{k}", "P9_{k}", "beam {k}", "P3 trial {k}", "Messung {k}")
#: Names of the side that moved.
_SENSORS = ("acc{k}", "{k}Z_1Z", "sensor_0{k}", "sensor-{k}-X", "out{k}_in1")
_FORCES = ("in{k}", "1Z_{k}Z", "out1_in{k}", "ref {k}")
_NAMES = {
    "roving hammer": (*_SILENT, *_POINTS, *_FORCES), "repeated hits": _RUNS, "places and runs": _BOTH,
    "roving sensor": (*_SILENT, *_POINTS, *_SENSORS), "roving input": (*_SILENT, *_POINTS, *_FORCES),
    "moved sensor": (*_POINTS, *_SENSORS), "a channel each": (*_SILENT, *_POINTS, *_SENSORS), "nodes": (*_SILENT, "node{k}", "sensor {k}"),
    "structures": (*_SILENT, "specimen {k}"),
}  # fmt: skip
_CALLED = ("plate", "beam"), ("Run 1", "Run 2"), ("deck north", "deck south")


@dataclass
class Test:
    """What was written: files, what they are of, the drawn files, and the names of tests in one file."""

    paths: list[Path]
    kind: str
    drawn: list[Drawn]
    names: tuple[str, ...] = ()
    style: str = ""

    @property
    def places(self) -> int:
        """How many places were measured; those of several runs are a half."""
        return len(self.drawn) // (2 if self.kind == "places and runs" else 1)


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
    """Write several files of one structure: one place or channel a file, or hits on one place; or a structure a file."""
    count, places = int(rng.integers(3, 6)), int(rng.integers(3, 6))
    count = {"repeated hits": count, "nodes": 3, "places and runs": 2 * places}.get(kind, places)
    of, style = structure(rng, places), str(rng.choice(_NAMES[kind]))
    if choices["container"] in ("npy", "mat matrix"):  # nothing says what is a force, or a unit
        choices["container"] = "csv"
    lines = kind in ("roving sensor", "roving input") or (kind == "structures" and bool(rng.integers(2)))
    choices["content"] = str(rng.choice(("parts", "polar degrees"))) if lines else "hammer"
    choices["axis"] = "Hz" if lines else choices["axis"]
    choices["head"] = "names" if kind in ("a channel each", "nodes") and choices["head"] == "none" else choices["head"]
    if kind in ("a channel each", "nodes"):
        choices["content"] = "ambient"
    if kind == "nodes" and choices["axis"] in ("clock", "stamps"):  # whose starts differ
        choices["axis"] = "epoch"
    rate, seed_of = float(rng.choice((200.0, 512.0, 1000.0))), int(rng.integers(1 << 30))
    drawn = []
    for k in range(count):
        place, run = (k // 2, k % 2) if kind == "places and runs" else (k, 0)
        truth = _truth(kind, of, place, rate, seed_of, run, lines)
        drawn.append(write(folder, seed, choices, truth, f"{seed} {style.format(k=place + 1, r=run + 1)}"))
    return Test([each.path for each in drawn], kind, drawn, style=style)


def _truth(
    kind: str, of: tuple[np.ndarray, ...], k: int, rate: float, seed: int, run: int = 0, lines: bool = False
) -> Truth:
    """Return what the file of the k-th place or structure holds."""
    places = len(of[2])
    if kind == "structures":  # of the same places; masses differ
        change = np.random.default_rng([seed, 7, k]).uniform(0.9, 1.1, of[0].shape)
        of, place = (of[0] * change, *of[1:]), 0
    if lines:
        f = np.arange(300.0)
        rng = np.random.default_rng([seed, k])
        shift = 1 - 0.0025 * rng.random() * (kind == "roving sensor")  # by the mass of the sensor
        H = accelerances(f, f[-1], (of[0] * shift, *of[1:]), k if kind == "roving input" else 0)
        H = H[:, [k]] if kind == "roving sensor" else H[:, [0]]
        noise = rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)
        return Truth("parts", f, H + 0.003 * np.sqrt(np.mean(np.abs(H) ** 2)) * noise)
    if kind == "nodes":
        return _node(of, k, rate, seed)
    content = "ambient" if kind == "a channel each" else "hammer"
    rng = np.random.default_rng([seed, 0 if kind == "a channel each" else k, run])
    place = k if kind in ("roving hammer", "places and runs") else 0
    truth = draw_record(rng, content, places, rate, lambda f, top: accelerances(f, top, of, place))
    rows = 260  # each as long as the others
    truth.axis, truth.outputs = truth.axis[:rows], truth.outputs[:rows]
    truth.inputs = None if truth.inputs is None else truth.inputs[:rows]
    if kind in ("a channel each", "moved sensor"):
        truth.outputs = truth.outputs[:, [k]]
    return truth


def _node(of: tuple[np.ndarray, ...], k: int, rate: float, seed: int) -> Truth:
    """Return what a wireless node with a clock of its own takes of one motion: it begins late, and its steps are longer or shorter."""
    rng = np.random.default_rng([seed, 9])
    rows, finer = 2000, 8
    force = rng.standard_normal(2 * finer * rows)
    lines = np.fft.rfftfreq(force.size, 1 / (finer * rate))
    spectrum = np.fft.rfft(force)[:, None] * accelerances(lines, rate / 4, of, 0) * (lines < rate / 3)[:, None]
    motion = CubicSpline(np.arange(force.size) / (finer * rate), np.fft.irfft(spectrum, force.size, axis=0)[:, k])
    late, drift = rng.uniform(0, 0.2 * rows / rate, 3)[k], rng.uniform(-200, 200, 3)[k]
    own = late + np.arange(rows) / rate * (1 + 1e-6 * drift)
    truth = Truth("ambient", own, motion(own)[:, None], None, rate)
    truth.motion = motion
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
        if test.kind == "structures" and ["--each"] in ways:  # asked, not averaged
            return "right", str(error)
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
    return _is_whole(test, data, said), said


def _is_whole(test: Test, data: Any, notes: str) -> bool:
    """Whether data have the channels, places and runs of a test, with its values; or, of structures, whether notes say so."""
    truths, count = [each.truth for each in test.drawn], test.places
    if test.kind == "structures":
        return "--each" in notes
    if test.kind in ("roving sensor", "roving input", "moved sensor"):
        # where no name says which of the two moved, either is right: it is one answer by reciprocity
        shapes = (
            {(count, 1)}
            if test.style in _SENSORS
            else {(1, count)}
            if test.style in _FORCES
            else {(count, 1), (1, count)}
        )
        if test.kind == "moved sensor":
            return (len(set(data.output_dofs)), len(set(data.input_dofs))) in shapes
        wanted = np.stack([truth.outputs[:, 0] for truth in truths], axis=1)
        if not isinstance(data, ms.FrequencyResponse) or data.values.shape[1:] not in shapes:
            return False
        return _called(test, data.output_dofs if len(data.output_dofs) > 1 else data.input_dofs) and _alike(
            data.values.reshape(len(data.values), -1), wanted
        )
    if test.kind in ("a channel each", "nodes"):
        if not isinstance(data, ms.Signals) or data.runs != 1 or len(data.output_dofs) != count:
            return False
        if test.kind == "nodes":
            return "drift" in notes and _on_one_clock(data, truths)
        return _called(test, data.output_dofs) and _alike(
            data.outputs, np.concatenate([t.outputs for t in truths], axis=1)
        )
    places = 1 if test.kind == "repeated hits" else count
    inputs = getattr(data, "input_dofs", ())
    named = test.kind == "repeated hits" or _called(test, tuple(dict.fromkeys(inputs)))
    return named and len(set(inputs)) == places and len(data.output_dofs) == truths[0].outputs.shape[1]


def _called(test: Test, labels: Sequence[str]) -> bool:
    """Whether places have the numbers that the names of their files say, in turn."""
    if test.style in _SILENT:
        return True
    return [re.findall(r"\d+", label)[:1] for label in labels] == [[str(k + 1)] for k in range(test.places)]


def _on_one_clock(data: ms.Signals, truths: Sequence[Truth]) -> bool:
    """Whether channels are the motion at common times, but for factors and what splines lose."""
    begin = max(truth.axis[0] for truth in truths)
    times = begin + np.arange(data.samples) / data.sampling_rate
    wanted = np.stack([truth.motion(times) for truth in truths], axis=1)
    factor = np.sum(data.outputs * wanted, axis=0) / np.sum(data.outputs**2, axis=0)  # some files are scaled
    rest = np.linalg.norm(factor * data.outputs - wanted, axis=0) / np.linalg.norm(wanted, axis=0)
    return bool(data.samples > 0.5 * len(truths[0].axis) and rest.max() < 0.1)


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
