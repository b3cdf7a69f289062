"""Interpret named arrays of other programs (`t`, `Fs`, `acc`, `force`, `H`, `f`) by name and shape.

A vector of times or frequencies says how many samples or lines there are, and so which axis of the other arrays counts them. What that
does not settle (hits as columns look as channels do) is an error that names the options which say it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from modalscope.data import DataError, Signals
from modalscope.io.columns import Column, Table
from modalscope.io.columns.axis import rises, sampling_of
from modalscope.io.columns.words import role_by_words, split_head
from modalscope.io.contents import Options, unreadable
from modalscope.numerics.checks import Array

_RATES = {
    "fs", "f_s", "fsamp", "fsampling", "samplingrate", "samplerate", "sr", "srate", "rate", "samplingfrequency", "samplefrequency",
}  # fmt: skip
_STEPS = {
    "dt", "ts", "t_s", "deltat", "delta_t", "timestep", "samplingperiod", "sampleperiod", "sampleinterval", "samplinginterval",
}  # fmt: skip
_NAMES = {"names", "labels", "channels", "channelnames", "channel", "name", "label", "dofs", "sensors"}
_UNITS = {"units", "unit"}
_INPUTS = {"u", "force", "forces", "input", "inputs", "in", "hammer", "exc", "excitation", "shaker"}
_ANGULAR = {"w", "om", "omega"}
_COHERENCE = {"coh", "coherence", "gamma2"}
#: So many characters of the names of arrays are told.
_TOLD = 300


@dataclass(frozen=True, kw_only=True, slots=True)
class Meant:
    """What arrays are meant to be: a table, or the arrays of the layout; what was left, and what to say of it."""

    table: Table | None = None
    arrays: Mapping[str, Array] | None = None
    left: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(slots=True)
class _Sorted:
    """Arrays by what they are."""

    where: str
    rate: float | None = None
    rate_name: str = ""
    axis: tuple[str, str, Array] | None = None
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    data: dict[str, Array] = field(default_factory=dict)
    rest: tuple[str, ...] = ()


def meaning_of(where: str, arrays: Mapping[str, Array], options: Options) -> Meant | None:
    """Return what arrays are meant to be; None where names and shapes say nothing.

    `options`: `sampling_rate`, `transpose`.

    Raises `DataError`: hits or channels, samples in rows or in columns, where nothing tells: the message names the options that do.
    """
    found = _sorted(where, arrays)
    if not found.data or (found.axis is None and found.rate is None and options.get("sampling_rate") is None):
        return None
    if found.axis is not None and found.axis[1] == "frequency":
        return _lines(found, found.axis)
    return _samples(found, options)


def _leaf(name: str) -> str:
    return re.sub(r"[\s_-]", "", name.rpartition(".")[2]).lower()


def is_rate(name: str) -> bool:
    """Whether an array of this name holds a sampling rate, or the step between samples.

    Examples
    --------
    >>> is_rate("test.Fs"), is_rate("dt"), is_rate("acc")
    (True, True, False)
    """
    return _leaf(name) in _RATES | _STEPS


def _sorted(where: str, arrays: Mapping[str, Array]) -> _Sorted:
    found = _Sorted(where)
    data, rest = {}, []
    for name, array in arrays.items():
        leaf = _leaf(name)
        numeric = array.dtype.kind in "biufc"
        if numeric and array.size == 1 and leaf in _RATES | _STEPS and array.dtype.kind != "c":
            value = float(array.reshape(-1)[0])
            found.rate = (value if leaf in _RATES else 1 / value) if value > 0 else None
            found.rate_name = name
        elif array.dtype.kind in "US" and leaf in _NAMES | _UNITS:
            texts = tuple(str(text) for text in np.atleast_1d(array).ravel())
            found.names, found.units = (texts, found.units) if leaf in _NAMES else (found.names, texts)
        elif numeric and found.axis is None and 1 < array.size == max(array.shape) and (kind := axis_kind(name, array)):
            found.axis = (name, kind, array.ravel())
        elif numeric and array.size > 1:
            data[name] = array
        else:
            rest.append(name)
    found.data, found.rest = data, tuple(rest)
    return found


def axis_kind(name: str, array: Array) -> str:
    """Return whether a vector is of "time" or "frequency", by its name and by rising; nothing where it is of neither."""
    flat = array.ravel()
    if array.dtype.kind == "c" or not rises(flat):
        return ""
    bare = name.rpartition(".")[2]
    if _leaf(name) in _ANGULAR:
        return "frequency"
    role = role_by_words(Column(number=1, name=split_head(bare)[0], unit=split_head(bare)[1], values=flat)).role
    return role if role in ("time", "frequency") else ""


def _lines(found: _Sorted, axis: tuple[str, str, Array]) -> Meant | None:
    name, _, vector = axis
    held = {key: _first_axis(found.where, key, array, vector.size) for key, array in found.data.items()}
    whole = [key for key, array in held.items() if np.iscomplexobj(array)]
    angular = _leaf(name) in _ANGULAR
    notes = [f"{name} is taken as frequencies in {'rad/s' if angular else 'Hz'}"]
    if len(whole) == 1 and held[whole[0]].ndim <= 3:
        key = whole[0]
        values = held[key].reshape(vector.size, *held[key].shape[1:], *(1,) * (3 - held[key].ndim))
        if values.shape[1] > 1 and values.shape[2] > 1:
            notes.append(f"axes of {key} are read as lines, outputs, inputs (else: --axes values=lines,inputs,outputs)")
        arrays = {"frequencies": vector / (2 * np.pi if angular else 1), "values": values}
        for other, array in held.items():
            if _leaf(other) in _COHERENCE and array.size == values.size:
                arrays["coherence"] = array.reshape(values.shape)
        left = tuple(k for k in held if k != key and not (_leaf(k) in _COHERENCE and "coherence" in arrays))
        return Meant(arrays=arrays, left=(*left, *found.rest), notes=tuple(notes))
    columns = [Column(number=1, name=name, unit="rad/s" if angular else "Hz", values=vector)]
    return Meant(table=_table(found, columns, held, ()), notes=tuple(notes))


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


def _samples(found: _Sorted, options: Options) -> Meant | None:
    count, transpose = _count(found, options), bool(options.get("transpose"))
    held = {name: _first_axis(found.where, name, array, count, transpose) for name, array in found.data.items()}
    forces = [name for name in held if _is_input(name)]
    if any(array.ndim > 3 for array in held.values()):
        return None
    deep = any(array.ndim == 3 for array in held.values())
    if deep or (_may_be_hits(held, forces) and not options.get("columns")):
        return _runs(found, held, forces, options)
    columns = []
    if found.axis is not None:
        columns.append(Column(number=1, name=found.axis[0].rpartition(".")[2], unit="s", values=found.axis[2]))
    return Meant(table=_table(found, columns, held, forces))


def _count(found: _Sorted, options: Options) -> int:
    """Return how many samples there are: as many as times, or the longest axis where that is the first."""
    if found.axis is not None:
        return found.axis[2].size
    shapes = {name: array.squeeze().shape for name, array in found.data.items()}
    single = {shape[0] for shape in shapes.values() if len(shape) == 1}
    if len(single) == 1 and all(min(single) in shape for shape in shapes.values()):
        return int(min(single))  # a vector beside them counts the samples
    longest = int(max(max(shape) for shape in shapes.values()))
    odd = [name for name, shape in shapes.items() if len(shape) > 1 and shape[0] != longest]
    if odd and not options.get("transpose"):
        fault = f"{odd[0]} has the shape {found.data[odd[0]].shape}, which is more channels than samples"
        raise unreadable(found.where, fault, "If samples stand along its last axis, say so: --transpose")
    return longest


def _is_input(name: str) -> bool:
    return (
        _leaf(name) in _INPUTS
        or role_by_words(Column(number=1, name=name.rpartition(".")[2], values=np.zeros(1))).role == "in"
    )


def _may_be_hits(held: Mapping[str, Array], forces: list[str]) -> bool:
    """Whether forces and responses have as many columns each, more than one: they may be hits."""
    widths = {array.shape[1] if array.ndim == 2 else 1 for array in held.values()}
    return bool(forces) and len(forces) < len(held) and len(widths) == 1 and widths != {1}


def _runs(found: _Sorted, held: Mapping[str, Array], forces: list[str], options: Options) -> Meant:
    """Return runs where the shapes settle which axis counts them: forces (N, R) beside responses (N, c, R) or (N, R, c)."""
    outputs = [name for name in held if name not in forces]
    if len(outputs) == 1 and len(forces) == 1 and held[outputs[0]].ndim == 3 and held[forces[0]].ndim <= 2:
        out, into = held[outputs[0]], held[forces[0]]
        runs = into.shape[1] if into.ndim == 2 else 1
        places = [k for k in (1, 2) if out.shape[k] == runs]
        if len(places) == 1 and runs > 1:
            arrays = {
                "outputs": np.moveaxis(out, places[0], 0),
                "inputs": into.T[:, :, None],
                "sampling_rate": np.array(_rate(found, options)),
            }
            return Meant(arrays=arrays, left=found.rest, notes=(f"{runs} hits, as {forces[0]} has",))
    words = [f"--rename {name}={'inputs' if name in forces else 'outputs'}" for name in (*forces, *outputs)]
    axes = {2: "samples,runs", 3: "samples,outputs,runs", 1: "samples"}
    words += [
        f"--axes {'inputs' if name in forces else 'outputs'}={axes[held[name].ndim]}" for name in (*forces, *outputs)
    ]
    left = [name for name in (*found.rest, found.axis[0] if found.axis else "", found.rate_name) if name]
    words += [f"--ignore {name}" for name in left]
    words += [f"--sampling-rate {_rate(found, options):.9g}"]
    shapes = ", ".join(f"{name} {array.shape}" for name, array in held.items())[:_TOLD]
    channels = (
        ""
        if any(array.ndim == 3 for array in held.values())
        else f"; for channels: {_as_channels(found, held, forces)}"
    )
    fault = f"in {shapes} an axis may count channels or hits"
    raise unreadable(f"{found.where} as records", fault, f"For hits: {' '.join(words)}{channels}")


def _as_channels(found: _Sorted, held: Mapping[str, Array], forces: list[str]) -> str:
    """Return how `--columns` says that forces are inputs, one a column."""
    place, ins = 1 + (found.axis is not None), []
    for name, array in held.items():
        width = array[0].size
        ins += [f"in={place}-{place + width - 1}"] if name in forces else []
        place += width
    return f'--columns "{",".join(ins)}"'


def _rate(found: _Sorted, options: Options) -> float:
    if options.get("sampling_rate"):
        return float(options["sampling_rate"])
    if found.rate is None and found.axis is not None:
        return sampling_of(found.axis[2].astype(float)).rate
    return float(found.rate or 1.0)


def _table(found: _Sorted, columns: list[Column], held: Mapping[str, Array], forces: Collection[str]) -> Table:
    """Return the arrays as columns; names and units that are as many as the channels are theirs."""
    channels = []
    for name, array in held.items():
        flat, bare = array.reshape(len(array), -1), name.rpartition(".")[2]
        channels += [(name, f"{bare} {k + 1}" if flat.shape[1] > 1 else bare, flat[:, k]) for k in range(flat.shape[1])]
    named = found.names if len(found.names) == len(channels) else [label for _, label, _ in channels]
    units = found.units if len(found.units) == len(channels) else [""] * len(channels)
    roles = {}
    for (name, _, values), label, unit in zip(channels, named, units, strict=True):
        bare, own = split_head(label)
        if name in forces:
            roles[len(columns) + 1] = "in"
        columns.append(Column(number=len(columns) + 1, name=bare, unit=unit or own, values=values))
    return Table(where=found.where, columns=tuple(columns), rate=found.rate, rate_from=found.rate_name, roles=roles)


# ------------------------------------------------------------------------------------------------------------- members
# Lists of arrays: cells and arrays of structures, as MATLAB saves the runs of a test or its channels one by one.
#
# Readers name the members by their places, `runs{2}` or `test(2).acc`. What they are together:
#
# - vectors of equal length, one a member, are the columns of one array; times that are the same in all are one vector; texts and
# numbers one
#   a member are lists of these;
# - members that are matrices, or structures of several measured arrays, are runs: each is read by itself, as a file of its own would be;
#   what other lists hold for each run goes with it, and what they hold for each channel, as names and units, with all.

#: Bytes that a member takes beside its values.
MEMBER = 300
#: Members that a message names.
_TOLD_OF_MEMBERS = 6

_MEMBER = re.compile(r"(?P<of>[^({]*)(?:\((?P<round>[0-9]{1,9})\)|\{(?P<curly>[0-9]{1,9})\})(?P<rest>.*)\Z")


@dataclass(frozen=True, kw_only=True, slots=True)
class Lists:
    """Named arrays in which lists have become arrays, or runs.

    `arrays`: everything, where no list is of runs. `runs`: the arrays of each run, those that all share among them; empty where there are
    none.
    """

    arrays: Mapping[str, Array] = field(default_factory=dict)
    runs: Sequence[Mapping[str, Array]] = ()


def member_name(of: str, place: int, brackets: str = "{}") -> str:
    """Return the name of a member, counted from 1, as MATLAB writes it.

    Examples
    --------
    >>> member_name("runs", 2), member_name("test", 1, "()")
    ('runs{2}', 'test(1)')
    """
    return f"{of}{brackets[0]}{place}{brackets[1]}"


def meant_by(name: str) -> set[str]:
    """Return the names by which an array of a member may be asked for: its own, its list's, its field's in all members, and its member's.

    Examples
    --------
    >>> sorted(meant_by("test(1).acc")), meant_by("fs")
    (['test', 'test(1)', 'test(1).acc', 'test.acc'], {'fs'})
    """
    found = _MEMBER.match(name)
    if found is None:
        return {name}
    return {name, found["of"], found["of"] + found["rest"], name[: len(name) - len(found["rest"])]}


def lists_of(where: str, arrays: Mapping[str, Array]) -> Lists | None:
    """Return named arrays without lists; None where there are none.

    `arrays`: as readers hand them on, members by their places.

    Raises `DataError`: lists in lists, or runs beside another number of members.

    Examples
    --------
    >>> lists_of("x.mat", {"y{1}": np.arange(3.0), "y{2}": np.ones(3), "fs": np.array(9.0)}).arrays["y"].shape
    (3, 2)
    """
    lists: dict[str, dict[int, dict[str, Array]]] = {}
    shared: dict[str, Array] = {}
    for name, array in arrays.items():
        found = _MEMBER.match(name)
        if found is None:
            shared[name] = array
            continue
        if _MEMBER.match(found["rest"]):
            fault = f"{found['of']} holds lists of lists ({name})"
            raise unreadable(where, fault, f"Save its members as arrays, or leave it out: --ignore {found['of']}")
        place = int(found["round"] or found["curly"])
        lists.setdefault(found["of"], {}).setdefault(place, {})[found["of"] + found["rest"]] = array
    if not lists:
        return None
    for of, members in lists.items():
        _check_whole(where, of, members, arrays)
    runs = _of_runs(lists)
    for of, members in lists.items():
        if of not in runs:
            shared |= _as_columns(where, of, members)
    if not runs:
        return Lists(arrays=shared)
    places = {of: sorted(lists[of]) for of in runs}
    if len({tuple(found) for found in places.values()}) > 1:
        told = "; ".join(f"{of} {', '.join(map(str, found[:6]))}" for of, found in places.items())
        # what is no run by itself goes before what is
        odd = min(runs, key=lambda of: (_are_runs(list(lists[of].values())), len(places[of])))
        fault = f"its lists have members at different places: {told}"
        raise DataError(f"reading the runs of {where} was asked", fault, f"Leave one out: --ignore {odd}")
    first = next(iter(places.values()))
    return Lists(runs=[shared | {k: a for of in runs for k, a in lists[of][p].items()} for p in first])


def _of_runs(lists: Mapping[str, Mapping[int, Mapping[str, Array]]]) -> list[str]:
    """Return the lists that hold something of each run; the others, as the names and units of channels, are of all runs.

    Besides runs themselves these are measured vectors (a force for each run), and numbers without text of as many members.
    """
    runs = [of for of, members in lists.items() if _are_runs(list(members.values()))]
    places = {tuple(sorted(lists[of])) for of in runs}

    def beside(members: Mapping[int, Mapping[str, Array]]) -> bool:
        texts = any(array.dtype.kind == "U" for member in members.values() for array in member.values())
        measured = any(_long(member) for member in members.values())
        return measured or (not texts and tuple(sorted(members)) in places)

    return [of for of, members in lists.items() if of in runs or beside(members)] if runs else []


def _check_whole(where: str, of: str, members: Mapping[int, Mapping[str, Array]], arrays: Mapping[str, Array]) -> None:
    """Raise where a member is empty, or lacks what others have: what is left of it is for the user to say."""
    fields = set().union(*members.values())
    for place, member in sorted(members.items()):
        lacking = sorted(name for name in fields if name not in member or not member[name].size)
        if lacking:
            name = member_name(of, place, "{}" if any(key.startswith(f"{of}{{") for key in arrays) else "()")
            raise unreadable(
                where,
                f"{name} has no {', '.join(lacking[:6])}, which other members have"
                if lacking != [of]
                else f"{name} is empty",
                f"Leave that member out, --ignore '{name}', or what it lacks: --ignore {lacking[0]}",
            )


def _long(member: Mapping[str, Array]) -> list[Array]:
    """Return the measured arrays of a member: numbers, more than one; a vector that rises all along is an axis."""
    held = [array.squeeze() for array in member.values() if array.dtype.kind in "biufc" and array.size > 1]
    return [array for array in held if array.ndim > 1 or np.iscomplexobj(array) or not rises(array)]


def _are_runs(members: Sequence[Mapping[str, Array]]) -> bool:
    """Whether each member holds more than one channel."""
    held = [_long(member) for member in members]
    return any(len(arrays) > 1 or any(array.ndim > 1 for array in arrays) for arrays in held)


def _as_columns(where: str, of: str, members: Mapping[int, Mapping[str, Array]]) -> dict[str, Array]:
    """Return every field of a list as one array."""
    order = sorted(members)
    return {
        name: _together(where, of, name, {place: members[place][name] for place in order}) for name in members[order[0]]
    }


def _together(where: str, of: str, name: str, members: Mapping[int, Array]) -> Array:
    held = [array.ravel() for array in members.values()]
    if any(array.dtype.kind == "U" for array in held):
        return np.array([" ".join(map(str, array)) for array in held])
    sizes = [array.size for array in held]
    usual = max(set(sizes), key=sizes.count)
    odd = [place for place, array in members.items() if array.size != usual]
    if odd:
        curly = name == of
        raise unreadable(
            where,
            f"the members of {name} have {min(sizes)} to {max(sizes)} entries, most of them {usual}",
            "Cut them to one length, or leave out those of another: "
            + " ".join(f"--ignore '{member_name(of, place, '{}' if curly else '()')}'" for place in odd[:6]),
        )
    if all(np.array_equal(array, held[0]) for array in held[1:]) and (usual == 1 or rises(held[0])):
        return held[0]
    _refuse_clocks(where, name, held)
    return np.concatenate(held) if usual == 1 else np.stack(held, axis=1)


def _refuse_clocks(where: str, name: str, held: Sequence[Array]) -> None:
    """Raise where members of their own times, frequencies or rates were to be the columns of one array."""
    asked, without = (
        f"reading the members of lists in {where} as channels was asked",
        f"--ignore {name} --sampling-rate HZ",
    )
    kinds = {axis_kind(name, array) for array in held} if held[0].size > 1 else {""}
    ends = f"{name} begins with {_apart(held, 0)}, and ends with {_apart(held, -1)}"
    if kinds == {"time"}:
        fault = f"their times differ: {ends}"
        raise DataError(asked, fault, f"If the channels were measured at once, leave these out: {without}")
    if kinds == {"frequency"}:
        raise DataError(asked, f"their frequencies differ: {ends}", "Save them at the same frequencies.")
    if held[0].size == 1 and is_rate(name):
        fault = f"their rates differ: {name} is {_apart(held, 0)}"
        raise DataError(asked, fault, f"Resample them to one rate; if the numbers are wrong, leave them out: {without}")


def _apart(held: Sequence[Array], place: int) -> str:
    """Return the entries of members at one place, each once, in words."""
    return ", ".join(dict.fromkeys(f"{array[place]:.6g}" for array in held[:_TOLD_OF_MEMBERS]))


def stacked_runs(where: str, runs: Sequence[object]) -> Signals:
    """Return records of one run each as runs of one record.

    Raises `DataError`: something else than records, or records of other channels, rates or lengths.
    """
    records = [run for run in runs if isinstance(run, Signals)]
    first = records[0] if records else None
    if first is None or len(records) < len(runs):
        asked = f"reading the members of a list in {where} as runs was asked"
        raise DataError(asked, "not all of them are records", "Save responses by themselves: lines, outputs, inputs.")
    lengths = {record.samples for record in records}
    if len(lengths) > 1:
        fault = f"they have {min(lengths)} to {max(lengths)} samples"
        remedy = f"Take of each what all have: --rows 1-{min(lengths)}"
        raise DataError(f"reading the {len(records)} runs of {where} was asked", fault, remedy)
    kept = ("output_dofs", "input_dofs", "units", "sampling_rate", "quantities")
    odd = [name for name in kept if any(getattr(record, name) != getattr(first, name) for record in records)]
    if odd:
        fault = f"they differ in {' and '.join(odd).replace('_', ' ')}"
        remedy = "Save runs of the same channels at the same rate."
        raise DataError(f"reading the {len(records)} runs of {where} was asked", fault, remedy)
    inputs = [record.inputs for record in records if record.inputs is not None]
    return Signals(
        outputs=np.stack([record.outputs for record in records]),
        inputs=np.stack(inputs) if inputs else None,
        **{name: getattr(first, name) for name in kept},
    )
