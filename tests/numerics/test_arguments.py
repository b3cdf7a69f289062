"""Limits that are declared beside a public function: what they let through, what they refuse, and in which words."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from modalscope.data import DataError
from modalscope.numerics.arguments import COUNT, POSITIVE, at_least, between, named, plainly


@named(
    data=(str, bytes),
    count=COUNT,
    seed=at_least(0),
    level=between(0, 1),
    overlap=between(0, 1, low_included=True),
    rate=POSITIVE,
    kind=("held", "dirac"),
)
def verb(
    data: Any = "",
    *,
    count: int = 1,
    seed: int = 0,
    level: float = 0.5,
    overlap: float = 0.5,
    rate: float | None = None,
    kind: str = "held",
) -> dict[str, Any]:
    return {"count": count, "seed": seed, "level": level, "overlap": overlap, "rate": rate, "kind": kind}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("count", 1),
        ("seed", 0),
        ("level", 1e-9),
        ("level", 1 - 1e-9),
        ("overlap", 0),
        ("rate", 1e-9),
        ("rate", None),
        ("kind", "dirac"),
    ],
)
def test_a_value_within_its_limit_arrives(name: str, value: Any) -> None:
    assert verb(**{name: value})[name] == value


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"data": 3}, "verb: expected text or bytes, got int"),
        ({"count": 0}, "count needs a whole number of at least 1, but it is 0"),
        ({"count": None}, "count needs a whole number"),
        ({"seed": -1}, "seed needs a whole number of at least 0"),
        ({"level": 0}, "level needs a number above 0 and below 1, but it is 0"),
        ({"level": 1}, "level needs a number above 0 and below 1, but it is 1"),
        ({"level": "half"}, "level needs a finite number, but it is 'half'"),
        ({"overlap": -1e-9}, "overlap needs a number from 0 and below 1"),
        ({"overlap": 1}, "overlap needs a number from 0 and below 1"),
        ({"rate": 0}, "rate needs a positive number, but it is 0"),
        ({"kind": "hold"}, r"kind='hold': there are only held, dirac.\nDid you mean 'held'"),
        ({"sed": 0}, "has no option 'sed'; did you mean 'seed'"),
    ],
)
def test_a_value_beyond_its_limit_is_refused_by_name(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(DataError, match=message):
        verb(**arguments)


@plainly
def shown(values: Any, take: Iterable[float] = (), bands: Iterable[float] = (1.0,), count: int = 10**30) -> None:
    raise np.linalg.LinAlgError("Singular matrix")


@pytest.mark.parametrize("given", [{}, {"take": ()}, {"bands": ()}, {"count": 10**30}, {"take": (1.0,)}])
def test_an_error_of_ours_is_no_sentence_on_what_a_program_gave_for_nothing(given: dict[str, Any]) -> None:
    """Commands give every default and empty tuples."""
    with pytest.raises(np.linalg.LinAlgError):
        shown(1.0, **given)


def test_the_error_that_a_wrong_value_ended_in_stays_beside_the_sentence() -> None:
    with pytest.raises(DataError, match="take=") as refused:
        shown(1.0, take=[np.inf])
    assert isinstance(refused.value.__cause__, np.linalg.LinAlgError)
