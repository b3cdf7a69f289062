"""Named arrays that hold their own axis, N x 2 (axis, value), as analysers save each function: records, windows, spectra, responses.

Functions of one letter and one axis are a set: `X1, X2`, `H1_2, H1_3`. Two numbers are input and output, one is a channel; units and names
of the channels stand in arrays as long as they are many. Averaged responses go before the records beside them, of which they are the last.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.io.columns import Column, Table
from modalscope.io.columns.vocabulary import key_meaning
from modalscope.io.columns.weights import even_step
from modalscope.io.columns.words import is_unit
from modalscope.io.contents import Options, chosen
from modalscope.numerics.checks import Array, RealArray

_NAME = re.compile(r"(?P<set>.*?[A-Za-z])_?(?P<first>\d+)?(?:[_,x](?P<second>\d+))?\Z")
#: Names of responses without the number of their input.
_RESPONSE = re.compile(r"(?:.*[._])?(?:frf|h|tf|tfe|fr|transfer|response)[^.]*\Z", re.IGNORECASE)
#: Rows of such an array, at least.
_MIN_ROWS = 16


@dataclass(frozen=True, slots=True)
class _Function:
    """One array: its name, the set that it is of, its channels (one, or input and output), axis and values."""

    name: str
    of: str
    channels: tuple[int, ...]
    axis: RealArray
    values: Array


def table_of_pairs(where: str, arrays: Mapping[str, Array], options: Options) -> Table | None:
    """Return the table of the set to read; None where arrays do not hold their own axes.

    `options`: `sheet`, the set that is asked.

    Raises `DataError`: a set that is not there.
    """
    functions = [each for name, array in arrays.items() if (each := _function(name, array)) is not None]
    if len(functions) < 2:
        return None
    sets: dict[str, list[_Function]] = {}
    for each in functions:
        first = sets.setdefault(each.of, [])
        if not first or (first[0].axis.shape == each.axis.shape and np.allclose(first[0].axis, each.axis)):
            first.append(each)
    usual = sorted(sets, key=lambda of: -_rank(of, sets[of][0]))
    of = chosen(where, "sets of arrays", sets, usual[:1], options)
    others = [f"{other} ({', '.join(f.name for f in sets[other][:4])})" for other in sets if other != of]
    named, units = _of_channels(arrays)
    columns = [_axis_of(sets[of])]
    for f in sets[of]:
        label, unit = _label(f.channels, named) or f.name, _unit(f.channels, units)
        columns.append(Column(number=len(columns) + 1, name=label, unit=unit, values=f.values))
    for label, f in _coherences(sets, sets[of]):
        columns.append(Column(number=len(columns) + 1, name=f"Coherence {label}", values=f.values))
    other = next((each for each in usual if each != of), "")
    taken = ", ".join(f.name for f in sets[of][:4])
    note = f"{of} of several sets of arrays ({taken}); not read: {'; '.join(others)}. To take one: --test {other}"
    return Table(where=where, columns=tuple(columns), notes=(note,) if others else ())


def _function(name: str, array: Array) -> _Function | None:
    """Return an array that holds its axis and one row or column of values; None of any other."""
    array = array.T if array.ndim == 2 and array.shape[0] == 2 < array.shape[1] else array
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < _MIN_ROWS or array.dtype.kind not in "fc":
        return None
    axis, values = array[:, 0], array[:, 1]
    axis_too = not np.iscomplexobj(values) and even_step(values)
    if np.any(axis.imag) or axis_too or not even_step(axis.real.astype(float)):
        return None
    match = _NAME.match(name)
    numbers = tuple(int(n) for n in (match["first"], match["second"]) if n is not None) if match else ()
    of = match["set"].rstrip("_.") if match else name
    return _Function(name, of, numbers, axis.real.astype(float), values)


def _rank(of: str, first: _Function) -> int:
    """Return what speaks for a set: complex values between two channels are responses, then come other complex ones, then records."""
    if np.iscomplexobj(first.values):
        return 4 if len(first.channels) == 2 else 3 if _RESPONSE.match(of) else 1
    return 2 if float(np.min(first.values)) < 0 and len(first.channels) < 2 else 0


def _axis_of(functions: Sequence[_Function]) -> Column:
    """Return the axis of a set: of complex values frequencies, of others times."""
    lines = np.iscomplexobj(functions[0].values) or np.min(functions[0].values) >= 0
    name, unit = ("frequency", "Hz") if lines else ("time", "s")
    return Column(number=1, name=name, unit=unit, values=functions[0].axis)


def _of_channels(arrays: Mapping[str, Array]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units of the channels, in their order."""
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    for name, array in arrays.items():
        if array.dtype.kind == "U" and array.size > 1:
            texts = tuple(str(text).strip() for text in array.ravel())
            if key_meaning(name) == "unit" or all(map(is_unit, texts)):
                units = texts
            elif key_meaning(name) == "channel" and len(set(texts)) == len(texts):
                names = texts
    return names, units


def _label(channels: tuple[int, ...], names: Sequence[str]) -> str:
    """Return the name of a channel, or of the output and the input of a response; nothing where it has no number."""
    called = [names[k - 1] if 0 < k <= len(names) else str(k) for k in channels]
    return "/".join(reversed(called))


def _unit(channels: tuple[int, ...], units: Sequence[str]) -> str:
    known = [units[k - 1] for k in reversed(channels) if 0 < k <= len(units)]
    return "/".join(known) if len(known) == len(channels) else ""


def _coherences(sets: Mapping[str, Sequence[_Function]], taken: Sequence[_Function]) -> list[tuple[str, _Function]]:
    """Return the coherences of the responses that are taken, each with their label."""
    if len(taken[0].channels) != 2:
        return []
    within = (f for fs in sets.values() for f in fs if not np.iscomplexobj(f.values) and f.of[:1].lower() in "cg")
    size = len(taken[0].values)
    found = {f.channels: f for f in within if len(f.values) == size and len(set(f.channels)) == 2}
    found = {k: f for k, f in found.items() if f.values.min() >= 0 and f.values.max() <= 1 + 1e-6}
    return [("/".join(map(str, reversed(f.channels))), found[f.channels]) for f in taken if f.channels in found]
