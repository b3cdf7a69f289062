"""Read universal files: data sets to findings, findings to one data object."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from modalscope.data import DataError
from modalscope.io.contents import Contents, Finding, Options, unreadable
from modalscope.io.limits import Room, room
from modalscope.io.uff.function import Function, read_function
from modalscope.io.uff.layout import DAMAGED, Field, number, parse
from modalscope.io.uff.matrix import Sorted, in_si, kind_of, sort_frequency, sort_impulse, sort_records
from modalscope.io.uff.nodes import READERS, Parts, add_block, geometry_of
from modalscope.io.uff.scan import Block, scan
from modalscope.io.uff.shapes import Shape, modes_of, read_shape
from modalscope.numerics.errors import check_choice

_WANTS = ("frequency response", "impulse response", "records", "modes", "geometry")
_SHAPES = (55, 2414)
_UNITS = (Field("code", 10, "i"), Field("description", 20, "a"), Field("temperature", 10, "i"))
_SI = 1


@dataclass(slots=True)
class _Sets:
    """The sets of a file by what they are."""

    room: Room
    words: dict[int, str] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    functions: list[Function] = field(default_factory=list)
    shapes: list[tuple[int, Shape]] = field(default_factory=list)
    geometry: Parts = field(default_factory=Parts)
    of_geometry: list[int] = field(default_factory=list)
    taken: set[int] = field(default_factory=set)
    left: dict[int, str] = field(default_factory=dict)
    si: bool = False
    notes: list[str] = field(default_factory=list)


def read(path: Path, options: Options) -> Contents:
    """Read a universal file (options `want`, `repeated`, `quantity`, `kind`).

    Raises `DataError`: a file that is none, a set that is cut off, miscounted, NaN or in the wrong byte order, a pair measured twice, or
    nothing in it that is read.
    """
    for name, choices in (("want", _WANTS), ("repeated", ("first", "last"))):
        if options.get(name) is not None:
            check_choice(name, options[name], choices)
    data = path.read_bytes()
    sets = _Sets(room=room(path.name, len(data)))
    for block in scan(path.name, data, sets.room):
        sets.names[block.place] = block.name
        _add(sets, path.name, block)
    want = options.get("want") or _best(sets)
    result = _take(sets, path.name, want, dict(options))
    notes = [*sets.notes, *result.notes]
    thing = result.thing
    if want != "geometry":
        labels = (*thing.output_dofs, *thing.input_dofs)
        geometry, more = geometry_of(sets.geometry, dict.fromkeys(labels))
        notes += more
        thing = thing if geometry is None else replace(thing, geometry=geometry)
        if geometry is None:
            sets.left |= dict.fromkeys(sets.of_geometry, "it makes no geometry without nodes")
        sets.taken |= set(sets.of_geometry)
    notes, missing = list(dict.fromkeys(notes)), tuple(result.missing)
    return Contents(thing=thing, found=_findings(sets), missing=missing, notes=tuple(notes))


def _add(sets: _Sets, name: str, block: Block) -> None:
    place = block.place
    if block.note:
        sets.notes.append(block.note)
    if block.dataset == 58:
        function = read_function(name, block)
        sets.functions.append(function)
        sets.words[place] = function.words
    elif block.dataset in READERS:
        sets.words[place] = add_block(sets.geometry, block, name)
        sets.of_geometry.append(place)
    elif block.dataset in _SHAPES:
        shape = read_shape(name, block)
        sets.words[place] = "data at nodes" if isinstance(shape, str) else "mode shape"
        if isinstance(shape, str):
            sets.left[place] = shape
        else:
            sets.shapes.append((place, shape))
    elif block.dataset == 164:
        try:
            sets.words[place] = _units(sets, block, name)
            sets.taken.add(place)
        except DataError as error:
            sets.words[place], sets.left[place] = "units", f"they do not read ({error.found})"
            sets.notes.append("units are unknown; values are as in the file")
    elif block.dataset == 151:
        sets.words[place] = "header"
        sets.taken.add(place)
    else:
        sets.words[place], sets.left[place] = "other data", f"dataset {block.dataset} is not read"


def _units(sets: _Sets, block: Block, name: str) -> str:
    where = f"{block.name} of {name}"
    if len(block.records) < 2:
        raise DataError(f"{where} needs two records", f"it has {len(block.records)}", DAMAGED)
    units = parse(_UNITS, block.records[0], where)
    line = block.records[1].decode("latin-1")
    factors = [number(where, "a unit factor", line[k : k + 25]) for k in (0, 25)]
    sets.si = units["code"] == _SI or factors == [1.0, 1.0]
    if not sets.si:
        factor = f"1 m = {factors[0]:g}, 1 N = {factors[1]:g} of them"
        sets.notes.append(f"units are {units['description'] or 'user-defined'} ({factor}); values are as in the file")
    return f"units {units['description']}".strip()


def _best(sets: _Sets) -> str:
    kinds = set(map(kind_of, sets.functions)) | ({"modes"} if sets.shapes else set())
    kinds |= {"geometry"} if any(sets.geometry.nodes.values()) else set()
    return next((want for want in _WANTS if want in kinds), "frequency response")


def _take(sets: _Sets, name: str, want: str, options: dict[str, Any]) -> Sorted:
    if want == "geometry":
        return _take_geometry(sets, name)
    if want == "modes":
        return _take_modes(sets, name)
    by_kind: dict[str, list[Function]] = {}
    for function in map(in_si, sets.functions) if sets.si else sets.functions:
        by_kind.setdefault(kind_of(function), []).append(function)
    chosen = by_kind.get(want, [])
    if not chosen:
        raise _nothing(sets, name, want)
    coherences = by_kind.get("coherence", []) if want == "frequency response" else []
    if want == "frequency response":
        result = sort_frequency(chosen, coherences, options, sets.room)
    else:
        result = (sort_impulse if want == "impulse response" else sort_records)(chosen, options, sets.room)
    used = {function.place for function in [*chosen, *coherences]}
    for function in sets.functions:
        if function.place not in used:
            kind = kind_of(function)
            reason = f'want="{kind}" takes it' if kind in _WANTS else "no method identifies from such a function"
            sets.left[function.place] = reason if kind != "coherence" else "it belongs to frequency responses"
    sets.left |= result.left
    sets.left |= {place: 'want="modes" takes it' for place, _ in sets.shapes}
    sets.taken |= used - set(result.left)
    return result


def _take_geometry(sets: _Sets, name: str) -> Sorted:
    geometry, notes = geometry_of(sets.geometry)
    if geometry is None:
        raise _nothing(sets, name, "geometry")
    sets.taken |= set(sets.of_geometry)
    _leave_the_rest(sets)
    return Sorted(room=sets.room, thing=geometry, notes=notes)


def _take_modes(sets: _Sets, name: str) -> Sorted:
    """Take the modes of one dataset: 55 and 2414 in one file are the same modes."""
    if all(shape.std_of for _, shape in sets.shapes):
        raise _nothing(sets, name, "modes")
    counts = {dataset: sum(shape.dataset == dataset for _, shape in sets.shapes) for dataset in _SHAPES}
    dataset = max(_SHAPES, key=lambda number: counts[number])
    chosen = [(place, shape) for place, shape in sets.shapes if shape.dataset == dataset]
    reason = f"modes were read from dataset {dataset}"
    sets.left |= {place: reason for place, shape in sets.shapes if shape.dataset != dataset}
    modes, notes = modes_of([shape for _, shape in chosen], sets.room)
    sets.taken |= {place for place, _ in chosen}
    _leave_the_rest(sets)
    return Sorted(room=sets.room, thing=modes, notes=notes)


def _leave_the_rest(sets: _Sets) -> None:
    for function in sets.functions:
        if kind_of(function) not in (*_WANTS, "coherence"):
            sets.left.setdefault(function.place, "no method identifies from such a function")
    for place in sets.names:
        if place not in sets.taken and place not in sets.of_geometry:
            sets.left.setdefault(place, "something else was wanted")


def _nothing(sets: _Sets, name: str, want: str) -> DataError:
    words = ", ".join(f"{sets.names[place]}: {words}" for place, words in list(sets.words.items())[:6])
    fault = f"of its {len(sets.names)} sets none is one ({words}{' ...' if len(sets.words) > 6 else ''})"
    usual = "Export frequency responses, records or modes (datasets 58, 55 or 2414)."
    article = "a " if want not in ("records", "modes") else ""
    remedy = usual if want == _WANTS[0] else "Choose one of the kinds that the file holds."
    return unreadable(f"{article}{want} from {name}", fault, remedy)


def _findings(sets: _Sets) -> tuple[Finding, ...]:
    labels = {function.place: f"{function.output} / {function.input}" for function in sets.functions}
    return tuple(
        Finding(
            part=name,
            what=labels.get(place, sets.words[place]),
            kind=sets.words[place] if place in labels else "",
            taken=place in sets.taken and place not in sets.left,
            reason=sets.left.get(place, ""),
        )
        for place, name in sets.names.items()
    )
