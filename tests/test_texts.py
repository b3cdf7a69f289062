"""Facts that hold for every text that a user reads: the words of the field, short sentences, no slips of typing."""

from __future__ import annotations

import re
from collections import Counter

import pytest

from tests.texts import SOURCE, collect

TEXTS = collect()

#: Words that are never right in a sentence for a user, and units that are written otherwise.
GROWN = re.compile(
    r"\b(hz|khz|told|tells?|what is left|left of|beside|holds its own|things?|something|skirts|arena|contest|contenders|crew|seen"
    r"|stands? out|nobody|somebody|richer model)\b"
)

#: Words of a sentence, at most.
LONGEST = 28

#: Texts whose words are still to be changed, by module: this list only shrinks.
STILL = Counter(
    {
        "blocks/combinations.py": 1,
        "blocks/fraction.py": 1,
        "blocks/records.py": 1,
        "blocks/structure.py": 1,
        "checking/certificate.py": 1,
        "checking/validation.py": 1,
        "data/modes.py": 1,
        "data/record_residual.py": 1,
        "identification/refine.py": 1,
        "io/columns/build.py": 1,
        "io/columns/lines.py": 2,
        "io/columns/records.py": 2,
        "modal/rebuilt.py": 1,
        "realizations/sensors.py": 1,
        "systems/modal.py": 1,
    }
)


@pytest.mark.parametrize("kind", ["error", "finding", "help", "label", "note"])
def test_every_kind_is_collected(kind: str) -> None:
    assert sum(text.kind == kind for text in TEXTS) > 50


def test_texts_are_read_as_the_program_joins_them() -> None:
    place = SOURCE / "cli" / "reading.py"
    texts = {text.words for text in collect([place])}
    assert "their form is FIRST:LAST:STEP, FIRST at least 1" in texts
    assert "orders {...} were asked" in texts


def test_words_are_the_fields() -> None:
    wrong = [text for text in TEXTS if GROWN.search(text.words)]
    more = Counter(text.place for text in wrong) - STILL
    assert [text for text in wrong if text.place in more] == []


def test_sentences_are_short() -> None:
    sentences = [(text, part) for text in TEXTS for part in re.split(r"(?<=[.!?:;])\s+", text.words)]
    assert [text for text, part in sentences if len(part.split()) > LONGEST] == []


def test_no_text_has_double_blanks() -> None:
    """The delimiter of universal files is quoted as it is written."""
    assert [text for text in TEXTS if re.search(r"\S  +\S", text.words.replace("'    -1'", "-1"))] == []
