"""Universal files with the oddities of other programs: taken, or left by name, and not called damaged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import modalscope as ms
import modalscope.io as mio
from tests.io import samples
from tests.support import refused

DELIMITER = b"    -1\n"


def a_set(dataset: int, *lines: str) -> bytes:
    return DELIMITER + f"{dataset:6d}\n".encode() + "".join(f"{line}\n" for line in lines).encode("latin-1") + DELIMITER


def thickness(location: int, analysis: int) -> bytes:
    """Return a set of nodal thickness as finite-element programs write it."""
    numbers = "".join(f"{n:10d}" for n in (1, analysis, 1, 94, 2, 1))
    return a_set(
        2414,
        f"{1:10d}",
        "Nodal thickness",
        f"{location:10d}",
        *["NONE"] * 5,
        numbers,
        *[f"{0:10d}"] * 8,
        f"{1:10d}",
        "  1.0E+00",
    )


ODD: dict[str, Callable[[bytes], bytes]] = {
    "lines before the first set": lambda data: b"** exported by some program\nWorkpiece, milestone 12\n" + data,
    "lines between sets": lambda data: data.replace(DELIMITER * 2, DELIMITER + b"File written 19 May\n" + DELIMITER, 1),
    "a line behind the last set": lambda data: data + b"End of file\n",
    "the sign of an old end of file": lambda data: data + b"\x1a",
    "a word behind a number": lambda data: data.replace(b"   151\n", b"   151  milestone 5\n", 1),
    "a word behind 58": lambda data: data.replace(b"    58\n", b"    58  Frequency response\n", 1),
    "letters that are not ASCII": lambda data: data.replace(b"NONE      ", "Größe µ   ".encode("latin-1"), 3),
    "units in words": lambda data: a_set(164, "     m   kg-s         milestone", "  xx") + data,
    "a header of nothing known": lambda data: a_set(151, "milestone", "\xff\xfe") + data,
    "thickness at nodes": lambda data: thickness(1, 1) + data,
    "thickness on elements": lambda data: thickness(3, 0) + data,
    "a short set of results": lambda data: a_set(2414, f"{1:10d}", "Nodal thickness", f"{1:10d}") + data,
    "results with words for numbers": lambda data: (
        a_set(55, "thickness", *["NONE"] * 4, "         1       abc", "", "") + data
    ),
    "groups and other sets": lambda data: data + a_set(2477, "         1         0", "milestone") + a_set(2467),
}


@pytest.mark.parametrize("name", ODD)
def test_oddities_do_not_hide_the_responses(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.unv"
    mio.write(path, samples.frequency_response(), text=True)
    plain = mio.read(path)
    data = ODD[name](path.read_bytes())
    assert data != path.read_bytes()
    path.write_bytes(data)
    told = mio.survey(path)
    assert (told.thing.values == plain.values).all()
    assert told.thing.output_dofs == plain.output_dofs
    assert all(finding.reason and "damaged" not in finding.reason for finding in told.left)


@pytest.mark.parametrize(
    ("code", "quantity"), [(3, "strain"), (15, "pressure"), (0, "unknown"), (2, "stress"), (1, "an angle")]
)
def test_numerators_of_other_quantities_are_read_without_a_quantity(tmp_path: Path, code: int, quantity: str) -> None:
    path = tmp_path / "a.unv"
    mio.write(
        path, replace(samples.frequency_response(), quantity="acceleration", coherence=None, geometry=None), text=True
    )
    path.write_bytes(path.read_bytes().replace(b"\n        12  ", f"\n{code:10d}  ".encode()))
    told = mio.survey(path)
    assert told.thing.quantity is None
    assert any("the quantity of the responses is not known" in note for note in told.notes)


@pytest.mark.parametrize(("kind", "words"), [(2, "auto spectrum"), (9, "power spectral density"), (12, "spectrum")])
def test_spectra_are_left_by_name(tmp_path: Path, kind: int, words: str) -> None:
    path = tmp_path / "a.unv"
    mio.write(path, replace(samples.frequency_response(), coherence=None, geometry=None), text=True)
    data = path.read_bytes()
    spectra = data.replace(b"\n    4  ", f"\n{kind:5d}  ".encode())
    path.write_bytes(data + spectra)
    told = mio.survey(path)
    assert [(finding.kind, finding.reason) for finding in told.left if "58" in finding.part] == [
        (words, "no method identifies from such a function")
    ] * 6
    path.write_bytes(spectra)
    refused(rf"of its \d+ sets none is one(.|\n)*{words}", mio.read, path)


def test_the_whole_job_names_spectra_that_it_cannot_use(tmp_path: Path) -> None:
    path = tmp_path / "a.unv"
    mio.write(path, replace(samples.frequency_response(), coherence=None), text=True)
    path.write_bytes(path.read_bytes().replace(b"\n    4  ", b"\n    9  "))
    refused("the file gives a geometry: (.|\n)*no method identifies from its power spectral density", ms.analyze, path)


def test_numbers_between_sets_are_damage_still(tmp_path: Path) -> None:
    path = tmp_path / "a.unv"
    mio.write(path, samples.frequency_response(), text=True)
    path.write_bytes(path.read_bytes().replace(DELIMITER * 2, DELIMITER + b"  1.0000E+00  2.0000E+00\n" + DELIMITER, 1))
    refused("where a set should begin", mio.read, path)
