"""Merge the parts of one test by the labels of their channels: runs, roving sensors, responses, correlations of setups."""

from __future__ import annotations

import inspect
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.data.channels import AUTO, source_of
from modalscope.data.records import Records, Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups
from modalscope.data.units import in_si
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, RealArray, check_each, check_kind
from modalscope.numerics.errors import DataError
from modalscope.signals.preprocess.bands import driven_band
from modalscope.signals.preprocess.correlation import estimate_correlation
from modalscope.signals.preprocess.excitation import excitation_of
from modalscope.signals.preprocess.frf import estimate_frf
from modalscope.signals.preprocess.setups import correlations, merge_setups


def joined_frf(parts: Sequence[Signals], **options: Any) -> FrequencyResponse:
    """Estimate the frequency responses of every part by `estimate_frf`, on lines that all have, and merge them.

    Without a segment among the options all parts use the shortest of their defaults, and without an excitation that of most of them.
    """
    if "excitation" not in options:
        options["excitation"] = excitation_of(parts, "auto")
    responses = [estimate_frf(part, **options) for part in parts]
    steps = [float(np.min(np.diff(response.frequencies))) for response in responses]
    lengths = [round(part.sampling_rate / step) for part, step in zip(parts, steps, strict=True)]
    if len(set(lengths)) > 1 and options.get("segment") is None:
        responses = [estimate_frf(part, **{**options, "segment": min(lengths)}) for part in parts]
    return merge_frf(on_common_lines(responses)) if len(responses) > 1 else responses[0]


def on_common_lines(parts: Sequence[FrequencyResponse]) -> list[FrequencyResponse]:
    """Return the responses on the lines that all have, counted in the smallest step."""
    step = min(float(np.min(np.diff(part.frequencies))) for part in parts)
    numbers = [np.round((part.frequencies - parts[0].frequencies[0]) / step).astype(np.int64) for part in parts]
    shared = set.intersection(*(set(lines.tolist()) for lines in numbers))
    return [
        part if len(shared) == len(lines) else part.at_lines(np.isin(lines, list(shared)))
        for part, lines in zip(parts, numbers, strict=True)
    ]


def _check_same(parts: Sequence[Any], name: str, change: str) -> None:
    """Raise DataError when parts differ in the attribute `name`; `change` is the remedy."""
    values = [getattr(part, name) for part in parts]
    for number, value in enumerate(values[1:], 2):
        if value != values[0]:
            have = f"part 1 has {values[0]}, part {number} {value}"
            raise DataError(f"parts of the same {name.replace('_', ' ')}:", have, change)


@dataclass(slots=True)
class _Union:
    """The union of the channels, and the places, weights and units of the parts in it."""

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    places: list[Any]
    weights: list[float]
    units: tuple[tuple[str, ...], tuple[str, ...]]

    def average(self, arrays: Sequence[Array], power: int = 1) -> Array:
        """Return sum w^p x / (sum w)^p over the parts, (samples, l, m); power 2 is for variances."""
        shape = (arrays[0].shape[0], len(self.outputs), len(self.inputs))
        total, weight = np.zeros(shape, dtype=arrays[0].dtype), np.zeros(shape[1:])
        for array, place, w in zip(arrays, self.places, self.weights, strict=True):
            total[(slice(None), *place)] += w**power * array
            weight[place] += w
        return np.asarray(total / weight**power)


def _union(parts: Sequence[Any]) -> _Union:
    outputs = tuple(dict.fromkeys(dof for part in parts for dof in part.output_dofs))
    inputs = tuple(dict.fromkeys(dof for part in parts for dof in part.input_dofs))
    places = []
    present = np.zeros((len(outputs), len(inputs)), dtype=bool)
    units: tuple[dict[str, str], dict[str, str]] = ({}, {})
    for part in parts:
        place = np.ix_([outputs.index(d) for d in part.output_dofs], [inputs.index(d) for d in part.input_dofs])
        present[place] = True
        places.append(place)
        for side, dofs, given in zip(units, (part.output_dofs, part.input_dofs), part.units, strict=True):
            for dof, unit in zip(dofs, given, strict=True):
                if side.setdefault(dof, unit) != unit:
                    have = f"{dof} is in {side[dof] or 'no unit'} in one and in {unit or 'no unit'} in another"
                    raise DataError("a channel needs the same unit in all parts", have, "Convert them to one unit.")
    missing = np.argwhere(~present)
    if len(missing):
        have = f"no part contains {outputs[missing[0, 0]]} / {inputs[missing[0, 1]]}"
        have += f" and {len(missing) - 1} other pairs" if len(missing) > 1 else ""
        asked = f"a response of {len(outputs)} outputs to {len(inputs)} inputs:"
        raise DataError(asked, have, "Add the missing runs, or select the channels that are complete.")
    weights = [float(getattr(part, "averages", None) or 1) for part in parts]
    both = (tuple(units[0][d] for d in outputs), tuple(units[1][d] for d in inputs))
    return _Union(outputs, inputs, places, weights, both)


def merge_frf(parts: Sequence[FrequencyResponse]) -> FrequencyResponse:
    """Merge frequency responses on the same lines by output and input; pairs that several parts have are averaged."""
    first = parts[0]
    for number, part in enumerate(parts[1:], 2):
        if part.lines != first.lines or not np.allclose(part.frequencies, first.frequencies, rtol=1e-6, atol=0):
            lines = (f"{p.lines} lines, {p.frequencies[0]:g} to {p.frequencies[-1]:g} Hz" for p in (first, part))
            have = f"part 1 has {next(lines)}; part {number} {next(lines)}"
            change = "Estimate all parts with the same segment, or cut them to the same band."
            raise DataError("parts to merge need the same lines", have, change)
    for name in ("quantity", "sampling_rate", "added_damping"):
        _check_same(parts, name, "Convert the parts, with as_quantity(), or estimate them alike.")
    union = _union(parts)
    variances = [part.variance for part in parts if part.variance is not None]
    averages = [part.averages for part in parts if part.averages is not None]
    return replace(
        first,
        values=union.average([part.values for part in parts]),
        variance=union.average(variances, power=2) if len(variances) == len(parts) else None,
        coherence=_coherence(parts, union),
        averages=min(averages) if len(averages) == len(parts) else None,
        **_labels(parts, union),
    )


def _coherence(parts: Sequence[FrequencyResponse], union: _Union) -> Array | None:
    """Return the mean coherence of every output when all parts have the same inputs, of every pair when not."""
    given = [part.coherence for part in parts if part.coherence is not None]
    if len(given) < len(parts):
        return None
    pairs = [
        np.broadcast_to(c[:, :, None] if c.ndim == 2 else c, part.values.shape)
        for c, part in zip(given, parts, strict=True)
    ]
    merged = union.average(pairs)
    by_output = all(c.ndim == 2 for c in given) and len({part.input_dofs for part in parts}) == 1
    return merged[:, :, 0] if by_output else merged


def merge_pulses(parts: Sequence[ImpulseResponse]) -> ImpulseResponse:
    """Merge impulse responses as `merge_frf` does, over the samples that all have."""
    for name in ("kind", "sampling_rate", "first_sample", "quantity"):
        _check_same(parts, name, "Merge parts that were measured alike.")
    union = _union(parts)
    count = min(part.samples for part in parts)
    direct = [part.feedthrough[None] for part in parts if part.feedthrough is not None]
    return replace(
        parts[0],
        values=union.average([part.values[:count] for part in parts]),
        feedthrough=union.average(direct)[0] if len(direct) == len(parts) else None,
        **_labels(parts, union),
    )


def _labels(parts: Sequence[Any], union: _Union) -> dict[str, Any]:
    groups = {
        dof: label for part in parts if part.groups for dof, label in zip(part.input_dofs, part.groups, strict=True)
    }
    return {
        "output_dofs": union.outputs,
        "input_dofs": union.inputs,
        "units": union.units,
        "groups": tuple(groups.get(dof, dof) for dof in union.inputs) if groups else AUTO,
        "geometry": next((part.geometry for part in parts if part.geometry is not None), None),
        "source_path": source_of(parts),
        "processing": (*parts[0].processing, f"merged from {len(parts)} parts by their labels"),
    }


Part = Signals | FrequencyResponse | ImpulseResponse
Test = Records | Setups


@named(inspect.signature(estimate_frf).parameters, inspect.signature(estimate_correlation).parameters)
def merge(parts: Iterable[Part | Test], **options: Any) -> Part | Test:
    """Merge the runs of one test by the labels of their channels.

    Parameters
    ----------
    parts : sequence of Signals, Records, Setups, FrequencyResponse or ImpulseResponse
        All of one kind.

        - Records of the same channels and length become one record of several runs, which estimates average.
        - Records of one channel each, without inputs and of different names, become one record of all channels, at the lowest of their
          rates and over the samples that all have; forces, by their units, are its inputs.
        - Records of the same outputs, but of other lengths or inputs, become `Records`.
        - Records of different outputs under measured forces (roving sensors) become one frequency response: `estimate_frf`
          of each, merged; without options it is identified on the lines that hits, sweeps or bursts drive.
        - Records of different outputs without forces (ambient setups) become `Setups`, each of which is filtered to the band
          before they are merged; with options of `estimate_correlation` one correlation at once: every setup is correlated with the
          outputs that all setups share, and the other outputs are transferred to these common references (see `merge_setups`).
        - Responses are merged output by output and input by input; pairs that several parts have are averaged,
          weighted by their averages.
    **options
        Those of `estimate_frf` or `estimate_correlation`, for records of different outputs.

    Returns
    -------
    Signals, Records, Setups, FrequencyResponse or ImpulseResponse

    Raises
    ------
    DataError
        Parts of different kinds, lines, sampling rates or quantities; no common reference; a pair of output and input that
        no part has.

    Examples
    --------
    >>> f = np.linspace(1, 2, 5)
    >>> parts = [
    ...     FrequencyResponse(values=np.full((5, 1, 1), 1j * k), frequencies=f, output_dofs=[f"{k}:+Z"]) for k in (1, 2)
    ... ]
    >>> merge(parts).output_dofs
    ('1:+Z', '2:+Z')
    """
    given: list[Part] = []
    for part in check_each("parts to merge", parts, "a list of records or responses"):
        inside = {Records: "runs", Setups: "parts"}.get(type(part))
        given += getattr(part, inside) if inside else [part]
    if not given:
        raise DataError("merging needs at least one part", "the list is empty", "Give at least one record or response.")
    for part in given:
        check_kind("each part to merge", part, (FrequencyResponse, ImpulseResponse, Signals, Records, Setups))
    kinds = {type(part).__name__ for part in given}
    if len(kinds) > 1:
        change = "Estimate responses from the records first, or merge each kind by itself."
        raise DataError("parts to merge need to be of one kind", f"there are {', '.join(sorted(kinds))}", change)
    if not isinstance(given[0], Signals) and options:
        have = "responses are merged without options"
        raise DataError(f"{next(iter(options))}:", have, "Leave it out, or merge the records.")
    if len(given) == 1:
        return given[0]
    if isinstance(given[0], Signals):
        return _merge_records([part for part in given if isinstance(part, Signals)], options)
    responses: list[Any] = list(given)
    if isinstance(given[0], FrequencyResponse):
        return merge_frf(responses)
    if all(part.kind == "correlation" for part in responses):
        return merge_setups(responses)
    return merge_pulses(responses)


def _merge_records(parts: list[Signals], options: dict[str, Any]) -> Part | Test:
    # files of one channel each, of different names: as setups they would have no common reference
    labels = {dof for part in parts for dof in part.output_dofs}
    single = all(part.runs == len(part.output_dofs) == 1 and part.inputs is None for part in parts)
    if single and len(labels) == len(parts) and not options:
        return _side_by_side(parts)
    first = parts[0]
    _check_same(parts, "sampling_rate", "Decimate the faster records.")
    if all(p.output_dofs == first.output_dofs for p in parts):
        alike = all(p.input_dofs == first.input_dofs for p in parts)
        if alike and options:
            have = "records of the same channels are stacked as runs, without an estimate"
            change = "Give it to estimate_frf or estimate_correlation of the result."
            raise DataError(f"{next(iter(options))}:", have, change)
        if alike and len({p.samples for p in parts}) == 1:
            return _runs(parts)
        if not options:
            return Records(runs=tuple(parts))
        parts = list(Records(runs=tuple(parts)).stacked())
    measured = [part.inputs is not None for part in parts]
    if all(measured):
        response, driven = joined_frf(parts, **options), None if options else driven_band(parts)
        return response if driven is None else replace(response, excited=driven[0])
    if any(measured):
        change = "Merge those with inputs and those without separately."
        raise DataError(
            "either all records of a test need inputs, or none", "some have inputs and others do not", change
        )
    setups = Setups(parts=tuple(parts))
    return merge_setups(correlations(setups, **options)) if options else setups


def _side_by_side(parts: Sequence[Signals]) -> Signals:
    """Merge channels that were stored a file each into one record: at the lowest rate, over the samples that all have.

    Channels in units of a force are inputs.
    """
    slowest = min(part.sampling_rate for part in parts)
    ratios = [part.sampling_rate / slowest for part in parts]
    factors = [round(ratio) for ratio in ratios]
    if any(abs(ratio - factor) > 1e-6 * factor for ratio, factor in zip(ratios, factors, strict=True)):
        _check_same(parts, "sampling_rate", "Resample them to one: --resample HZ.")
    channels = [_slower(part.by_run()[0][0, :, 0], factor) for part, factor in zip(parts, factors, strict=True)]
    count = min(map(len, channels))
    values = np.stack([channel[:count] for channel in channels], axis=1)
    units = [in_si(part.units[0][0]) for part in parts]
    forces = np.array([unit is not None and unit.kind == "force" for unit in units])
    if forces.all():
        forces[:] = False
    processing = [f"merged from {len(parts)} records of one channel, assumed to begin at the same time"]
    if max(factors) > 1:
        processing.append(f"channels of higher rates decimated to {slowest:g} Hz")
    if len({len(channel) for channel in channels}) > 1:
        processing.append(f"all cut to the {count} samples of the shortest")
    outputs, inputs = ([*itertools.compress(parts, which)] for which in (~forces, forces))
    return Signals(
        outputs=values[:, ~forces],
        inputs=values[:, forces] if inputs else None,
        sampling_rate=slowest,
        quantities=tuple(part.quantities[0] for part in outputs),
        output_dofs=tuple(part.output_dofs[0] for part in outputs),
        input_dofs=tuple(part.output_dofs[0] for part in inputs),
        units=(tuple(part.units[0][0] for part in outputs), tuple(part.units[0][0] for part in inputs)),
        geometry=next((part.geometry for part in parts if part.geometry is not None), None),
        source_path=source_of(parts),
        processing=tuple(processing),
    )


def _slower(x: RealArray, factor: int) -> RealArray:
    """Return one sample in `factor` of a channel, without delay and with the gain of channels that keep their rate.

    The low-pass has a ripple of 1e-4 (Kaiser window, beta 8): the ripple of recursive ones, 1 %, would be one of shapes.
    """
    from scipy.signal import resample_poly

    return x if factor == 1 else np.asarray(resample_poly(x, 1, factor, window=("kaiser", 8.0), padtype="line"))


def _runs(parts: list[Signals]) -> Signals:
    """Stack records of the same channels and length as runs."""
    _check_same(parts, "quantities", "Convert the records to one.")
    _check_same(parts, "units", "Convert the records to one.")
    records = [part.by_run() for part in parts]
    inputs = [u for _, u in records if u is not None]
    return replace(
        parts[0],
        outputs=np.concatenate([y for y, _ in records]),
        inputs=np.concatenate(inputs) if inputs else None,
        groups=Records(runs=tuple(parts)).groups,
        source_path=source_of(parts),
    ).processed(f"merged from {len(parts)} records, {sum(part.runs for part in parts)} runs in all")
