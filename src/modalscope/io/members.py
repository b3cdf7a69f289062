"""Join lists of arrays: cells and arrays of structures, as MATLAB saves the runs of a test or its channels one by one.

Readers name the members by their places, `runs{2}` or `test(2).acc`:

- vectors of equal length, one a member, are the columns of one array; times that are the same in all are one vector; texts and single
  numbers, one a member, are lists;
- members that are matrices, or structures of several measured arrays, are runs: each is read by itself, as a file of its own would be;
  what other lists hold for each run goes with it, and what they hold for each channel, as names and units, with all.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from modalscope.data import Signals
from modalscope.io.columns.axis import rises
from modalscope.io.columns.vocabulary import RUNS
from modalscope.io.contents import unreadable
from modalscope.io.loose import axis_kind, is_rate
from modalscope.numerics.checks import Array

#: Bytes of a member without its values.
BYTES_OF_MEMBER = 300
#: Members listed in a message.
_MAX_LISTED = 6
#: What experiments are called.
_EXPERIMENT = re.compile(rf"(?P<label>{RUNS.pattern}_?\d+)(?!\d)", re.IGNORECASE)
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


def names_selecting(name: str) -> set[str]:
    """Return the names that select an array of a member: its own, its list's, its field's in all members, and its member's.

    Examples
    --------
    >>> sorted(names_selecting("test(1).acc")), names_selecting("fs")
    (['test', 'test(1)', 'test(1).acc', 'test.acc'], {'fs'})
    """
    match = _MEMBER.match(name)
    if match is None:
        return {name}
    return {name, match["of"], match["of"] + match["rest"], name[: len(name) - len(match["rest"])]}


def lists_of(where: str, arrays: Mapping[str, Array]) -> Lists | None:
    """Return named arrays without lists; None where there are none.

    `arrays`: as readers hand them on, members by their places.

    Raises `DataError`: lists in lists, or runs with another number of members.

    Examples
    --------
    >>> lists_of("x.mat", {"y{1}": np.arange(3.0), "y{2}": np.ones(3), "fs": np.array(9.0)}).arrays["y"].shape
    (3, 2)
    """
    lists: dict[str, dict[int, dict[str, Array]]] = {}
    shared: dict[str, Array] = {}
    for name, array in arrays.items():
        match = _MEMBER.match(name)
        if match is None:
            shared[name] = array
            continue
        if _MEMBER.match(match["rest"]):
            fault = f"{match['of']} holds lists of lists ({name})"
            raise unreadable(where, fault, f"Save its members as arrays, or leave it out: --ignore {match['of']}")
        place = int(match["round"] or match["curly"])
        lists.setdefault(match["of"], {}).setdefault(place, {})[match["of"] + match["rest"]] = array
    if not lists:
        return None
    for of, members in lists.items():
        _check_whole(where, of, members, arrays)
    runs = _of_runs(lists)
    for of, members in lists.items():
        if of not in runs:
            order = sorted(members)
            for name in members[order[0]]:
                shared[name] = _as_column(where, of, name, {place: members[place][name] for place in order})
    if not runs:
        return Lists(arrays=shared)
    places = {of: sorted(lists[of]) for of in runs}
    if len({tuple(numbers) for numbers in places.values()}) > 1:
        listed = "; ".join(f"{of} {', '.join(map(str, numbers[:6]))}" for of, numbers in places.items())
        # what is no run by itself goes before what is
        odd = min(runs, key=lambda of: (_are_runs(list(lists[of].values())), len(places[of])))
        fault = f"the runs of one list are not those of another: {listed}"
        raise unreadable(f"the runs of {where}", fault, f"Leave one out: --ignore {odd}")
    first = next(iter(places.values()))
    return Lists(runs=[shared | {k: a for of in runs for k, a in lists[of][p].items()} for p in first])


def _of_runs(lists: Mapping[str, Mapping[int, Mapping[str, Array]]]) -> list[str]:
    """Return the lists that hold something of each run; the others, as the names and units of channels, are of all runs.

    Besides runs themselves these are measured vectors (a force for each run), and numbers without text of as many members.
    """
    runs = [of for of, members in lists.items() if _are_runs(list(members.values()))]
    places = {tuple(sorted(lists[of])) for of in runs}

    def of_each_run(members: Mapping[int, Mapping[str, Array]]) -> bool:
        texts = any(array.dtype.kind == "U" for member in members.values() for array in member.values())
        measured = any(_measured(member) for member in members.values())
        return measured or (not texts and tuple(sorted(members)) in places)

    return [of for of, members in lists.items() if of in runs or of_each_run(members)] if runs else []


def _check_whole(where: str, of: str, members: Mapping[int, Mapping[str, Array]], arrays: Mapping[str, Array]) -> None:
    """Raise where a member is empty, or lacks what others have: the user decides what to leave out."""
    fields = set().union(*members.values())
    for place, member in sorted(members.items()):
        lacking = sorted(name for name in fields if name not in member or not member[name].size)
        if lacking:
            name = member_name(of, place, "{}" if any(key.startswith(f"{of}{{") for key in arrays) else "()")
            fault = "is empty" if lacking == [of] else f"has no {', '.join(lacking[:6])}, which other members have"
            remedy = f"Leave out this member (--ignore '{name}'), or the field that it lacks (--ignore {lacking[0]})"
            raise unreadable(where, f"{name} {fault}", remedy)


def _measured(member: Mapping[str, Array]) -> list[Array]:
    """Return the measured arrays of a member: numbers, more than one; a vector that rises all along is an axis."""
    vectors = [array.squeeze() for array in member.values() if array.dtype.kind in "biufc" and array.size > 1]
    return [array for array in vectors if array.ndim > 1 or np.iscomplexobj(array) or not rises(array)]


def _are_runs(members: Sequence[Mapping[str, Array]]) -> bool:
    """Whether each member holds more than one channel."""
    vectors = [_measured(member) for member in members]
    return any(len(arrays) > 1 or any(array.ndim > 1 for array in arrays) for arrays in vectors)


def _as_column(where: str, of: str, name: str, members: Mapping[int, Array]) -> Array:
    """Return a field of all members as one array."""
    vectors = [array.ravel() for array in members.values()]
    if any(array.dtype.kind == "U" for array in vectors):
        return np.array([" ".join(map(str, array)) for array in vectors])
    sizes = [array.size for array in vectors]
    usual = max(set(sizes), key=sizes.count)
    odd = [place for place, array in members.items() if array.size != usual]
    if odd:
        brackets = "{}" if name == of else "()"
        fault = f"the members of {name} have {min(sizes)} to {max(sizes)} entries, most of them {usual}"
        ignored = " ".join(f"--ignore '{member_name(of, place, brackets)}'" for place in odd[:6])
        raise unreadable(where, fault, f"Cut them to one length, or leave out those of another: {ignored}")
    if all(np.array_equal(array, vectors[0]) for array in vectors[1:]) and (usual == 1 or rises(vectors[0])):
        return vectors[0]
    _refuse_clocks(where, name, vectors)
    return np.concatenate(vectors) if usual == 1 else np.stack(vectors, axis=1)


def _refuse_clocks(where: str, name: str, vectors: Sequence[Array]) -> None:
    """Raise where members of their own times, frequencies or rates were to be the columns of one array."""
    asked, without = f"the members of lists in {where} as channels", f"--ignore {name} --sampling-rate HZ"
    kinds = {axis_kind(name, array) for array in vectors} if vectors[0].size > 1 else {""}
    ends = f"{name} begins with {_apart(vectors, 0)}, and ends with {_apart(vectors, -1)}"
    if kinds == {"time"}:
        fault = f"their times differ: {ends}"
        raise unreadable(asked, fault, f"If the channels were measured at once, leave these out: {without}")
    if kinds == {"frequency"}:
        raise unreadable(asked, f"their frequencies differ: {ends}", "Save them at the same frequencies.")
    if vectors[0].size == 1 and is_rate(name):
        fault = f"their rates differ: {name} is {_apart(vectors, 0)}"
        remedy = f"Resample them to one rate; if the numbers are wrong, leave them out: {without}"
        raise unreadable(asked, fault, remedy)


def _apart(vectors: Sequence[Array], place: int) -> str:
    """Return the entries of members at one place, each once, in words."""
    return ", ".join(dict.fromkeys(f"{array[place]:.6g}" for array in vectors[:_MAX_LISTED]))


def experiments_of(arrays: Mapping[str, Array], of_matrix: int = 1) -> dict[str, set[str]]:
    """Return the experiments of a file, each with the names of its arrays; none where there are not several.

    An experiment is a structure that holds the same arrays as another, more than one of them measured or of another length; or what is
    called `run2` beside `run1`. `of_matrix`: how many arrays one of several channels counts for: with 2 it may be a sensor of three axes.

    Examples
    --------
    >>> channels = {f"run{k}.{name}": np.sin(np.arange(9.0)) for k in (1, 2) for name in ("acc", "force")}
    >>> sorted(experiments_of(channels))
    ['run1', 'run2']
    """
    by_structure: dict[str, set[str]] = {}
    by_word: dict[str, set[str]] = {}
    for name in arrays:
        structure, point, _ = name.partition(".")
        match = _EXPERIMENT.search(name)
        by_structure.setdefault(structure if point else "", set()).add(name)
        by_word.setdefault(match["label"] if match else "", set()).add(name)
    for groups, least in ((by_structure, 2), (by_word, 1)):
        found = {label: names for label, names in groups.items() if label}
        numbers = {label: [name for name in names if arrays[name].dtype.kind != "U"] for label, names in found.items()}
        inside = [frozenset(name.replace(label, "", 1) for name in names) for label, names in numbers.items()]
        measured = [_measured({name: arrays[name] for name in names}) for names in found.values()]
        rows = {max((max(a.shape) for a in vectors), default=0) for vectors in measured}
        counts = [sum(of_matrix if a.ndim > 1 else 1 for a in vectors) for vectors in measured]
        if len(found) > 1 and len(set(inside)) == 1 and min(counts) >= (1 if len(rows) > 1 else least):
            return found
    return {}


def stacked_runs(where: str, runs: Sequence[object]) -> Signals:
    """Return records of one run each as runs of one record.

    Raises `DataError`: something else than records, or records of other channels, rates or lengths.
    """
    records = [run for run in runs if isinstance(run, Signals)]
    first = records[0] if records else None
    if first is None or len(records) < len(runs):
        remedy = "Save responses by themselves: lines, outputs, inputs."
        raise unreadable(f"the members of a list in {where} as runs", "not all of them are records", remedy)
    lengths = {record.samples for record in records}
    if len(lengths) > 1:
        fault = f"they have {min(lengths)} to {max(lengths)} samples"
        remedy = f"Take of each what all have: --rows 1-{min(lengths)}"
        raise unreadable(f"the {len(records)} runs of {where}", fault, remedy)
    shared = ("output_dofs", "input_dofs", "units", "sampling_rate", "quantities")
    odd = [name for name in shared if any(getattr(record, name) != getattr(first, name) for record in records)]
    if odd:
        fault = f"they differ in {' and '.join(odd).replace('_', ' ')}"
        remedy = "Save runs of the same channels at the same rate."
        raise unreadable(f"the {len(records)} runs of {where}", fault, remedy)
    inputs = [record.inputs for record in records if record.inputs is not None]
    return Signals(
        outputs=np.stack([record.outputs for record in records]),
        inputs=np.stack(inputs) if inputs else None,
        **{name: getattr(first, name) for name in shared},
    )
