"""What names of files say of places, their sides and directions, and of runs; and nothing where they say nothing."""

from __future__ import annotations

import pytest

from modalscope.io.file_names import said_by_names


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["point_01", "point_02", "point_10"], {"": ("point1", "point2", "point10")}),
        (["P1X", "P1Y", "P2X"], {"": ("P1:+X", "P1:+Y", "P2:+X")}),
        (["deck 3 +Z", "pier 3 +Z"], {"": ("deck3:+Z", "pier3:+Z")}),
        (["X1", "X2"], {"": ("1:+X", "2:+X")}),
        (["1Z_4Z", "2Z_4Z"], {"output": ("1:+Z", "2:+Z")}),
        (["4Z_1Z", "4Z_2Z"], {"input": ("1:+Z", "2:+Z")}),
        (["acc1_in1", "acc1_in2"], {"input": ("in1", "in2")}),
        (["2024-05-01 sensor 7", "2024-05-01 sensor 8"], {"output": ("sensor7", "sensor8")}),
        (["P12_run1", "P12_run2", "P13_run1"], {"": ("P12", "P12", "P13"), "run": ("run1", "run2", "run1")}),
        (["P1_1", "P1_2", "P2_1"], {"": ("P1", "P1", "P2")}),
        (["grid1 p2", "grid2 p2"], {}),
        (["grid1 p2", "grid2 p3"], {"": ("grid1.p2", "grid2.p3")}),
        (["1-X", "1-Y", "1-Z"], {"": ("1:+X", "1:+Y", "1:+Z")}),
        (["P1-X", "P2-Z"], {"": ("P1:+X", "P2:+Z")}),
        (["sensor-3-Z", "sensor-4-Z"], {"output": ("sensor3:+Z", "sensor4:+Z")}),
        (["P1Z", "P2-Z"], {"": ("P1:+Z", "P2:-Z")}),
        (["P1+X", "P1-Y"], {"": ("P1:+X", "P1:-Y")}),
        (["1:-Z", "2:-X"], {"": ("1:-Z", "2:-X")}),
        (["1 -Z", "2 -X"], {"": ("1:-Z", "2:-X")}),
        (["1(-Z)", "2(-X)"], {"": ("1:-Z", "2:-X")}),
        (["1-Z_4Z", "2-Z_4Z"], {"output": ("1:-Z", "2:-Z")}),
        (["P1-Z", "P2-Z"], {"": ("P1:-Z", "P2:-Z"), "unsigned": ("P1:+Z", "P2:+Z")}),
        (["hit_1", "hit_2"], {"run": ("hit1", "hit2")}),
        (["run1 north", "run2 south"], {"run": ("run1 north", "run2 south")}),
    ],
)
def test_numbers_in_which_names_differ_are_places_or_runs(names: list[str], said: dict[str, tuple[str, ...]]) -> None:
    assert said_by_names(names) == said


@pytest.mark.parametrize(
    "names",
    [
        ["plate_9_1", "plate_9_2"],
        ["beam 1", "beam 2"],
        ["impact 1", "impact 2"],
        ["a", "b"],
        ["deck_P1", "pier_P1"],
        ["deck 3", "pier 3"],
        ["P1", "P1 late"],
        [""],
        ["P1"],
    ],
)
def test_names_that_say_no_place_and_no_run_say_nothing(names: list[str]) -> None:
    assert said_by_names(names) == {}
