"""Notes: equal by what they say, texts for people, and back from JSON."""

from __future__ import annotations

import copy
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import DataError, ModalModel, Note
from modalscope.data.notes import Candidate, Harmonic, notes_of

RANK = Note("rank", {"rank": 12}, "the data have rank 12")


def test_the_text_of_a_note_is_what_str_gives() -> None:
    assert str(RANK) == f"{RANK}" == "the data have rank 12"
    assert ", ".join(map(str, (RANK, RANK))) == "the data have rank 12, the data have rank 12"


def test_notes_of_the_same_content_are_equal_and_one_key() -> None:
    again = Note("rank", {"rank": np.int64(12)}, "the data have rank 12")  # type: ignore[dict-item]
    assert again == RANK
    assert len({again, RANK, Note("rank", {"rank": 13}, RANK.text)}) == 2
    assert pickle.loads(pickle.dumps(RANK)) == RANK


def test_a_note_does_not_change_with_the_mapping_it_was_made_of() -> None:
    numbers = {"rank": 12.0}
    note = Note("rank", numbers, "")
    numbers["rank"] = 3
    assert note.numbers["rank"] == 12
    with pytest.raises(AttributeError):
        note.text = "other"  # type: ignore[misc]


def test_notes_come_back_from_json() -> None:
    notes = (RANK, Note("gain", {"dB": np.nan, "at": 1.5}, "withheld"))
    text = json.dumps([note.to_dict() for note in notes], allow_nan=False)
    first, second = (Note.from_dict(entry) for entry in json.loads(text))
    assert first == RANK
    assert (second.kind, second.text, second.numbers["at"]) == ("gain", "withheld", 1.5)
    assert np.isnan(second.numbers["dB"])


def test_plain_text_is_a_remark() -> None:
    assert notes_of("one") == notes_of(["one"]) == (Note("remark", {}, "one"),)
    assert notes_of([RANK, "one"]) == (RANK, Note("remark", {}, "one"))
    assert notes_of(()) == ()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Note(1, {}, "x"), "kind of a note"),  # type: ignore[arg-type]
        (lambda: Note("a", {}, None), "text of a note"),  # type: ignore[arg-type]
        (lambda: Note("a", [1.0], "x"), "numbers of a note"),  # type: ignore[arg-type]
        (lambda: Note("a", {"f": "fast"}, "x"), "f of a note needs a finite number, but it is 'fast'"),  # type: ignore[dict-item]
        (lambda: Note.from_dict({"kind": "a"}), "a note needs a text, but it has kind"),
        (lambda: notes_of([3]), "each of the notes"),  # type: ignore[list-item]
    ],
)
def test_what_is_no_note_is_refused(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DataError, match=message):
        make()


def test_modes_keep_their_notes_when_some_are_taken_or_scaled() -> None:
    modes = ModalModel(poles=[-1 + 9j, -1 + 20j], shapes=np.ones((3, 2)), notes=["seen once"])  # type: ignore[arg-type]
    assert modes.notes == (Note("remark", {}, "seen once"),)
    assert modes.take([1]).normalized("max").select(outputs=[0]).notes == modes.notes
    assert modes.noted([RANK, "two"]).notes == (*modes.notes, RANK, Note("remark", {}, "two"))


@pytest.mark.parametrize("row", [Candidate(frequency=7.5, damping_ratio=0.3), Harmonic(frequency=7.5)])
def test_what_is_not_known_is_equal_to_itself(row: Candidate | Harmonic) -> None:
    again = pickle.loads(pickle.dumps(row))
    assert again == row == copy.deepcopy(row)
    assert len({again, row}) == 1
    assert row != replace(row, frequency=7.0)
