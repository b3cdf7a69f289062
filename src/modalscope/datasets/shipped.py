"""Find, read and describe the measured tests that come with the program."""

from __future__ import annotations

import csv
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from modalscope.data import ModalModel
from modalscope.io import read
from modalscope.numerics.arguments import named
from modalscope.numerics.errors import check_choice

#: Each data set and its file of records or responses.
FILES = MappingProxyType(
    {"beam_hammer": "beam_hammer.uff", "impact_hits": "impact_hits.npz", "palisaden": "palisaden.npz"}
)

#: An installed package holds the folders; a checkout has them in `examples/`.
_PLACES = (Path(__file__).parent / "files", Path(__file__).parents[3] / "examples")


def names() -> tuple[str, ...]:
    """Return the names of the data sets.

    Examples
    --------
    >>> names()
    ('beam_hammer', 'impact_hits', 'palisaden')
    """
    return tuple(FILES)


@named(name=str)
def folder(name: str) -> Path:
    """Return the folder of a data set: its file, its reference values, its licence and a text on its source.

    Parameters
    ----------
    name : str
        One of `names()`.

    Raises
    ------
    DataError
        An unknown name, with the nearest known one.
    """
    check_choice("data set", name, names())
    return next(place for place in _PLACES if place.is_dir()) / name


@named(name=str, download=bool)
def load(name: str, download: bool = False) -> Any:
    """Return a measured test: frequency responses or records, as `read` gives them.

    Parameters
    ----------
    name : str
        One of `names()`.
    download : bool
        Whether a set that is not installed may be fetched. Every set of this version is installed: nothing is fetched.

    Raises
    ------
    DataError
        An unknown name, with the nearest known one.

    Examples
    --------
    >>> load("beam_hammer")
    <frequency responses (acceleration): 9999 lines from 1.0002 to 10001 Hz, 7 outputs, 6 inputs>
    """
    return read(folder(name) / FILES[name])


@named(name=str)
def reference(name: str) -> ModalModel:
    """Return the modes of a data set as its authors published them, or as other programs find them (see `describe`).

    They have frequencies and damping ratios; no shapes were published.

    Parameters
    ----------
    name : str
        One of `names()`.

    Raises
    ------
    DataError
        An unknown name, with the nearest known one.

    Examples
    --------
    >>> reference("beam_hammer").frequencies.round(1)
    array([ 177. ,  477.4,  933.1, 1535.5, 2286.9, 3162.4, 4181.2])
    """
    (path,) = folder(name).glob("*_modes.csv")
    with path.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    frequency, damping = (np.array([float(row[key]) for row in rows]) for key in ("frequency_hz", "damping_ratio"))
    poles = 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))
    return ModalModel(poles=poles, shapes=np.zeros((0, poles.size), complex))


@named(name=str)
def describe(name: str) -> str:
    """Return what a data set is, where it comes from, under which licence, and how well its reference values are known.

    Parameters
    ----------
    name : str
        One of `names()`.

    Raises
    ------
    DataError
        An unknown name, with the nearest known one.
    """
    return (folder(name) / "README.md").read_text(encoding="utf-8")
