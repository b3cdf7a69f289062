"""Tell from the names of a test's files what each was taken at: a place with its direction and side, or a run."""

from __future__ import annotations

import re
from collections.abc import Sequence

from modalscope.data.geometry import label_of
from modalscope.io.columns.vocabulary import COUNTED, RUNS, SENSORS, folded, meanings_of, parted

#: A number, the word before it, and the direction behind it; a letter alone before it may be the direction.
_FIELD = re.compile(
    r"(?P<word>[^\W\d_]*)[\s_.#(-]*(?P<number>\d+)(?:[\s_:]?(?P<direction>[+-]?R?[XYZxyz][+-]?)(?![^\W_]))?"
)


def said_by_names(names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return labels, one per file, that the numbers in which names differ give: of places by side, and of runs.

    The keys are "input", "output", "" for a place of either side, and "run"; "unsigned" has the places if hyphens before directions, taken
    as signs, part them from their numbers. Of two numbers with directions the first is the response.

    Examples
    --------
    >>> said_by_names(["P1_run1", "P1_run2", "P2_run1"]), said_by_names(["deck 3 +Z", "deck 4 x"])
    ({'': ('P1', 'P1', 'P2'), 'run': ('run1', 'run2', 'run1')}, {'': ('deck3:+Z', 'deck4:+X')})
    >>> said_by_names(["1Z_5Z", "2Z_5Z"]), said_by_names(["hit1", "hit2"]), said_by_names(["a1", "a2"])
    ({'output': ('1:+Z', '2:+Z')}, {'run': ('hit1', 'hit2')}, {})
    """
    names, doubtful = parted(names)
    if len({_FIELD.sub("0", name) for name in names}) != 1:  # they differ in more than numbers
        return {"run": tuple(names)} if any(RUNS.search(name) for name in names) else {}
    columns = list(zip(*(map(_parted, _FIELD.finditer(name)) for name in names), strict=True))
    directed = [all(direction for _, _, direction in column) for column in columns]
    found: dict[str, list[tuple[str, ...]]] = {}
    within: list[tuple[str, ...]] = []
    for k, column in enumerate(columns):
        words = {word for word, _, _ in column}
        kind = _kind_of(folded(column[0][0])) if len(words) == 1 else None
        if directed[k]:
            kind = kind or ("" if sum(directed) != 2 else "input" if any(directed[:k]) else "output")
        if len(set(column)) == 1:
            continue
        labels = tuple(label_of(":".join(filter(None, (w + number, way)))) for w, number, way in column)
        if kind is not None:
            found.setdefault(kind, []).append(labels)
        elif any(words):  # a part of the place; a number without a word counts repeats
            within.append(labels)
    said = {kind: tuple(map(".".join, zip(*within, *each, strict=True))) for kind, each in found.items()}
    places = next((labels for kind, labels in said.items() if kind != "run"), ())
    unsigned = tuple(label.replace(":-", ":+") for label in places)
    return said | ({"unsigned": unsigned} if doubtful and unsigned != places else {})


def _parted(field: re.Match[str]) -> tuple[str, str, str]:
    """Return the word, the number without zeros ahead, and the direction of a field; one before the number goes behind it."""
    word, number, direction = field["word"], field["number"].lstrip("0") or "0", field["direction"] or ""
    word, direction = ("", word) if not direction and word in tuple("XYZxyz") else (word, direction)
    return word, number, direction.upper()


def _kind_of(word: str) -> str | None:
    """Return what a word counts: places of the side "input", "output" or "" for either, or runs ("run"); None of any other."""
    known = next((kind for kind, words in COUNTED.items() if word in words.split()), None)
    sensed = word in SENSORS or any(meaning == "sensor" for meaning, _ in meanings_of(word))
    return known if known is not None else "output" if sensed else "run" if RUNS.fullmatch(word) else None
