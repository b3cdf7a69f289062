"""A misspelt keyword of any verb names the nearest there is."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest

import modalscope as ms

#: Where verbs stand, beside the face.
PLACES = (ms, ms.preprocess, ms.plot)

#: Files have options of their own formats, each with an error of its own.
FORMATS = {"read", "write", "from_frame"}

VERBS = {
    f"{place.__name__}.{name}": getattr(place, name)
    for place in PLACES
    for name in place.__all__
    if inspect.isfunction(getattr(place, name)) and name not in FORMATS
}


def misspelt(verb: Callable[..., Any]) -> tuple[str, str] | None:
    """Return a keyword of a verb and the same without its middle letter."""
    longest = max(
        (p for p in inspect.signature(verb).parameters.values() if p.kind is not p.VAR_KEYWORD),
        key=lambda p: len(p.name),
        default=None,
    )
    if longest is None or len(longest.name) < 4:
        return None
    half = len(longest.name) // 2
    return longest.name, longest.name[:half] + longest.name[half + 1 :]


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_names_the_nearest(name: str) -> None:
    words = misspelt(VERBS[name])
    if words is None:
        pytest.skip("no keyword long enough to be misspelt")
    right, wrong = words
    with pytest.raises(ms.DataError, match=f"did you mean '{right}'"):
        VERBS[name](**{wrong: 1})


def test_options_of_the_table_are_known_to_the_verbs_that_hand_them_on() -> None:
    for verb in (ms.identify, ms.stabilize, ms.sweep, ms.realize, ms.compare):
        with pytest.raises(ms.DataError, match="did you mean 'block_rows'"):
            verb(None, blok_rows=3)
