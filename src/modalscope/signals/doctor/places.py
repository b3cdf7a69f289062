"""Name the places of a test of several files: those that were driven at one place are averaged, others are inputs of their own.

Files of a roving test often name all their drive points alike. Taken for one place they would be averaged, and the shape lost; one place
taken for several stands in the shape several times. Where the user named the inputs, the names stay, and a note tells what the data say
against them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy import fft

from modalscope.data.channels import AUTO
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse
from modalscope.data.shown import counted, figures, list_some, percent
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.signals.doctor.one_place import ONE, Placed, decide, not_compared, white_noise
from modalscope.signals.preprocess.bands import USEFUL_POWER
from modalscope.signals.preprocess.excitation import excitation_of
from modalscope.signals.preprocess.frf import estimate_frf
from modalscope.signals.preprocess.impacts import find_hits
from modalscope.signals.preprocess.merging import on_common_lines
from modalscope.signals.preprocess.plans import plan_hits

#: What the exponential window falls to at the end of a hit, so that vibration which goes on beyond does not depend on the length of the
#: pulse; and samples ahead of a hit.
_END_OF_WINDOW, _BEFORE = 0.05, 20

#: Maximum number of samples of a run of random forces that are compared, and its segments.
_MAX_SAMPLES, _SEGMENTS = 1 << 16, 8

#: Least share of the resonances that two files of one structure have in common. Of 100 random tests of one structure, whose sensors' masses
#: shift modes by up to .5 %, one is below; of 100 of structures that differ by up to 10 % 90 are.
_ONE_STRUCTURE = 0.3

#: Least share of the energy at resonances that one line shape gives in files of one structure whose amplitudes do not tell one place from
#: several. Of 2300 random tests at one place the 286 of this kind have .887 or more; 13 of other masses (10 %) .62 to .85.
_ONE_SHAPE = 0.875

#: Most files whose labels are written out in a remedy.
_MAX_LISTED = 12


def with_hits(parts: Sequence[Any], names: Sequence[str]) -> tuple[list[int], tuple[Note, ...]]:
    """Return which parts of a hammer test have a usable hit, and a note on each of the others; all of another test.

    Parameters
    ----------
    parts : sequence of data objects
        Records or responses of one test.
    names : sequence of str
        Names of their files, for the notes.
    """
    every = list(range(len(parts)))
    driven = [part for part in parts if isinstance(part, Signals) and len(part.input_dofs) == 1]
    if not 1 < len(parts) == len(driven) or excitation_of(driven) != "impact":
        return every, ()
    faults = {k: fault for k, part in enumerate(parts) if (fault := _fault(part)) is not None}
    told = [f"{names[k]}: left out, no usable hit{f' ({fault})' if fault else ''}" for k, fault in faults.items()]
    kept = [k for k in every if k not in faults]
    return (kept, tuple(Note("file", {}, text) for text in told)) if kept else (every, ())


def _fault(part: Signals) -> str | None:
    """Return the fault of the first hit of a record that has no usable one, empty without any hit; None for a record with a usable one."""
    forces = part.by_run()[1]
    assert forces is not None
    hits = find_hits(forces[:, :, 0])
    return None if any(not hit.unfit for hit in hits) else hits[0].reason if hits else ""


def label_by_place(
    parts: Sequence[Any],
    names: Sequence[str],
    files: int | None = None,
    said: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> tuple[list[Any], tuple[Note, ...]]:
    """Label the input of each part of a test by its place when parts of one input label were driven at several places.

    Names of files that say places are followed unless data show one place. The parts are returned unchanged if they have one place; also
    without a note if they have several inputs, different labels or other outputs.

    Parameters
    ----------
    parts : sequence of data objects
        Records or responses of one test.
    names : sequence of str
        Names of their files, for the note.
    files : int, optional
        Number of the files of the test with those that were left out, which a remedy labels, too.
    said : mapping of str to sequences of str, optional
        Labels of the places that names of files say, one a part, by side: "input", "output", or "" for either; of runs: "run"; and of the
        places if hyphens that were taken as signs are none: "unsigned".

    Raises
    ------
    DataError
        Resonances that shift from file to file, with amplitudes that are neither those of one place nor of several.
    """
    found = placed(parts) if _comparable(parts) and len({part.input_dofs for part in parts}) == 1 else None
    if found is None:
        return list(parts), ()
    every, single = files or len(parts), len(parts[0].output_dofs) == 1
    named = {side or "input": labels for side, labels in said.items() if side in ("", "input", "output")[: 2 + single]}
    labels = named.get("input", ()) if every == len(parts) else ()
    moved = f"; if the sensor moved: {labels_option(every, 'output')}" * single
    if found.kind == "ask" and found.shared < _ONE_SHAPE:
        have = f"resonances shift from file to file (one line shape gives {percent(found.shared, 2)} of their energy) and {_apart(found)}"
        have += ": runs at one place have neither, places of one structure differ more"
        change = f"Read each by itself: --each; if one place: --input-dofs 1; if places: {labels_option(every, labels=labels)}{moved}"
        raise DataError(f"{len(parts)} files as one test:", have, change)
    agree = found.resonances > 1 and found.apart <= ONE  # at one alone several places may
    if named and (found.kind == "several" or not (found.is_sure or agree)):
        moved = f"; if the force moved: {labels_option(every)}" if "output" in named else moved
        if "unsigned" in said and every == len(parts):
            moved += f"; if the hyphens are no signs: {labels_option(every, next(iter(named)), said['unsigned'])}"
        listed = "; ".join(f"{side}s {list_some(dict.fromkeys(labels))}" for side, labels in named.items())
        shown = _apart(found) if found.resonances else "no resonance shows them"
        text = f"Places are those that the names of the files say, {listed} ({shown}); if one place: --input-dofs 1{moved}{_doubt(found)}"
        labelled = _labelled(parts, named)
        return labelled, (_note(text, len(set(zip(*named.values(), strict=True)))), *against_labels(labelled))
    if found.kind != "several" or ("run" in said and not found.is_sure):
        text = f"{_one(found, names)}. If places: {labels_option(every, labels=labels)}{moved}{_doubt(found)}"
        return list(parts), (_note(text, 1),)
    count = max(found.places) + 1
    at = [", ".join(name for name, p in zip(names, found.places, strict=True) if p == k) for k in range(count)]
    alone = len(set(names)) == count
    own = "" if alone else f"; if each a place of its own: {labels_option(every)}"
    listed = "after their files" if alone else "; ".join(f"place {k + 1} ({of})" for k, of in enumerate(at))
    text = f"{len(parts)} files look like {count} drive points, all labelled {parts[0].input_dofs[0]!r}: "
    text += f"{_apart(found)}. Inputs are named {listed}; if one place: --input-dofs 1{own}{moved}{_doubt(found)}"
    called = list(names) if alone else [f"place {p + 1}" for p in found.places]
    return _labelled(parts, {"input": called}), (_note(text, count),)


def _note(text: str, places: int) -> Note:
    return Note("places", {"places": float(places)}, text)


def _labelled(parts: Sequence[Any], labels: Mapping[str, Sequence[str]]) -> list[Any]:
    """Return parts with a label each, by side."""
    each = zip(*labels.values(), strict=True)
    sides = [f"{side}_dofs" for side in labels]
    return [
        replace(part, **{s: [c] for s, c in zip(sides, called, strict=True)}, groups=AUTO)
        for part, called in zip(parts, each, strict=True)
    ]


def _doubt(found: Placed) -> str:
    """Return the way out where files are perhaps of several structures."""
    shared = f" (two files have {100 * found.shared:.0f} % of their resonances in common)"
    few = found.kind == "several" and found.shared < _ONE_STRUCTURE
    settled = found.is_sure if found.kind == "several" else found.kind in ("one", "size") and found.shared >= _ONE_SHAPE
    return f"; if structures of their own{shared * few}: --each" if few or not settled else ""


def against_labels(parts: Sequence[Any]) -> tuple[Note, ...]:
    """Return a note where data speak against the labels that a user gave the inputs of the parts of a test; the labels stay."""
    if not _comparable(parts):
        return ()
    alike: dict[str, list[Any]] = {}
    for part in parts:
        alike.setdefault(part.input_dofs[0], []).append(part)
    for label, group in alike.items():
        if len(group) > 1 and (found := placed(group)).kind == "several":
            text = f"{len(group)} files named {label!r} are averaged as one place, but {_apart(found)}, as those of several places"
            return (_note(text, len(alike)),)
    if len(alike) > 1 and (found := placed(parts)).kind == "one":
        return (_note(f"{len(alike)} drive points as asked, but {_agree(found)}, as those of one place", len(alike)),)
    return ()


def _apart(found: Placed) -> str:
    few = "only " if found.resonances < 3 else ""
    return f"amplitudes at {few}{counted(found.resonances, 'resonance')} differ by {percent(found.apart, 2)}"


def _agree(found: Placed) -> str:
    return f"amplitudes at {counted(found.resonances, 'resonance')} agree within {max(1, round(100 * found.apart))} %"


def _one(found: Placed, names: Sequence[str]) -> str:
    """Return why files are taken for one place, in words."""
    files = f"{len(names)} files"
    if found.kind == "one":
        return f"{files} were driven at one place ({_agree(found)}): averaged"
    if found.kind == "unknown":
        return f"{files} are taken as one place, as they are labelled: no resonance shows their places"
    if found.kind == "size":
        gain = np.exp(np.median(np.log(found.gains), axis=1))
        k = int(np.argmax(np.abs(np.log(gain))))
        return f"{files} look like one place, but {names[k]} is {figures(gain[k], 2)} x as large (overload, range or unit?): taken as one"
    how = "are runs by their names" if found.kind == "several" else "look like one place"
    return f"{files} {how} ({_apart(found)}): taken as one"


def labels_option(files: int, side: str = "input", labels: Sequence[str] = ()) -> str:
    """Return the option that makes every file a place, or gives it the label that its name says."""
    if files > _MAX_LISTED:
        return f"{files} labels, one per file: --{side}-dofs"
    return f"--{side}-dofs {' '.join(labels or [str(k + 1) for k in range(files)])}"


def _comparable(parts: Sequence[Any]) -> bool:
    """Whether parts are records of one rate, or responses on one set of lines, with the same outputs and one input each."""
    first = parts[0]
    if len(parts) < 2 or not isinstance(first, Signals | FrequencyResponse):
        return False
    alike = len({(type(part), part.output_dofs) for part in parts}) == 1 and all(len(p.input_dofs) == 1 for p in parts)
    if not alike or isinstance(first, Signals):
        return alike and len({part.sampling_rate for part in parts}) == 1
    return all(np.array_equal(part.frequencies, first.frequencies) for part in parts)


def placed(parts: Sequence[Any]) -> Placed:
    """Return the decision on parts with the same outputs and lines, or sampling rate, and one input each."""
    if isinstance(parts[0], FrequencyResponse):
        return decide(*_of_responses(parts))
    kind, count = excitation_of(parts), min(_MAX_SAMPLES, *(part.samples for part in parts))
    try:
        if kind == "impact":
            return decide(*_of_hits(parts))
        return decide(*_of_responses([_response(part, count, kind) for part in parts]))
    except DataError:  # a file without a usable hit, or without a force
        return not_compared(len(parts))


def _response(part: Signals, count: int, kind: str) -> FrequencyResponse:
    """Return the response of the first `count` samples of every run."""
    y, u = part.by_run()
    assert u is not None
    cut = replace(part, outputs=y[:, :count], inputs=u[:, :count])
    return estimate_frf(cut, excitation=kind, segment=count // _SEGMENTS if kind == "random" else None)


def _of_responses(parts: Sequence[FrequencyResponse]) -> tuple[ComplexArray, RealArray]:
    """Return responses (files, lines, outputs) and their noise: the variances that they state, or that of second differences."""
    parts = on_common_lines(parts)
    values = np.stack([part.values[:, :, 0] for part in parts])
    stated = [part.variance[:, :, 0] for part in parts if part.variance is not None]
    return values, np.stack(stated) if len(stated) == len(parts) else white_noise(values)


def _of_hits(parts: Sequence[Signals]) -> tuple[ComplexArray, RealArray]:
    """Return the responses of hammer hits (files, lines, outputs) on the lines that all hits reach, and their noise.

    Each hit is cut to the same length. The window w makes the noise of neighbouring lines alike, with the correlations r_1 and r_2 of
    the transform of w^2, and second differences 3 - 4 r_1 + r_2 of three times its variance.
    """
    plans = [plan_hits(part, None, "good", _BEFORE, None) for part in parts]
    count = min(plan.outputs.shape[1] for plan in plans)
    window = _END_OF_WINDOW ** (np.arange(count) / count)
    powers, values = [], []
    for plan in plans:
        y, u = plan.outputs[:, :count] * window[:, None], plan.inputs[:, :count, 0] * window
        Y, U = (fft.rfft(x, axis=1)[:, 1:-1] for x in (y, u))
        powers.append(np.sum(np.abs(U) ** 2, axis=0))
        values.append(np.einsum("kfi,kf->fi", Y, U.conj()) / np.maximum(powers[-1], np.finfo(float).tiny)[:, None])
    power = np.stack(powers)
    useful = np.all(power >= USEFUL_POWER * power.max(axis=1, keepdims=True), axis=0)
    H = np.stack(values)[:, useful]
    r = np.real(fft.rfft(window**2)[:3]) / np.sum(window**2)
    return H, white_noise(H) * 3 / float(3 - 4 * r[1] + r[2])
