"""Draw the choices of a file, one a dimension, and independently."""

from __future__ import annotations

import numpy as np

from benchmarks.exports.truth import CONTENTS, RECORDS
from benchmarks.exports.words import FAR, NEAR

#: A value a dimension.
Choices = dict[str, str]

HALVES = {"near": NEAR, "far": FAR}
#: What both halves share: signs, and how numbers are written.
SHARED = {
    "container": {"csv": 6, "txt": 5, "asc": 1, "dat": 1, "xlsx": 2, "mat struct": 1, "mat arrays": 2, "mat matrix": 1, "npz": 2, "npy": 1},
    "separator": {"comma": 5, "semicolon": 3, "tab": 4, "blanks": 2, "bar": 1},
    "decimal": {"point": 4, "comma": 1},
    "quotes": {"absent": 5, "names": 1, "all": 1},
    "numbers": {"six digits": 3, "scientific": 2, "fixed": 2},
    "encoding": {"utf-8": 6, "utf-16": 1, "cp1252": 2},
    "line ends": {"unix": 2, "windows": 1},
    "header": {"absent": 4, "colon": 3, "equals": 2, "cells": 2, "comments": 2, "sections": 1},
    "length": {"short": 3, "twenty": 2, "ninety": 1},
    "rate": {"absent": 3, "said": 2},
}  # fmt: skip
#: What is set in a failing file, one dimension after the other, to find which matters.
PLAIN = {
    "container": "csv", "separator": "comma", "decimal": "point", "quotes": "absent", "numbers": "scientific", "encoding": "utf-8",
    "line ends": "unix", "header": "absent", "length": "short", "rate": "absent", "axis": "s", "head": "brackets", "extra": "absent",
    "more": "absent", "oddity": "absent", "other": "absent", "telling": "yes", "coherence": "absent",
    "drive": "absent",
}  # fmt: skip
ARRAYS = ("mat struct", "mat arrays", "mat matrix", "npz", "npy")


def _one(rng: np.random.Generator, weights: dict[str, int]) -> str:
    values = np.array(list(weights.values()), float)
    return str(rng.choice(list(weights), p=values / values.sum()))


def draw_choices(rng: np.random.Generator, half: str) -> Choices:
    """Return a choice a dimension. `half`: "near" or "far"."""
    words = HALVES[half]
    choices = {name: _one(rng, weights) for name, weights in SHARED.items()}
    choices |= {"half": half, "content": _one(rng, CONTENTS)}
    choices["maker"] = str(rng.choice(list(words.makers)))
    axes = (
        words.axes
        if choices["content"] in RECORDS
        else ("Hz", "rad/s", "rpm", "U/min")
        if half == "near"
        else ("kHz", "start and step", "rad/sec", "cpm")
    )
    choices["axis"] = str(rng.choice([*axes * 3, *("s" if choices["content"] in RECORDS else "Hz",) * 6, "absent"]))
    choices["head"] = str(rng.choice(words.heads))
    choices["extra"] = str(rng.choice([*["absent"] * len(words.extras), *words.extras]))
    choices["more"] = str(rng.choice([*["absent"] * 4 * len(words.extras), *words.extras]))
    two = rng.random() < 0.4
    choices["oddity"] = str(rng.choice(words.oddities)) if two or rng.random() < 0.2 else "absent"
    choices["other"] = str(rng.choice(words.oddities)) if two else "absent"
    choices["telling"] = "yes" if rng.random() < 0.9 else "no"
    choices["coherence"] = (
        "yes" if rng.random() < 0.25 and choices["content"] not in (*RECORDS, "spectrum") else "absent"
    )
    shaker = choices["content"] == "shaker"
    choices["drive"] = str(rng.choice(["absent", "beside", "instead"], p=[0.4, 0.4, 0.2])) if shaker else "absent"
    return _consistent(choices)


def _consistent(choices: Choices) -> Choices:
    """Return choices that one file can have together; what cannot be becomes absent."""
    choices = dict(choices)
    for rule in (_of_arrays, _of_texts, _of_axis, _of_second_times):
        choices |= rule(choices)
    if choices["more"] == choices["extra"]:
        choices["more"] = "absent"
    if choices["other"] == choices["oddity"]:
        choices["other"] = "absent"
    return choices


def _without(choices: Choices, drop: set[str]) -> Choices:
    return {name: "absent" for name in ("oddity", "other") if choices[name] in drop}


def _of_arrays(choices: Choices) -> Choices:
    """Return what changes where columns are arrays: no rows, no header."""
    if choices["container"] not in ARRAYS:
        return {}
    changed = dict.fromkeys(("oddity", "other", "quotes", "header", "more", "drive"), "absent") | {"encoding": "utf-8"}
    unlabelled = choices["container"] in ("npy", "mat matrix")
    if unlabelled and choices["axis"] in ("ms", "us", "rate", "step", "index and rate", "stamps", "clock"):
        changed["axis"] = "s"
    return changed | ({"axis": "Hz"} if choices["axis"] == "kHz" else {})


def _of_texts(choices: Choices) -> Choices:
    """Return what changes where signs of a text exclude each other, or a sheet has none."""
    changed: Choices = {}
    if choices["separator"] == "comma" and choices["decimal"] == "comma":
        changed["separator"] = "semicolon"
    if choices["container"] == "xlsx":
        changed |= {"quotes": "absent", "encoding": "utf-8", "separator": "tab"}
        changed |= _without(choices, {"trailing delimiter", "byte order mark", "sep line", "cut line"})
    if choices["encoding"] == "utf-16":
        changed |= _without(choices, {"byte order mark"})
    if choices["separator"] == "blanks":
        changed |= _without(choices, {"trailing delimiter", "unequal", "sep line"})
        changed |= {"quotes": "absent"} if choices["quotes"] == "all" else {}
        # cells that blanks part hold none
        changed |= {"head": "stroke"} if choices["head"] in ("four rows", "quoted", "slash") else {}
    return changed


def _of_second_times(choices: Choices) -> Choices:
    """Return what changes where nothing but a second column of times would be the axis: there is none without a first."""
    if choices["axis"] not in ("absent", "rate", "step", "start and step", "index and rate"):
        return {}
    return {name: "absent" for name in ("extra", "more") if choices[name] == "second time"}


def _of_axis(choices: Choices) -> Choices:
    """Return what changes so that the axis can be known: a unit that stands nowhere is the usual one, or follows from the rate."""
    changed: Choices = {}
    text = choices["container"] not in ARRAYS
    if choices["axis"] in ("rate", "index and rate", "step", "start and step"):
        changed["rate"] = "said"
    if choices["head"] == "none":
        known = ("absent", "index first", "comment")
        changed["drive"] = "absent"
        changed |= {name: "absent" for name in ("extra", "more") if choices[name] not in known}
        changed |= {"axis": "s"} if choices["axis"] == "ms" else {}
    elif choices["axis"] in ("ms", "us") and choices["head"] == "names":
        changed["rate"] = "said"
    turns = choices["axis"] in ("rpm", "U/min", "cpm")
    bare = choices["container"] in (ARRAYS if turns else ("npy", "mat matrix"))  # no array says rpm
    if choices["axis"] in ("rad/s", "rad/sec", "rpm", "U/min", "cpm", "kHz") and (
        choices["head"] in ("none", "names") or bare
    ):
        changed["axis"] = "Hz"
    if "rate" in changed and text and choices["header"] == "absent":
        changed["header"] = "colon"
    return changed
