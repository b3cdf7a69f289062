"""Facts that hold for every text that a user reads: the words of the field, short sentences, no slips of typing."""

from __future__ import annotations

import re

import pytest

from tests.texts import SOURCE, Text, collect

#: Words that are never right in a sentence for a user, and units that are written otherwise.
GROWN = re.compile(
    r"\b(hz|khz|told|tells?|what is left|left of|beside|holds its own|things?|something|skirts|arena|contest|contenders|crew|seen"
    r"|stands? out|nobody|somebody|richer model|(was|were) asked)\b"
)

#: Words of a sentence, at most.
LONGEST = 28


@pytest.fixture(scope="module")
def collected() -> list[Text]:
    """Read all sources, which takes seconds: not while tests are only collected."""
    return collect()


@pytest.mark.parametrize("kind", ["error", "finding", "help", "label", "note"])
def test_every_kind_is_collected(kind: str, collected: list[Text]) -> None:
    assert sum(text.kind == kind for text in collected) > 50


def test_texts_are_read_as_the_program_joins_them() -> None:
    place = SOURCE / "interfaces" / "cli" / "reading.py"
    texts = {text.words for text in collect([place])}
    assert "their form is FIRST:LAST:STEP, FIRST at least 1" in texts
    assert "orders {...}:" in texts


def test_words_are_the_fields(collected: list[Text]) -> None:
    assert [text for text in collected if GROWN.search(text.words)] == []


def test_sentences_are_short(collected: list[Text]) -> None:
    sentences = [(text, part) for text in collected for part in re.split(r"(?<=[.!?:;])\s+", text.words)]
    assert [text for text, part in sentences if len(part.split()) > LONGEST] == []


def test_no_text_has_double_blanks(collected: list[Text]) -> None:
    """The delimiter of universal files is quoted as it is written."""
    assert [text for text in collected if re.search(r"\S  +\S", text.words.replace("'    -1'", "-1"))] == []
