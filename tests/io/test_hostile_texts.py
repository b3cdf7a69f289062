"""Texts that no format was made for come back as they were, or are refused by name; none is changed in silence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import modalscope as ms
from modalscope.io import read, write
from tests.io import samples
from tests.support import refused

HOSTILE = {
    "newline": "a\nb",
    "carriage return": "a\rb",
    "nul": "a\0b",
    "nul at the end": "ab\0",
    "escape": "\x1b[2J",
    "line separator": "a\u2028b",
    "next line": "a\x85b",
    "slash": "a/b",
    "spaced slash": "a / b",
    "brackets": "a [b]",
    "open bracket": "a [b",
    "dollar": "$a$",
    "broken formula": r"$\frac{$",
    "quote": 'a"b',
    "open quote": '"a',
    "comma": "a,b",
    "semicolons": "a;b;c;d;e;f;g;h",
    "tab": "a\tb",
    "hash": "# a",
    "prefix out": "out x",
    "prefix in": "in plane",
    "prefix real": "real 1",
    "micro": "µm/s2",
    "greek": "Ωσ",
    "square": "m/s²",
    "emoji": "🙂",
    "surrogate": "\udcff",
    "none": "NONE",
    "spaces inside": "a  b",
    "script": "<script>alert(1)</script>",
    "long": "x" * 300,
    "ten": "x" * 10,
    "eleven": "x" * 11,
    "colons": "a:b:c",
    "scalar": "tip:S",
    "dots": "../a",
    "number": "007",
    "a digit that counts nothing": "²:+Z",
    "nan": "NaN",
}

SUFFIXES = [".uff", ".csv", ".npz", ".mat", ".h5", ".json"]

#: What stands for a sign that universal files lack.
TRANSLITERATED = {"µm/s2": "um/s2", "m/s²": "m/s2", "²:+Z": "2:+Z"}


def with_label(thing: Any, text: str) -> Any:
    return replace(thing, output_dofs=(text, *thing.output_dofs[1:]), geometry=None)


def with_unit(thing: Any, text: str) -> Any:
    return replace(thing, units=((text,) * len(thing.output_dofs), thing.units[1]))


def with_step(thing: Any, text: str) -> Any:
    return replace(thing, processing=(text,))


PLACES = {"label": with_label, "unit": with_unit, "processing": with_step}


def things() -> dict[str, Any]:
    impulse = replace(samples.impulse_response(), feedthrough=None)
    return {
        "lines": replace(samples.frequency_response(), coherence=None),
        "samples": impulse,
        "records": samples.records(),
        "modes": samples.modes(),
    }


FIELDS = {"label": "output_dofs", "unit": "units", "processing": "processing"}


def complaint(path: Path, thing: Any, place: str, text: str) -> str:
    """Return what is wrong with what becomes of a text; nothing where it comes back or is refused by name."""
    path.unlink(missing_ok=True)
    try:
        write(path, thing)
    except ms.DataError as error:
        told = str(error)
        named = text[:10] in told or repr(text)[1:-1][:10] in told
        fine = named and len(told) <= 600 and told.replace("\n", "").isprintable()
        return "" if fine else f"not named in {told!r}"
    again = read(path)
    if path.suffix == ".uff" and (place == "processing" or (place == "unit" and isinstance(thing, ms.ModalModel))):
        return ""  # universal files have no place for it
    given, got = getattr(thing, FIELDS[place]), getattr(again, FIELDS[place])
    if path.suffix == ".uff" and place == "unit":
        given = (tuple(TRANSLITERATED.get(unit, unit) for unit in given[0]), given[1])
    # universal files sort their channels
    return "" if sorted(given) == sorted(got) else f"{given!r} became {got!r}"


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("kind", things())
@pytest.mark.parametrize("place", PLACES)
def test_a_hostile_text_comes_back_or_is_refused_by_name(tmp_path: Path, suffix: str, kind: str, place: str) -> None:
    if (suffix == ".json" and kind != "modes") or (suffix == ".csv" and (kind == "modes" or place == "processing")):
        pytest.skip("JSON holds modes; a table of modes has no inputs, and tables have no history")
    wrong = {}
    for name, text in HOSTILE.items():
        thing = PLACES[place](things()[kind], text)
        told = complaint(tmp_path / f"a{suffix}", thing, place, text)
        if told:
            wrong[name] = told
    assert not wrong


def test_names_of_indicators_are_names_of_arrays(tmp_path: Path) -> None:
    modes = samples.modes()
    for suffix in (".npz", ".h5", ".mat"):
        odd = replace(modes, unrefined=None, indicators={"a/b": modes.indicators["emac"]})
        refused("'a/b'", write, tmp_path / f"a{suffix}", odd)


def test_a_quotation_mark_left_open_takes_no_row_below_it(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text('time_s,out 1:+Z,"out 2:+Z\n0,1,2\n1,1,2\n2,1,2\n')
    assert read(path).outputs.tolist() == [[1, 2], [1, 2], [1, 2]]
    path.write_text('time_s,out 1:+Z,out 2:+Z\n0,1,2\n1,1,"2\n2,1,2\n')
    refused("a number in every cell of column 3", read, path)
    path.write_bytes("time_s,out 1:+Z [µm]\n0,1\n1,1\n".encode("latin-1"))
    refused("not text in UTF-8", read, path)


def test_universal_files_in_utf8_and_in_latin_1_are_both_read(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    record = replace(samples.records(), units=(("um", "um", "um"), ("N", "N")))
    write(path, record)
    plain = path.read_bytes()
    for encoding, blank in (("latin-1", b" "), ("utf-8", b"")):
        path.write_bytes(plain.replace(b" um ", " µm".encode(encoding) + blank))
        assert read(path).units[0] == ("µm", "µm", "µm")
