"""Open the data of an analysis, given as paths or objects, and hash them so that later changes are detected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial, singledispatch
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from modalscope.data import FrequencyResponse, Geometry, ModalModel, Note, Records, Signals, StoredSignals
from modalscope.data.analysis import SourceFile
from modalscope.data.setups import as_test, setups_of
from modalscope.data.units import si_form
from modalscope.io import survey
from modalscope.io.arrays import to_arrays
from modalscope.io.beside import check_links
from modalscope.io.contents import is_frame
from modalscope.numerics.checks import check_each, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.progress import stage
from modalscope.signals.doctor.places import against_labels, label_by_place, labels_option, with_hits
from modalscope.signals.doctor.responses import without_offset
from modalscope.signals.preprocess.decays import as_free_decay
from modalscope.signals.preprocess.excitation import as_inputs, moved_by_base, without_dead_forces
from modalscope.signals.preprocess.merging import merge

#: Options of reading of each file, and of all files or of each.
Each = Sequence[Mapping[str, Any]]
Reading = Mapping[str, Any] | Each

#: Labels of places and runs that names of files say, one per file (see `said_by_names`).
Said = Mapping[str, Sequence[str]]

#: Bytes of a file that are hashed at a time.
_CHUNK_BYTES = 1 << 20


def opened(
    data: Any, reading: Reading, *, decays: bool = False, exclude: Sequence[Any] = ()
) -> tuple[Any, tuple[SourceFile, ...], tuple[Note, ...]]:
    """Return the data in SI, their sources and the notes of reading; several files are merged (see `merge`).

    `reading`: options of `read`, of all files or of each. `decays`: whether records that are free decays become that, `exclude`: without
    which channels that is asked.

    Raises `DataError`: a file of modes, options for data that are no file.
    """
    several = isinstance(data, list | tuple) and are_paths(data)
    each = _of_each(reading, len(data) if several else 1)
    if several:
        return merged_parts(data, each, opened_parts(data, each), decays=decays, exclude=exclude)
    single, source, notes = _opened(data, each[0])
    single, units = si_form(single)
    single, kind = _as_what_it_is(single, decays, exclude)
    return single, (source,), (*notes, *units, *kind)


#: What a file holds, its source, and notes.
Opened: TypeAlias = tuple[Any, SourceFile, tuple[Note, ...]]


def opened_parts(data: Sequence[Any], each: Sequence[Mapping[str, Any]]) -> list[Opened]:
    """Return what each of several files of a test holds, read by the evidence of all of them."""
    from modalscope.signals.doctor.together import read_alike  # most tests are one file

    return read_alike(partial(_opened_as, data, each), len(data))


def merged_parts(
    data: Sequence[Any], each: Each, parts: Sequence[Opened], *, decays: bool, exclude: Sequence[Any] = ()
) -> tuple[Any, tuple[SourceFile, ...], tuple[Note, ...]]:
    """Return the files of a test as one, their sources, and the notes of reading."""
    from modalscope.io.file_names import said_by_names  # most tests are one file

    names = [Path(path).stem for path in data]
    names = [Path(path).parent.name for path in data] if len(set(names)) == 1 else names  # a folder per sensor
    said = said_by_names(names)
    begins = [next((n.numbers["begins"] for n in notes if "begins" in n.numbers), 0.0) for _, _, notes in parts]
    held, together = _together([part for part, _, _ in parts], names, each, begins, said)
    named, places = _placed(held, names, each, said)
    merged, forces = _forces_by_files(named[0] if len(named) == 1 else merge(named), names)
    merged, units = si_form(merged)
    merged, kind = _as_what_it_is(merged, decays, exclude)
    alike = _alike([note for _, _, read_notes in parts for note in read_notes])
    told = tuple(dict.fromkeys([*alike, *together, *forces, *places, *units, *kind]))
    return merged, tuple(source for _, source, _ in parts), told


def _opened_as(data: Sequence[Any], each: Each, k: int, content: str | None) -> tuple[Opened, float]:
    """Return one of several files, read as `content` where it is given, and by how much it is likelier a record than responses."""
    thing, source, notes, margin = _read(data[k], {**each[k], "content": content or ""})
    return (thing, replace(source, reading=dict(each[k]) | ({"content": content} if content else {})), notes), margin


def _together(
    parts: Sequence[Any], names: Sequence[str], each: Each, begins: Sequence[float], said: Said
) -> tuple[list[Any], tuple[Note, ...]]:
    """Return the parts of a test on the lines and the clock that all have, channels without names under those of their files; and notes."""
    from modalscope.signals.doctor.together import as_one_event, check_units, on_common_lines

    units: tuple[Note, ...] = ()
    # a sensitivity that was given says what a voltage is
    if len({getattr(part, "quantity", None) for part in parts}) > 1:
        converted = [si_form(part) for part in parts]
        parts, units = [part for part, _ in converted], tuple(note for _, notes in converted for note in notes)
    check_units(parts, names)
    lined, lines = on_common_lines(parts, names)
    if any("output_dofs" in options for options in each):
        return lined, (*units, *lines)
    called = said.get("output", said.get("", names))
    labelled, event = as_one_event(lined, called, begins, runs="run" in said)
    if event and not any(part.units[0][0] for part in labelled):
        from modalscope.io.formats import overridden  # most tests are one file

        given = [{"units": options.get("units")} for options in each]
        labelled = [overridden(part, options, None) for part, options in zip(labelled, given, strict=True)]
    return labelled, (*units, *lines, *event)


def _forces_by_files(data: Any, names: Sequence[str]) -> tuple[Any, tuple[Note, ...]]:
    """Return a record of one channel per file, those of files that are named for a force as its inputs, and a note."""
    outputs = data.output_dofs if isinstance(data, Signals) and data.inputs is None else ()
    if len(outputs) < 2 or not set(outputs) <= set(names):
        return data, ()
    from modalscope.io.columns.vocabulary import meanings_of  # most tests are one file

    forces = [dof for dof in outputs if any(what == "force" for what, _ in meanings_of(dof))]
    if 0 < len(forces) < len(outputs):
        text = f"Inputs by the names of their files: {', '.join(forces)}. If they are sensors: {labels_option(len(outputs), 'output')}"
        return as_inputs(data, forces), (Note("file", {}, text),)
    text = f'No file is a force by its name or unit: all are outputs. If one is: --units "{outputs[0]}=N"'
    return data, (Note("file", {}, text),) * (not any(data.units[0]))


def _placed(parts: Sequence[Any], names: Sequence[str], each: Each, said: Said) -> tuple[list[Any], tuple[Note, ...]]:
    """Return the parts of a test that can be used, their inputs labelled by place where the user did not, and notes."""
    used, unusable = with_hits(parts, names)
    kept = [parts[k] for k in used]
    if any("input_dofs" in options for options in each):
        return kept, (*unusable, *against_labels(kept))
    free = [side for side in said if not any(f"{side}_dofs" in options for options in each)]
    of = {side: [said[side][k] for k in used] for side in free}
    labelled, places = label_by_place(kept, [names[k] for k in used], len(parts), of)
    return labelled, (*unusable, *places)


def _alike(notes: Sequence[Note]) -> list[Note]:
    """Return the notes on files; what several files have in common once, with the name of the first."""
    together: dict[tuple[str, str], list[Note]] = {}
    for note in notes:
        together.setdefault((note.kind, note.text.partition(": ")[2]), []).append(note)
    found = []
    for (_, text), same in together.items():
        name = same[0].text.partition(": ")[0]
        found.append(same[0] if len(same) == 1 else replace(same[0], text=f"{name} and {len(same) - 1} more: {text}"))
    return found


@singledispatch
def _as_what_it_is(data: Any, decays: bool, exclude: Sequence[Any] = ()) -> tuple[Any, tuple[Note, ...]]:
    """Return records from their start on, without forces that never change, with the base as inputs of an earthquake, a decay as that.

    Responses without the offsets of their sensors; other data as they are.
    """
    return data, ()


@_as_what_it_is.register
def _(data: FrequencyResponse, decays: bool, exclude: Sequence[Any] = ()) -> tuple[Any, tuple[Note, ...]]:
    return without_offset(data)


@_as_what_it_is.register(Signals)
@_as_what_it_is.register(Records)
def _(data: Signals | Records, decays: bool, exclude: Sequence[Any] = ()) -> tuple[Any, tuple[Note, ...]]:
    from modalscope.signals.doctor.together import from_its_start  # responses have no start

    alone, left = without_dead_forces(data)
    begun, start = from_its_start(alone) if isinstance(alone, Signals) else (alone, ())
    driven, notes = moved_by_base(begun) if isinstance(begun, Signals) else (begun, ())
    if isinstance(driven, Signals) and decays and not notes:
        there = [label for label in exclude if label in driven.output_dofs]
        judged = driven.select(exclude=there) if there and len(there) < len(driven.output_dofs) else None
        driven, notes = as_free_decay(driven, judged)
    return driven, (*left, *start, *notes)


def _of_each(reading: Reading, count: int) -> Each:
    """Return the options of reading of every file."""
    if isinstance(reading, Mapping):
        return [reading] * count
    each = list(check_each("reading", reading, "options of reading, or a list of them"))
    for options in each:
        check_kind("options of reading one file", options, Mapping)
    if len(each) != count:
        have = f"the number of files is {count}"
        raise DataError(
            f"{len(each)} sets of reading options are given", have, "Give one for all files, or one for each."
        )
    return each


def are_paths(data: Any) -> bool:
    """Whether data are a path, or a sequence of nothing but paths."""
    several = data if isinstance(data, list | tuple) else (data,)
    return bool(several) and all(isinstance(each, str | Path) for each in several)


def _opened(data: Any, reading: Mapping[str, Any]) -> tuple[Any, SourceFile, tuple[Note, ...]]:
    thing, source, notes, _ = _read(data, reading)
    return thing, source, notes


def _read(data: Any, reading: Mapping[str, Any]) -> tuple[Any, SourceFile, tuple[Note, ...], float]:
    if is_frame(data):
        from modalscope.io.frames import from_frame  # most tests are files

        made = from_frame(data, **reading)
        return made, source_of_data(made), (), 0.0
    if not isinstance(data, str | Path):
        if reading:
            asked, have = f"reading with {', '.join(reading)}:", f"the data are {type(data).__name__} already"
            raise DataError(asked, have, "Give a path, or make the data with these values.")
        runs = as_test(data) if isinstance(data, list | tuple) else data
        return runs, source_of_data(runs), (), 0.0
    path = file_at(data)
    with stage("reading"):
        found, source = survey(path, **reading), replace(source_of_file(path, reading), path=str(Path(data)))
    if isinstance(found.thing, ModalModel):
        raise DataError(f"modes in {path}:", "the file contains modes already", "Give a file of responses or records.")
    if isinstance(found.thing, Geometry):
        left = ", ".join(dict.fromkeys(finding.kind for finding in found.left if finding.kind))
        raise DataError(
            f"modes in {path}:",
            f"the file gives a {found.result}{f', and no method identifies from its {left}' if left else ''}",
            "Give a file of responses or records.",
        )
    return found.thing, source, found.told, found.margin


def file_at(path: str | Path) -> Path:
    """Return the file at a path; where there is none, that of the measured test of this name."""
    from modalscope.datasets.shipped import FILES, folder  # loaded where data are opened, not by the face

    name, place = str(path), Path(path)
    return folder(name) / FILES[name] if name in FILES and not place.exists() else place


def source_of_file(path: Path, reading: Mapping[str, Any]) -> SourceFile:
    """Return size and hash of a file, in pieces; of a folder, of all files in it with their names."""
    digest, size = sha256(), 0
    if path.is_dir():
        check_links(path)
    for part in sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else (path,):
        if part is not path:
            digest.update(f"{part.relative_to(path).as_posix()}\n".encode())
        size += part.stat().st_size
        with part.open("rb") as file:
            while chunk := file.read(_CHUNK_BYTES):
                digest.update(chunk)
    return SourceFile(path=str(path), size=size, sha256=digest.hexdigest(), reading=dict(reading))


def source_of_data(data: Any) -> SourceFile:
    """Return size and hash of the arrays of a data object, of a stored record those of its name, size and date; empty without arrays."""
    if parts := setups_of(data):
        each = [source_of_data(part) for part in parts]
        whole = sha256(" ".join(part.sha256 for part in each).encode())
        return SourceFile(size=sum(part.size for part in each), sha256=whole.hexdigest())
    if isinstance(data, StoredSignals):
        return SourceFile(size=data.size, sha256=sha256(data.rows.identity.encode()).hexdigest())
    try:
        arrays = to_arrays(data)
    except (TypeError, AttributeError, DataError):
        return SourceFile()
    digest, size = sha256(), 0
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
        size += array.nbytes
    return SourceFile(size=size, sha256=digest.hexdigest())
