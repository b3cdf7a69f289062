"""What a person does makes a new document; nothing else of it changes."""

from __future__ import annotations

import pytest

from modalscope.data.analysis import Analysis, SourceFile
from modalscope.interfaces.app.actions import acted, diagrams_key
from tests.support import refused

PLAIN = Analysis(files=(SourceFile(path="a.uff"),))


def test_taking_what_was_refused_takes_the_refusal_back_and_the_other_way_round() -> None:
    out = acted(PLAIN, "refuse", {"frequency": 12.5})
    assert (out.refused, out.taken) == ((12.5,), ())
    assert acted(out, "take", {"frequency": 12.5}).refused == ()
    taken = acted(PLAIN, "take", {"frequency": 3})
    assert acted(taken, "refuse", {"frequency": 3}).taken == ()
    assert acted(acted(taken, "refuse", {"frequency": 9}), "automatic", {}).taken == ()


def test_choices_outside_of_a_new_band_go() -> None:
    chosen = acted(acted(PLAIN, "take", {"frequency": 3}), "refuse", {"frequency": 12})
    banded = acted(chosen, "set", {"bands": [[1, 10]]})
    assert (banded.taken, banded.refused, banded.bands) == ((3.0,), (), ((1.0, 10.0),))


def test_without_bands_again_all_choices_stay() -> None:
    chosen = acted(acted(PLAIN, "set", {"bands": [[1, 10]]}), "take", {"frequency": 3})
    cleared = acted(acted(chosen, "refuse", {"frequency": 5}), "set", {"bands": []})
    assert (cleared.taken, cleared.refused, cleared.bands) == ((3.0,), (5.0,), ())


def test_only_what_poles_depend_on_makes_them_new() -> None:
    same = [("take", {"frequency": 3}), ("name", {"frequency": 3, "name": "x"}), ("set", {"refine": False})]
    other = [
        ("set", {"bands": [[1, 2]]}),
        ("set", {"method": "era"}),
        ("set", {"orders": [2, 4]}),
        ("geometry", {"files": ["p"]}),
        ("reading", {"columns": "in=2"}),
    ]
    assert {diagrams_key(acted(PLAIN, a, g)) == diagrams_key(PLAIN) for a, g in same} == {True}
    assert {diagrams_key(acted(PLAIN, a, g)) == diagrams_key(PLAIN) for a, g in other} == {False}


def test_how_a_file_is_read_keeps_the_geometry_and_is_taken_back() -> None:
    placed = acted(PLAIN, "geometry", {"files": ["p"]})
    named = acted(placed, "reading", {"columns": "in=2,out=3-7", "rows": "41-", "sampling_rate": 50})
    told = {"geometry": "p", "columns": "in=2,out=3-7", "rows": "41-", "sampling_rate": 50.0}
    assert dict(named.files[0].reading) == told
    assert dict(acted(named, "reading", {}).files[0].reading) == dict(placed.files[0].reading)
    refused("sampling_rate", acted, PLAIN, "reading", {"sampling_rate": -1})


def test_a_mode_has_one_name() -> None:
    once = acted(PLAIN, "name", {"frequency": 100.0, "name": "bending"})
    again = acted(once, "name", {"frequency": 100.1, "name": "torsion"})
    assert list(again.names.values()) == ["torsion"]
    assert not acted(again, "name", {"frequency": 100.05, "name": ""}).names


@pytest.mark.parametrize(
    ("action", "given"),
    [
        ("fly", {}),
        ("set", {"files": []}),
        ("set", {"bands": [[3, 1]]}),
        ("set", {"bands": 3}),
        ("set", {"orders": "x"}),
        ("take", {}),
        ("take", {"frequency": "a"}),
        ("take", {"frequency": -1}),
        ("take", {"frequency": 1, "other": 2}),
        ("name", {"frequency": None, "name": "x"}),
    ],
)
def test_what_cannot_be_done_is_said_in_three_parts(action: str, given: dict[str, object]) -> None:
    refused(r", but |: ", acted, PLAIN, action, given)


def test_remedies_of_errors_are_options_of_reading_and_columns_add_up() -> None:
    document = PLAIN
    once = acted(document, "remedy", {"options": {"ignore": ["3"]}})
    again = acted(once, "remedy", {"options": {"ignore": ["5"], "sampling_rate": 100.0}})
    assert again.files[0].reading == {"ignore": ["3", "5"], "sampling_rate": 100.0}
    refused("the page sets", acted, document, "remedy", {"options": {"geometry": "/etc/passwd"}})
