"""Arrange the functions of a universal file as a matrix of outputs and inputs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, Signals
from modalscope.io.limits import Room
from modalscope.io.uff.function import Function
from modalscope.io.uff.layout import FORCES, QUANTITY_OF, sort_key
from modalscope.numerics.checks import Array, RealArray

#: Abscissas agree when they differ by less than this part of a step: text files print few digits.
SAME = 1e-3
#: Channels of the shorter side up to which all subsets are tried.
_MAX_EXHAUSTIVE = 12
#: Abscissas in a file, more than any measurement has.
_MAX_AXES = 200
#: Types of functions.
_TIME, _FRF, _COHERENCE, _MULTIPLE = 1, 4, 6, 26
_CORRELATIONS, _FILTER = (7, 8), 25
#: Units of SI by specific data type.
SI_UNITS = {8: "m", 9: "N", 11: "m/s", 12: "m/s2", 13: "N"}

Pair = tuple[str, str]


@dataclass(slots=True)
class Sorted:
    """The data object's fields, why functions are ignored (by place), what is missing, and the room that there is."""

    room: Room
    thing: Any = None
    left: dict[int, str] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def same_axis(a: Function, b: Function) -> bool:
    """Whether two functions have the same abscissa."""
    if a.x.size != b.x.size:
        return False
    step = (a.x[-1] - a.x[0]) / max(a.x.size - 1, 1)
    if abs(a.x[-1] - b.x[-1]) > SAME * abs(step):  # the ends tell most of them apart
        return False
    return bool(np.max(np.abs(a.x - b.x)) <= SAME * abs(step))


def _other_axis(function: Function) -> str:
    return f"another abscissa, {function.x.size} points from {function.x[0]:g} to {function.x[-1]:g}"


def largest_group(
    functions: Sequence[Function], out: Sorted, quantity: str | None, by_quantity: bool
) -> list[Function]:
    """Return the functions on the commonest abscissa (and of one quantity); the first group wins a tie."""

    def measures(group: list[Function]) -> str | None:
        return QUANTITY_OF.get(group[0].quantity) if by_quantity else None

    groups: list[list[Function]] = []
    for function in functions:
        for group in groups:
            if same_axis(group[0], function) and measures(group) == measures([function]):
                group.append(function)
                break
        else:
            groups.append([function])
            out.room.parts("different abscissas", len(groups), _MAX_AXES)
    wanted = [group for group in groups if quantity is not None and measures(group) == quantity]
    best = max(wanted or groups, key=len)
    usual = QUANTITY_OF.get(best[0].quantity, "of unknown quantity")
    for function in (function for group in groups if group is not best for function in group):
        kind = QUANTITY_OF.get(function.quantity, "an unknown quantity")
        same = same_axis(function, best[0])
        out.left[function.place] = f"{kind} where the others are {usual}" if same else _other_axis(function)
    return best


def by_pair(functions: Sequence[Function], out: Sorted, repeated: str | None) -> dict[Pair, Function]:
    """Return functions by output and input; what to do with a pair measured twice is for the caller to choose."""
    pairs: dict[Pair, Function] = {}
    for function in functions:
        key = (function.output, function.input)
        before = pairs.get(key)
        if before is not None and repeated is None:
            fault = f"{key[0]} / {key[1]} was measured twice: in {before.part} and in {function.part}"
            remedy = 'Give repeated="first" or repeated="last", or leave one out of the export.'
            raise DataError(f"one {function.words} for each pair of dofs:", fault, remedy)
        if before is None or repeated == "last":
            pairs[key] = function
        if before is not None:
            lost = before if repeated == "last" else function
            out.left[lost.place] = f'{key[0]} / {key[1]} was measured more than once: repeated="{repeated}"'
    return pairs


def complete_block(pairs: dict[Pair, Function], out: Sorted) -> tuple[list[str], list[str]]:
    """Return the outputs and inputs of the largest complete matrix (all of them when none is missing)."""
    outputs = sorted({o for o, _ in pairs}, key=sort_key)
    inputs = sorted({i for _, i in pairs}, key=sort_key)
    out.room.square(f"{len(outputs)} outputs and {len(inputs)} inputs", len(outputs) * len(inputs), len(pairs))
    there = np.array([[(o, i) in pairs for i in inputs] for o in outputs])
    if there.all():
        return outputs, inputs
    rows, columns = _largest_block(there)
    kept_out, kept_in = [outputs[k] for k in rows], [inputs[k] for k in columns]
    missing = [f"{outputs[a]} / {inputs[b]}" for a, b in np.argwhere(~there)]
    named = ", ".join(missing[:6]) + (" ..." if len(missing) > 6 else "")
    out.missing.append(f"{len(missing)} of {there.size} pairs of the {len(outputs)} x {len(inputs)} matrix: {named}")
    out.notes.append(f"the largest complete block, {len(kept_out)} outputs x {len(kept_in)} inputs, was taken")
    for (o, i), function in pairs.items():
        if o not in kept_out or i not in kept_in:
            out.left[function.place] = f"{o} / {i} lies outside the largest complete block of outputs and inputs"
    return kept_out, kept_in


def _largest_block(there: Array) -> tuple[list[int], list[int]]:
    """Return rows and columns of the largest block of True.

    Exact when one side has at most twelve; else by dropping the emptiest row or column until nothing is missing.
    """
    if min(there.shape) > _MAX_EXHAUSTIVE:
        return _without_gaps(~there)
    wide = there if there.shape[1] <= there.shape[0] else there.T
    best: tuple[int, list[int], list[int]] = (0, [], [])
    for size in range(1, wide.shape[1] + 1):
        for choice in combinations(range(wide.shape[1]), size):
            full = np.flatnonzero(wide[:, choice].all(axis=1))
            if full.size * size >= best[0] and full.size:
                best = (full.size * size, full.tolist(), list(choice))
    return (best[1], best[2]) if wide is there else (best[2], best[1])


def _without_gaps(gaps: Array) -> tuple[list[int], list[int]]:
    """Drop the row or the column with the largest part of gaps until none is left."""
    kept = [np.ones(gaps.shape[0], bool), np.ones(gaps.shape[1], bool)]
    counts = [gaps.sum(axis=1), gaps.sum(axis=0)]
    while counts[0][kept[0]].any():
        part = [np.where(kept[k], counts[k] / kept[1 - k].sum(), -1.0) for k in (0, 1)]
        side = 0 if part[0].max() >= part[1].max() else 1
        worst = int(np.argmax(part[side]))
        kept[side][worst] = False
        counts[1 - side] -= gaps.take(worst, axis=side)
    return np.flatnonzero(kept[0]).tolist(), np.flatnonzero(kept[1]).tolist()


def in_si(function: Function) -> Function:
    """Return a function of a file of SI units: units that are not written follow from its data types."""
    unit, unit_in = (SI_UNITS.get(code, "") for code in (function.quantity, function.denominator))
    return replace(function, unit=function.unit or unit, unit_in=function.unit_in or unit_in)


def matrix(group: list[Function], out: Sorted, repeated: str | None) -> dict[str, Any]:
    """Return values (points, outputs, inputs), labels and units of the largest complete matrix of responses on one axis."""
    pairs = by_pair(group, out, repeated)
    outputs, inputs = complete_block(pairs, out)
    values = np.stack([np.stack([pairs[o, i].values for i in inputs], axis=-1) for o in outputs], axis=1)
    units = [pairs[o, inputs[0]].unit for o in outputs], [pairs[outputs[0], i].unit_in for i in inputs]
    return {"values": values, "output_dofs": tuple(outputs), "input_dofs": tuple(inputs), "units": units}


def kind_of(function: Function) -> str:
    """Return which data object a function can be part of: frequency response, impulse response, records, coherence or none."""
    if function.kind == _FRF:
        return "frequency response"
    if function.kind in (*_CORRELATIONS, _FILTER) or (function.kind == _TIME and function.denominator in FORCES):
        return "impulse response"
    if function.kind == _TIME:
        return "records"
    return "coherence" if function.kind in (_COHERENCE, _MULTIPLE) else ""


def sort_frequency(
    functions: Sequence[Function], coherences: Sequence[Function], options: dict[str, Any], space: Room
) -> Sorted:
    """Make one matrix of frequency responses, with the coherence where it is complete."""
    out = Sorted(room=space)
    group = largest_group(functions, out, options.get("quantity"), by_quantity=True)
    fields = matrix(group, out, options.get("repeated"))
    quantity = QUANTITY_OF.get(group[0].quantity)
    if quantity is None and options.get("quantity") is None:
        out.notes.append("the quantity of the responses is not known: give quantity= when it matters")
    coherence = _coherence(coherences, group[0], fields["output_dofs"], fields["input_dofs"], out)
    out.thing = FrequencyResponse(frequencies=group[0].x, quantity=quantity, coherence=coherence, **fields)
    return out


def _coherence(
    functions: Sequence[Function], like: Function, outputs: Sequence[str], inputs: Sequence[str], out: Sorted
) -> RealArray | None:
    """Return the coherence (lines, outputs[, inputs]) when there is one function for every channel taken."""
    fitting: dict[Pair, Function] = {}
    for function in functions:
        if np.iscomplexobj(function.values) and function.values.imag.any():
            out.left[function.place] = "a coherence is real"
        elif not same_axis(function, like):
            out.left[function.place] = _other_axis(function)
        else:
            fitting[function.output, function.input] = function
    if not fitting:
        return None
    if all((o, i) in fitting for o in outputs for i in inputs):
        used = [(o, i) for o in outputs for i in inputs]
        array = np.stack([np.stack([fitting[o, i].values.real for i in inputs], axis=-1) for o in outputs], axis=1)
    else:
        alone = {o: f for (o, _), f in fitting.items()}
        multiple = len(inputs) == 1 or all(f.kind == _MULTIPLE for f in alone.values())
        if len(alone) != len(fitting) or not all(o in alone for o in outputs) or not multiple:
            there = sum((o, i) in fitting for o in outputs for i in inputs)
            out.missing.append(f"coherence of every pair: {there} of {len(outputs) * len(inputs)} are there")
            out.left |= {f.place: "the coherence is not complete" for f in fitting.values()}
            return None
        used = [(alone[o].output, alone[o].input) for o in outputs]
        array = np.stack([alone[o].values.real for o in outputs], axis=-1)
    out.left |= {f.place: "no response was taken for this pair" for key, f in fitting.items() if key not in used}
    if array.min() < 0 or array.max() > 1 + 1e-6:
        reason = f"a coherence lies between 0 and 1, this from {array.min():g} to {array.max():g}"
        out.left |= {fitting[key].place: reason for key in used}
        return None
    return array


def _rate_of(function: Function, out: Sorted) -> float | None:
    """Return samples per second, or None (with the reason) when the time axis is not even."""
    steps = np.diff(function.x)
    if steps.size == 0 or steps.min() <= 0 or np.ptp(steps) > SAME * steps.mean():
        out.left[function.place] = "its time axis is not evenly spaced" if steps.size else "it has one sample"
        return None
    return float((function.x.size - 1) / (function.x[-1] - function.x[0]))


def _evenly(functions: Sequence[Function], out: Sorted, what: str) -> list[Function]:
    even = [function for function in functions if _rate_of(function, out) is not None]
    if not even:
        fault = next(iter(out.left.values()))
        raise DataError(f"{what}:", fault, "Resample them evenly before they are exported.")
    return even


def sort_impulse(functions: Sequence[Function], options: dict[str, Any], space: Room) -> Sorted:
    """Make one impulse response: correlations by their type, samples over an excitation force as sampled impulse responses.

    Correlations and pulse responses keep what stands at time zero apart, as `feedthrough`; negative lags are ignored.
    """
    out = Sorted(room=space)
    kinds = Counter(_impulse_kind(f) for f in functions)
    kind = options.get("kind") or _commonest(kinds)
    # a kind that is asked for and not there is what the functions are meant to be
    chosen = [f for f in functions if kind not in kinds or _impulse_kind(f) == kind]
    for other in functions:
        if kind in kinds and (other_kind := _impulse_kind(other)) != kind:
            out.left[other.place] = f'it is a {other_kind} response; expected {kind}: kind="{other_kind}" reads it'
    group = largest_group(_evenly(chosen, out, "impulse responses"), out, options.get("quantity"), by_quantity=True)
    fields = matrix(group, out, options.get("repeated"))
    rate, x = _rate_of(group[0], out) or 0.0, group[0].x
    start = round(float(x[0]) * rate)
    apart, values = kind in ("correlation", "pulse"), fields.pop("values").real
    if start < 0:
        out.notes.append(f"{-start} samples before time zero ignored")
        values, start = values[-start:], 0
    direct = values[0] if apart and start == 0 else None
    out.thing = ImpulseResponse(
        values=values[1:] if direct is not None else values,
        feedthrough=direct,
        sampling_rate=rate,
        kind=kind,
        first_sample=0 if direct is not None else start - apart,
        quantity=QUANTITY_OF.get(group[0].quantity),
        **fields,
    )
    return out


def _commonest(kinds: Counter[str]) -> str:
    """Return the kind of most functions, or raise when two are equally common."""
    first, *rest = kinds.most_common()
    if rest and rest[0][1] == first[1]:
        counts = " and ".join(f"{count} {kind} responses" for kind, count in kinds.items())
        remedy = f'Choose one, read(..., kind="{first[0]}"), and read the other by itself.'
        raise DataError("impulse responses of one kind:", f"the file holds {counts}", remedy)
    return first[0]


def _impulse_kind(function: Function) -> str:
    prefix = "impulse response: "
    named = next((text.removeprefix(prefix) for text in function.texts if text.startswith(prefix)), "")
    if named in ("pulse", "dirac", "free decay", "correlation"):
        return named
    return "correlation" if function.kind in _CORRELATIONS else "dirac"


def sort_records(functions: Sequence[Function], options: dict[str, Any], space: Room) -> Sorted:
    """Make one record: forces are inputs, everything else outputs; channels that come R times each are R runs."""
    out = Sorted(room=space)
    group = largest_group(_evenly(functions, out, "records"), out, None, by_quantity=False)
    forces = [f for f in group if f.quantity in FORCES]
    others = [f for f in group if f.quantity not in FORCES]
    if not others:
        forces, others = [], group
        out.notes.append("all channels are forces; they were taken as outputs")
    sides = [_channels(side, out) for side in (others, forces)]
    runs = {len(functions) for side in sides for functions in side.values()}
    if len(runs) != 1:
        counts = ", ".join([f"{label} {len(fs)}" for side in sides for label, fs in side.items()][:12])
        fault = f"the file does not hold every channel equally often: {counts}"
        raise DataError("records of whole runs:", fault, "Export every channel of every run, and nothing else.")
    count = runs.pop()
    first = [[fs[0] for fs in side.values()] for side in sides]
    out.thing = Signals(
        outputs=_stacked(sides[0], count),
        inputs=_stacked(sides[1], count) if sides[1] else None,
        sampling_rate=_rate_of(group[0], out) or 0.0,
        quantities=tuple(QUANTITY_OF.get(f.quantity) for f in first[0]),
        output_dofs=tuple(sides[0]),
        input_dofs=tuple(sides[1]),
        units=(tuple(f.unit for f in first[0]), tuple(f.unit for f in first[1])),
    )
    if count > 1:
        out.notes.append(f"every channel was measured {count} times: {count} runs")
    return out


def _channels(functions: Sequence[Function], out: Sorted) -> dict[str, list[Function]]:
    """Return functions by dof, sorted; when no channel has a dof they are named ch1, ch2, ... in the file's order."""
    if len(functions) > 1 and {f.output for f in functions} == {"0:S"}:
        out.notes.append("the channels have no dofs; they were named in the order of the file")
        return {f"ch{k}": [f] for k, f in enumerate(functions, 1)}
    channels: dict[str, list[Function]] = {}
    for function in functions:
        channels.setdefault(function.output, []).append(function)
    return dict(sorted(channels.items(), key=lambda item: sort_key(item[0])))


def _stacked(side: dict[str, list[Function]], runs: int) -> Array:
    array = np.stack([np.stack([f.values.real for f in functions]) for functions in side.values()], axis=-1)
    return array if runs > 1 else array[0]
