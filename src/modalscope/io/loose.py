"""Interpret named arrays of other programs (`t`, `Fs`, `acc`, `force`, `H`, `f`) by name and shape.

A vector of times or frequencies says how many samples or lines there are, and so which axis of the other arrays counts them. What that
does not settle (hits as columns look as channels do) is an error that names the options which say it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from modalscope.io.columns import Column, Table
from modalscope.io.columns.axis import rises, sampling_of
from modalscope.io.columns.facts import Statement, stated_by
from modalscope.io.columns.vocabulary import key_meaning, words_of
from modalscope.io.columns.weights import even_step, is_short, role_by_words
from modalscope.io.columns.words import bare_unit, kind_of_unit, split_head
from modalscope.io.contents import Options, chosen, unreadable
from modalscope.numerics.checks import Array

_INPUTS = {"u", "in"}
_LABELS = {"labels", "label", "dofs", "sensors"}
#: Numbers of an array of settings at most, beside measured ones at least twenty times as many.
_MOST_SETTINGS = 8
#: Rows a column of an array that can be nothing but samples of channels: no matrix of shapes or settings has so many.
_MIN_ROWS_OF_CHANNEL = 20
_ANGULAR = {"w", "om", "omega"}
_DIRECTIONS = "XYZ"
#: Axes that analysers write as start, increment and number: `x_values` with `y_values`, as Testlab exports structures.
_INCREMENT = re.compile(r"(?P<of>(?:.*\.)?)x_values\.increment\Z")
#: By how much a coherence may lie above 1.
_ROUNDED = 1e-6
#: Characters of names and shapes of arrays in a message.
_MAX_CHARACTERS = 300


@dataclass(frozen=True, kw_only=True, slots=True)
class Meant:
    """The interpretation of arrays: a table, or the arrays of the layout; the unused ones, and notes."""

    table: Table | None = None
    arrays: Mapping[str, Array] | None = None
    left: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(slots=True)
class _Evidence:
    """Arrays by their role: rate, first frequency and step, axis (name, kind, values), labels, units, measured data, and the rest."""

    where: str
    rate: float | None = None
    rate_name: str = ""
    lines: tuple[float, float] | None = None
    axis: tuple[str, str, Array] | None = None
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    data: dict[str, Array] = field(default_factory=dict)
    rest: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def meaning_of(where: str, arrays: Mapping[str, Array], options: Options, part: bool = False) -> Meant | None:
    """Return the interpretation of arrays; None where names and shapes say nothing.

    `options`: `sampling_rate`, `transpose`, `sheet`. `part`: whether they are a test that was chosen of several.

    Raises `DataError`: hits or channels, samples in rows or in columns, where nothing decides: the message names the options that do.
    """
    if sum(array.ndim == 2 and 2 in array.shape for array in arrays.values()) > 1:
        from modalscope.io.own_axes import table_of_pairs  # analysers save such arrays, few others do

        own = table_of_pairs(where, arrays, options)
        if own is not None:
            return Meant(table=own)
    chosen(where, "tests", {}, [], options) if options.get("sheet") is not None and not part else None
    evidence = _sorted(where, arrays)
    axis, vectors = evidence.axis, {name: array.shape for name, array in arrays.items() if array.size > 1}
    if axis is not None:
        refuse_modes(where, [name for name, shape in vectors.items() if axis[2].size in shape])
    if evidence.data and axis is not None and axis[1] == "frequency":
        return _lines(evidence, axis)
    known = axis is not None or evidence.rate is not None or options.get("sampling_rate") is not None
    if evidence.data and (known or evidence.lines is not None or _is_table(evidence)):
        return _samples(evidence, options)
    refuse_modes(where, vectors)
    return None


def refuse_modes(where: str, names: Iterable[str]) -> None:
    """Raise where one of the names of what a file holds says a damping: it is of modes, and no test."""
    damping = next((name for name in names if {"damping", "zeta"} & set(words_of(name))), None)
    if damping is not None:
        raise unreadable(where, f"it holds modes, by its {damping!r}", "Give a file of responses or records.")


def points_of(array: Array) -> list[tuple[str, Array]] | None:
    """Return the channels of points x samples x directions, in any order, as cameras give them; None where these may be runs.

    The longest axis counts samples; that of two or three entries directions. Points move together, of runs each by itself: the largest
    singular value of the channels holds twice the energy that it would hold of runs.
    """
    if array.ndim != 3 or array.dtype.kind not in "biuf":
        return None
    at = int(np.argmax(array.shape))
    rest = np.moveaxis(array, at, 0)
    if rest.shape[0] < _MIN_ROWS_OF_CHANNEL or 2 * max(rest.shape[1:]) > rest.shape[0] or min(rest.shape[1:]) < 2:
        return None
    rest = rest.swapaxes(1, 2) if rest.shape[1] < rest.shape[2] else rest
    if rest.shape[2] > len(_DIRECTIONS):
        return None
    moved = rest.reshape(len(rest), -1).astype(float)
    if not np.isfinite(moved).all():
        return None
    moved = (moved - moved.mean(axis=0)) / np.maximum(moved.std(axis=0), np.finfo(float).tiny)
    squares = np.linalg.eigvalsh(moved.T @ moved)
    if squares[-1] * rest.shape[1] < 2 * squares.sum():
        return None
    places = [(p, d) for p in range(rest.shape[1]) for d in range(rest.shape[2])]
    return [(f"{p + 1}{_DIRECTIONS[d]}", rest[:, p, d]) for p, d in places]


def _is_table(evidence: _Evidence) -> bool:
    """Whether arrays without times and rate are measured: by names, by many rows, or because the first column rises evenly."""
    matrix = next(iter(evidence.data.values()))
    rows, width = matrix.shape if len(evidence.data) == 1 and matrix.ndim == 2 else (0, 1)
    if rows > _MIN_ROWS_OF_CHANNEL * width or (1 < width < rows and even_step(matrix[:, 0])):
        return True
    return bool(evidence.names) or any(_role(name) in ("in", "out") for name in evidence.data)


def _leaf(name: str) -> str:
    return re.sub(r"[\s_-]", "", name.rpartition(".")[2]).lower()


def is_rate(name: str) -> bool:
    """Whether an array of this name holds a sampling rate, or the step between samples.

    Examples
    --------
    >>> is_rate("test.Fs"), is_rate("dt"), is_rate("acc")
    (True, True, False)
    """
    return key_meaning(name.rpartition(".")[2]) in ("rate", "step")


def _sorted(where: str, arrays: Mapping[str, Array]) -> _Evidence:
    evidence = _Evidence(where)
    data, scalars, rest = {}, {}, []
    axes: list[tuple[str, str, Array]] = []
    for name, array in arrays.items():
        numeric = array.dtype.kind in "biufc"
        meaning = "unit" if "unit" in _leaf(name) else key_meaning(name.rpartition(".")[2])
        if numeric and array.size == 1 and array.dtype.kind != "c":
            scalars[name] = float(array.reshape(-1)[0])
        elif array.dtype.kind in "US" and (meaning in ("unit", "channel") or _leaf(name) in _LABELS):
            texts = tuple(str(text) for text in np.atleast_1d(array).ravel())
            evidence.names, evidence.units = (evidence.names, texts) if meaning == "unit" else (texts, evidence.units)
        elif numeric and 1 < array.size == max(array.shape) and (kind := axis_kind(name, array)):
            axes.append((name, kind, array.ravel()))
        elif numeric and array.size > 1:
            data[name] = array
        else:
            rest.append(name)
    data = _along_one_axis(evidence, axes, data)
    used = _facts(evidence, scalars, max((max(array.shape) for array in data.values()), default=0))
    largest = max((array.size for array in data.values()), default=0)
    small = {name for name, array in data.items() if array.size <= _MOST_SETTINGS and 20 * array.size < largest}
    evidence.data = {name: array for name, array in data.items() if name not in small}
    evidence.rest = (*evidence.rest, *rest, *small, *(name for name in scalars if name not in used))
    return evidence


def _along_one_axis(
    evidence: _Evidence, axes: Sequence[tuple[str, str, Array]], data: dict[str, Array]
) -> dict[str, Array]:
    """Put the axis into the evidence and return the arrays along it; those along others are ignored, and a note says how to take them.

    Responses go before the records beside them, which are the last of those that were averaged; spectra and correlations are neither.
    """

    def along(axis: tuple[str, str, Array]) -> dict[str, Array]:
        return {name: array for name, array in data.items() if axis[2].size in array.shape}

    def weight(axis: tuple[str, str, Array]) -> tuple[bool, bool]:
        held = along(axis)
        return axis[1] == "frequency" and any(map(np.iscomplexobj, held.values())), bool(held)

    best = max(axes, key=weight, default=None)
    evidence.axis = best
    others = [axis for axis in axes if axis is not best and best is not None and axis[2].size != best[2].size]
    if best is None or not others:
        evidence.rest = tuple(name for name, _, _ in axes if best and name != best[0])
        return data
    kept = {name: array for name, array in along(best).items() if _role(name) != "spectrum"}
    evidence.rest = (*(axis[0] for axis in axes if axis is not best), *(name for name in data if name not in kept))
    words = f"{', '.join(axis[0] for axis in others)} and {len(data) - len(kept)} arrays that are not along {best[0]} ignored"
    evidence.notes = (f"{words} (else: --ignore {best[0]})",)
    return kept


def _facts(evidence: _Evidence, scalars: Mapping[str, float], rows: int) -> set[str]:
    """Put into the evidence what scalars state by their names and by what agrees; return their names.

    Of complex values without frequencies 0 to fs/2 are as many as half the samples: N = n/2 + 1 lines at k fs/n.
    """
    statements = {name: Statement(-1, name.rpartition(".")[2], f"{value:.17g}") for name, value in scalars.items()}
    said = stated_by(statements.values(), ".")
    evidence.lines = said.lines
    stating = ("rate", "step", "frequency step", "first", "count")
    used = {name for name, s in statements.items() if key_meaning(s.key) in stating}
    if said.rates:
        evidence.rate = said.rates[0][0]
        evidence.rate_name = next(name for name, s in statements.items() if s is said.rates[0][1])
    elif evidence.axis is None:
        named = [n for n, s in statements.items() if role_by_words(s.key) == "frequency" and scalars[n] > 0]
        evidence.rate, evidence.rate_name = (scalars[named[0]], named[0]) if len(named) == 1 else (None, "")
        evidence.notes = tuple(f"{name} is taken as the sampling rate (else: --sampling-rate HZ)" for name in named[:1])
        used |= set(named[:1])
    counts = [value for value in scalars.values() if int(value) // 2 + 1 == rows]
    if counts and evidence.rate and evidence.lines is None:
        evidence.lines = (0.0, evidence.rate / int(counts[0]))
    return used


def axis_kind(name: str, array: Array) -> str:
    """Return whether a vector is of "time" or "frequency", by its name and by rising; nothing where it is of neither."""
    flat = array.ravel()
    if array.dtype.kind == "c" or not rises(flat):
        return ""
    bare = name.rpartition(".")[2]
    if _leaf(name) in _ANGULAR:
        return "frequency"
    role = role_by_words(*split_head(bare))
    return role if role in ("time", "frequency") else ""


def _lines(evidence: _Evidence, axis: tuple[str, str, Array]) -> Meant | None:
    name, _, vector = axis
    arrays = {key: _first_axis(evidence.where, key, array, vector.size) for key, array in evidence.data.items()}
    complexes = [key for key, array in arrays.items() if np.iscomplexobj(array)]
    angular = _leaf(name) in _ANGULAR
    notes = [f"{name} is taken as frequencies in {'rad/s' if angular else 'Hz'}"]
    if len(complexes) != 1 or arrays[complexes[0]].ndim > 3:
        columns = [Column(number=1, name=name, unit="rad/s" if angular else "Hz", values=vector)]
        return Meant(table=_table(evidence, columns, arrays, ()), notes=(*evidence.notes, *notes))
    key, values = complexes[0], arrays[complexes[0]]
    values = values.reshape(*values.shape, *(1,) * (3 - values.ndim))
    if values.shape[1] > 1 and values.shape[2] > 1:
        notes.append(f"axes of {key} are read as lines, outputs, inputs (else: --axes values=lines,inputs,outputs)")
    response = {"frequencies": vector / (2 * np.pi if angular else 1), "values": values}
    unused = [name for name in arrays if name != key]
    for other in [name for name in unused if _role(name) == "coh" and arrays[name].size == values.size]:
        if arrays[other].min() >= 0 and arrays[other].max() <= 1 + _ROUNDED:
            response["coherence"] = np.minimum(arrays[other], 1).reshape(values.shape)
            unused.remove(other)
        else:
            notes.append(f"{other} ignored: values outside 0..1, no coherence")
    return Meant(arrays=response, left=(*unused, *evidence.rest), notes=(*evidence.notes, *notes))


def _role(name: str) -> str:
    """Return what an array is by the last part of its name."""
    return role_by_words(name.rpartition(".")[2])


def _first_axis(where: str, name: str, array: Array, count: int, transpose: bool = False) -> Array:
    """Return an array with the axis of so many samples first and the others as they stand; axes of length one are dropped."""
    bare = array.squeeze() if array.ndim > 1 else array
    places = [k for k, size in enumerate(bare.shape) if size == count]
    if not places:
        fault = f"{name} has the shape {array.shape}, and none of its axes has the {count} entries of the others"
        raise unreadable(where, fault, f"Leave it out: --ignore {name}")
    if len(places) > 1 and bare.ndim > 1:
        places = places[-1:] if transpose else places[:1]
    return np.moveaxis(bare, places[0], 0)


def _samples(evidence: _Evidence, options: Options) -> Meant | None:
    count, transpose = _count(evidence, options), bool(options.get("transpose"))
    others = [  # settings, results
        name
        for name, array in evidence.data.items()
        if 2 * max(array.shape) < count or (count not in array.shape and _role(name) == "spectrum")
    ]
    measured = {name: array for name, array in evidence.data.items() if name not in others}
    arrays = {name: _first_axis(evidence.where, name, array, count, transpose) for name, array in measured.items()}
    plain = {f"{name} {a.shape}": a.squeeze().shape for name, a in measured.items()}
    turned = [name for name, shape in plain.items() if len(shape) == 2 and shape[0] != count]
    notes = [f"samples stand along the last axis of {', '.join(turned)}"] if turned and not transpose else []
    notes += [f"{', '.join(others[:6])} ignored: no axis has {count} samples"] if others else []
    evidence.notes, evidence.rest = (*evidence.notes, *notes), (*evidence.rest, *others)
    forces = [name for name in arrays if _leaf(name) in _INPUTS or _role(name) == "in"]
    if any(array.ndim > 3 for array in arrays.values()):
        return None
    # as many forces as responses in columns, more than one: they may be hits
    widths = {array.shape[1] if array.ndim == 2 else 1 for array in arrays.values()}
    may_be_hits = 0 < len(forces) < len(arrays) and len(widths) == 1 and widths != {1}
    if any(array.ndim == 3 for array in arrays.values()) or (may_be_hits and not options.get("columns")):
        return _runs(evidence, arrays, forces, options)
    columns = []
    if evidence.axis is not None:
        name, unit = split_head(evidence.axis[0].rpartition(".")[2])
        columns.append(Column(number=1, name=name, unit=unit, values=evidence.axis[2]))
    complexes = any(np.iscomplexobj(array) for array in arrays.values())
    lines = evidence.lines is not None and complexes  # the rate that these follow from is none of a record
    return Meant(table=_table(evidence, columns, arrays, forces), notes=tuple(notes) if lines else evidence.notes)


def _count(evidence: _Evidence, options: Options) -> int:
    """Return how many samples there are: as many as times, or the longest axis of the largest array."""
    if evidence.axis is not None:
        return evidence.axis[2].size
    shapes = {name: array.squeeze().shape for name, array in evidence.data.items()}
    single = {shape[0] for shape in shapes.values() if len(shape) == 1}
    if len(single) == 1 and all(min(single) in shape for shape in shapes.values()):
        return int(min(single))  # the vectors count the samples
    longest = int(max(max(evidence.data.values(), key=lambda array: array.size).shape))
    wide = {name: shape[0] for name, shape in shapes.items() if len(shape) == 2 and shape[1] == longest}
    odd = [name for name, rows in wide.items() if rows < longest < _MIN_ROWS_OF_CHANNEL * rows]
    if odd and not options.get("transpose"):
        fault = f"{odd[0]} has the shape {evidence.data[odd[0]].shape}, which is more channels than samples"
        raise unreadable(evidence.where, fault, "If samples stand along its last axis, say so: --transpose")
    return longest


def _runs(evidence: _Evidence, arrays: Mapping[str, Array], forces: list[str], options: Options) -> Meant:
    """Return runs where shapes or values settle which axis counts them: forces (N, R) with responses (N, c, R) or (N, R, c), or hits."""
    outputs = [name for name in arrays if name not in forces]
    points = points_of(arrays[outputs[0]]) if len(outputs) == 1 and not forces else None
    if points is not None:
        axis = [] if evidence.axis is None else [Column(number=1, name="time", unit="s", values=evidence.axis[2])]
        table = _table(evidence, axis, dict(points), ())
        return Meant(table=table, notes=(*evidence.notes, _as_points(outputs[0], arrays[outputs[0]])))
    if len(outputs) == 1 and len(forces) == 1 and arrays[forces[0]].ndim <= 2:
        out, into = arrays[outputs[0]], arrays[forces[0]]
        runs = into.shape[1] if into.ndim == 2 else 1
        places = [k for k in range(1, out.ndim) if out.shape[k] == runs]
        hits = out.ndim == 3 or all(is_short(hit) for hit in into.T)
        if len(places) == 1 and runs > 1 and hits:
            moved = np.moveaxis(out, places[0], 0)
            record = {"outputs": moved.reshape(*moved.shape[:2], -1), "inputs": into.T[:, :, None]}
            record["sampling_rate"] = np.array(_rate(evidence, options))
            channels = "" if out.ndim == 3 else f" (else: {_as_channels(evidence, arrays, forces)})"
            note = f"{runs} hits, as {forces[0]} has{channels}"
            return Meant(arrays=record, left=evidence.rest, notes=(*evidence.notes, note))
    sides = {name: "inputs" if name in forces else "outputs" for name in (*forces, *outputs)}
    words = [f"--rename {name}={side}" for name, side in sides.items()]
    words += [f"--axes {side}={_stored_axes(evidence.data[name], len(arrays[name]))}" for name, side in sides.items()]
    unused = (*evidence.rest, evidence.axis[0] if evidence.axis else "", evidence.rate_name)
    words += [f"--ignore {name}" for name in unused if name]
    words += [f"--sampling-rate {_rate(evidence, options):.9g}"]
    shapes = ", ".join(f"{name} {evidence.data[name].shape}" for name in arrays)[:_MAX_CHARACTERS]
    deep = any(array.ndim == 3 for array in arrays.values())
    channels = "" if deep else f"; for channels: {_as_channels(evidence, arrays, forces)}"
    fault = f"in {shapes} it is not clear whether an axis counts channels or hits"
    raise unreadable(f"{evidence.where} as records", fault, f"For hits: {' '.join(words)}{channels}")


def _as_points(name: str, array: Array) -> str:
    shape = " x ".join(map(str, array.shape))
    return f"{name} ({shape}) is read as points that move together, in {min(array.shape)} directions each"


def _stored_axes(array: Array, samples: int) -> str:
    """Return the axes of an array of runs in their order: runs first, as this library has them, or last behind the samples."""
    place = next(k for k, size in enumerate(array.shape) if size == samples)
    others = ["runs", "outputs"][: array.ndim - 1]
    others = others[::-1] if place == 0 else others
    return ",".join([*others[:place], "samples", *others[place:]])


def _as_channels(evidence: _Evidence, arrays: Mapping[str, Array], forces: list[str]) -> str:
    """Return how `--columns` says that forces are inputs, one per column."""
    place, ins = 1 + (evidence.axis is not None), []
    for name, array in arrays.items():
        width = array[0].size
        ins += [f"in={place}-{place + width - 1}"] if name in forces else []
        place += width
    return f'--columns "{",".join(ins)}"'


def _rate(evidence: _Evidence, options: Options) -> float:
    if options.get("sampling_rate"):
        return float(options["sampling_rate"])
    if evidence.rate is None and evidence.axis is not None:
        return sampling_of(evidence.axis[2].astype(float)).rate
    return float(evidence.rate or 1.0)


def _table(evidence: _Evidence, columns: list[Column], arrays: Mapping[str, Array], forces: Collection[str]) -> Table:
    """Return the arrays as columns; names and units that are as many as the channels are theirs."""
    channels = []
    for name, array in arrays.items():
        flat, bare = array.reshape(len(array), -1), name.rpartition(".")[2]
        channels += [(name, f"{bare} {k + 1}" if flat.shape[1] > 1 else bare, flat[:, k]) for k in range(flat.shape[1])]
    labels = evidence.names if len(evidence.names) == len(channels) else [label for _, label, _ in channels]
    units = evidence.units if len(evidence.units) == len(channels) else [""] * len(channels)
    roles = {}
    for (name, _, values), label, unit in zip(channels, labels, units, strict=True):
        bare, unit_of_head = split_head(label)
        if name in forces:
            roles[len(columns) + 1] = "in"
        columns.append(Column(number=len(columns) + 1, name=bare, unit=bare_unit(unit) or unit_of_head, values=values))
    rate, source, lines = evidence.rate, evidence.rate_name, evidence.lines
    of = evidence.where
    return Table(where=of, columns=tuple(columns), rate=rate, rate_from=source, lines=lines, roles=roles)


def with_vectors(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Return arrays with the vector x(k) = start + k increment, k < number, in the place of the scalars that give it.

    It is of frequencies where `y_values` are complex or the unit says so, else of times. Equal vectors of several signals are one.
    Arrays without such scalars are returned as they are.

    Examples
    --------
    >>> arrays = {"Signal.x_values.increment": np.array([[0.5]]), "Signal.y_values.values": np.zeros((3, 2))}
    >>> {name: array.tolist() for name, array in with_vectors(arrays).items() if name.endswith("time")}
    {'Signal.x_values.time': [0.0, 0.5, 1.0]}
    """
    joined = dict(arrays)
    vectors: list[Array] = []
    for name in arrays:
        match = _INCREMENT.match(name)
        vector = None if match is None else _vector(match["of"], arrays)
        if match is None or vector is None:
            continue
        scalars = f"{match['of']}x_values."
        joined = {part: array for part, array in joined.items() if not part.startswith(scalars)}
        if not any(np.array_equal(vector, other) for other in vectors):
            joined[scalars + _kind(match["of"], arrays)] = vector
            vectors.append(vector)
    return joined


def _vector(of: str, arrays: Mapping[str, Array]) -> Array | None:
    """Return the axis; None where a scalar is none, or the number of values differs."""
    values, said = _values(of, arrays), {}
    for key in ("increment", "start_value", "number_of_values"):
        scalar = arrays.get(f"{of}x_values.{key}", np.zeros(0))
        if scalar.size == 1 and scalar.dtype.kind in "biuf" and np.isfinite(scalar).all():
            said[key] = float(scalar.reshape(-1)[0])
    if values is None or said.get("increment", 0.0) <= 0:
        return None
    count = int(said.get("number_of_values", max(values.shape)))
    return said.get("start_value", 0.0) + said["increment"] * np.arange(count) if count in values.shape else None


def _values(of: str, arrays: Mapping[str, Array]) -> Array | None:
    """Return the first numeric values that belong to an axis."""
    named = (array for name, array in arrays.items() if name.startswith(f"{of}y_values"))
    return next((array for array in named if array.dtype.kind in "biufc" and array.size > 1), None)


def _kind(of: str, arrays: Mapping[str, Array]) -> str:
    values = _values(of, arrays)
    units = (str(a) for name, a in arrays.items() if name.startswith(f"{of}x_values.quantity") and not a.ndim)
    of_lines = (values is not None and np.iscomplexobj(values)) or any(kind_of_unit(u) == "frequency" for u in units)
    return "frequency" if of_lines else "time"
