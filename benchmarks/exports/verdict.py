"""Say what became of a file: read right, refused with a remedy that works, wrong in silence, and so on."""

from __future__ import annotations

import re
import shlex
import time
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

import modalscope as ms
from benchmarks.exports.draw import HALVES, PLAIN, Choices, draw_choices
from benchmarks.exports.write import Drawn, write
from modalscope.data.units import in_si
from modalscope.interfaces.cli.commands import build_parser
from modalscope.interfaces.cli.reading import reading_options

#: Verdicts, from good to bad, and what each costs.
COSTS = {
    "right": 0.0, "names or units lost": 0.2, "refused, remedy works": 0.5, "wrong and said": 1.0, "refused": 2.0, "wrong in silence": 5.0,
    "crash": 5.0,
}  # fmt: skip
#: Options that take no value.
_FLAGS = ("--all", "--conjugate", "--each", "--no-reciprocal", "--transpose")
_SECONDS = 20.0


def suggestions(text: str) -> list[list[str]]:
    """Return the options that a message names, as words of a command line, each way by itself."""
    ways = []
    for part in re.split(r",? (?:or|if|else)\b[^-\"']*(?=--)|(?<=[ (])(?=--)(?<![\w\"'] )", text):
        if "--" not in part:
            continue
        try:
            outside = re.sub(r"(\"[^\"]*\"|'[^']*')|\)", lambda found: found[1] or " ", part[part.index("--") :])
            words = shlex.split(outside.replace(";", " ;").rstrip("."))
        except ValueError:
            continue
        way: list[str] = []
        while words and words[0].startswith("--"):
            count = 1 if words[0] in _FLAGS else 3 if words[0] == "--band" else 2
            if words[0] in ("--input-dofs", "--output-dofs"):  # one label a file
                count = 1 + sum(1 for _ in takewhile(re.compile(r"[\w+-]*\d[\w:+-]*\Z").match, words[1:]))
            way += [word.rstrip(",.;:") if len(word) > 1 else word for word in words[:count]]
            words = words[count:]
        if way and way not in ways:
            ways.append(way)
    return ways


def obeyed(path: Path, words: list[str], rate: float | None = None) -> Any:
    """Return what a file gives with options of the command line; a rate that a person fills in is filled in."""
    words = [f"{rate or 1000.0:.9g}" if word == "HZ" else word for word in words]
    return ms.io.survey(path, **reading_options(build_parser().parse_args(["info", str(path), *words]), path))


def message(path: Path) -> str:
    """Return what is said of a file: why it is refused, or the notes on it."""
    try:
        return " ".join(obeyed(path, []).notes)
    except ms.DataError as error:
        return str(error.args[0])


def dead_ends(path: Path, said: str, rate: float | None = None) -> list[str]:
    """Return the options of a message that neither read its file nor lead to one further question whose answer does."""
    return [shlex.join(way) for way in suggestions(said) if not _leads_on(path, way, said, rate, further=1)]


def _leads_on(path: Path, words: list[str], said: str, rate: float | None, further: int) -> bool:
    try:
        obeyed(path, words, rate)
    except ms.DataError as error:
        ways = [way for way in suggestions(error.args[0]) if way[0] not in words] if error.args[0] != said else []
        return further > 0 and any(_leads_on(path, [*words, *way], error.args[0], rate, further - 1) for way in ways)
    except SystemExit:  # the command line does not know it
        return False
    return True


def same(drawn: Drawn, thing: Any) -> str:
    """Return "right", "names or units lost" or "wrong"."""
    truth = drawn.truth
    if isinstance(thing, ms.ImpulseResponse) and truth.content == "decay":
        thing = ms.Signals(
            outputs=thing.values[:, :, 0],
            sampling_rate=thing.sampling_rate,
            output_dofs=thing.output_dofs,
            units=(thing.units[0], ()),
        )
    if isinstance(thing, ms.FrequencyResponse) != truth.of_lines or not isinstance(
        thing, ms.Signals | ms.FrequencyResponse
    ):
        return "wrong"
    if truth.of_lines:
        held = [(thing.values[:, :, k], truth.outputs) for k in range(thing.values.shape[2])]
        good = np.shape(thing.frequencies) == truth.axis.shape and np.allclose(
            thing.frequencies, truth.axis, rtol=1e-6, atol=1e-6
        )
        good = good and len(held) == 1
        if truth.coherence is not None and thing.coherence is not None:
            good = good and np.allclose(thing.coherence[:, :, 0], truth.coherence, atol=1e-4)
    else:
        held = [(thing.outputs, truth.outputs)]
        good = bool(np.isclose(thing.sampling_rate, truth.rate, rtol=2e-4)) and (thing.inputs is None) == (
            truth.inputs is None
        )
        held += [(thing.inputs, truth.inputs)] if truth.inputs is not None and thing.inputs is not None else []
    for a, b in held if good else []:
        good = good and a.shape == b.shape and np.allclose(a, b, rtol=1e-5, atol=1e-6 * np.abs(b).max())
    if not good:
        return "wrong"
    return _named(drawn, thing)


def _bare(text: str) -> str:
    return "".join(letter for letter in text.lower() if letter.isalnum())


def _named(drawn: Drawn, thing: Any) -> str:
    """Compare names and units with those that were written; a unit of another size is wrong."""
    truth = drawn.truth
    units = list(thing.units[0]) + ([] if truth.of_lines or truth.inputs is None else list(thing.units[1]))
    if truth.of_lines:
        units = [f"{a}/{thing.units[1][0]}" if thing.units[1][0] else a for a in thing.units[0]]
    lost = False
    known = {unit: factor for pairs in HALVES[drawn.choices["half"]].units.values() for unit, factor in pairs}
    for written, read in zip(truth.units, units, strict=False):
        one, other = known.get(written), in_si(read) if read else None
        if other is not None and not np.isclose(1.0 if one is None else one, other.factor):
            return "wrong"
        lost = lost or (one is not None and written not in ("", "1/kg") and other is None)
    if not truth.of_lines and drawn.choices["head"] != "none" and drawn.path.suffix not in (".npy", ".npz", ".mat"):
        dofs = [*thing.output_dofs, *(thing.input_dofs if truth.inputs is not None else ())]
        names = [c.name for c in drawn.columns if c.kind == "out"] + [c.name for c in drawn.columns if c.kind == "in"]
        lost = lost or any(
            _bare(name) not in _bare(dof) and _bare(name.split("(")[0]) not in _bare(dof)
            for name, dof in zip(names, dofs, strict=True)
        )
    return "names or units lost" if lost else "right"


def verdict(drawn: Drawn) -> tuple[str, str]:
    """Return the verdict on a file, and the message where there is one."""
    began = time.process_time()
    try:
        survey = obeyed(drawn.path, [])
    except ms.DataError as error:
        return _of_refusal(drawn, error.args[0])
    except Exception as error:  # noqa: BLE001 - whatever it is, a user sees a traceback
        return "crash", f"{type(error).__name__}: {error}"
    if time.process_time() - began > _SECONDS:
        return "crash", "more than 20 s"
    found = same(drawn, survey.thing) if not drawn.refused else "wrong"
    if found != "wrong":
        return found, ""
    notes = " ".join(survey.notes)
    said = any(_works(drawn, way) for way in suggestions(notes))
    what = f"{survey.result} | {notes}"
    return ("wrong and said" if said else "wrong in silence"), what


def _works(drawn: Drawn, words: list[str]) -> bool:
    """Whether obeying reads the file right, at once or after one further question."""
    for _ in range(2):
        try:
            survey = obeyed(drawn.path, words, drawn.truth.rate)
            if same(drawn, survey.thing) != "wrong":
                return True
            further = suggestions(" ".join(survey.notes))
        except ms.DataError as error:
            further = suggestions(error.args[0])
        except (SystemExit, Exception):  # noqa: BLE001 - an option that the command line refuses, or a traceback
            return False
        further = [way for way in further if way[0] not in words]
        if not further:
            return False
        words = [*words, *further[0]]
    return False


def _of_refusal(drawn: Drawn, message: str) -> tuple[str, str]:
    ways = suggestions(message)
    if drawn.choices["content"] == "spectrum":  # refused rightly, in words that say so
        return "right", message
    if drawn.refused and drawn.truth.of_lines:
        return "right", message
    works = any(_works(drawn, way) for way in ways)
    if drawn.refused and works:
        return "right", message
    return ("refused, remedy works" if works else "refused"), message


def tried(folder: Path, seed: int, half: str) -> tuple[Drawn, str, str]:
    """Return the file of a seed, its verdict and the message."""
    drawn = write(folder, seed, draw_choices(np.random.default_rng([seed, 0]), half))
    return (drawn, *verdict(drawn))


def shrunk(folder: Path, seed: int, choices: Choices, bad: str) -> Choices:
    """Return choices of which as many are plain as leave the verdict as it is."""
    for name, plain in PLAIN.items():
        plain = "Hz" if name == "axis" and choices["content"] not in ("hammer", "shaker", "ambient", "decay") else plain
        simpler = {**choices, name: plain}
        if simpler != choices and verdict(write(folder, seed, simpler))[0] == bad:
            choices = simpler
    return choices
