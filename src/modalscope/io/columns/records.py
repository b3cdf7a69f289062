"""Build records from columns: forces are inputs; the rate is checked between times, header and option."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data import DataError, ImpulseResponse, Signals
from modalscope.data.channels import names_base
from modalscope.data.shown import figures
from modalscope.io.columns.axis import (
    CLOCK_ACCURACY,
    Sampling,
    even_sampling,
    longest_even,
    parts_of_second,
    records_of,
    rises,
    same_rate,
    sampling_of,
)
from modalscope.io.columns.clock import evened
from modalscope.io.columns.table import Column, Table, as_word, span
from modalscope.io.columns.weights import likeliest_force
from modalscope.io.columns.words import factor_to_base, ignored_columns, kind_of_unit, labels_of
from modalscope.io.contents import Options, needs, unreadable
from modalscope.numerics.checks import RealArray, check_positive
from modalscope.numerics.functions.poles import QUANTITIES

#: Relative uncertainty of a rate by the digits of the times, at most: frequencies have the same.
_MAX_DOUBT_OF_RATE = 1e-3
#: Relative doubt of a rate that is told.
_DOUBT_TOLD = 1e-4
#: Samples of a record, at least; and rows of a column that is an axis where it rises throughout: of noise half the steps do.
_MIN_SAMPLES, _MIN_RISING, _MIN_SHARE_RISING = 3, 16, 0.95
#: A force has gone where this part of its largest is not reached again.
_GONE = 0.05
_PARTS_OF_SECOND = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}


def records(
    table: Table, axis: Column | None, columns: Sequence[Column], roles: Mapping[int, str], options: Options
) -> tuple[Signals, list[str], dict[int, str]]:
    """Return records, notes, and the reasons of columns that are left out.

    `axis`: the times. `columns`: all others that may be taken. `options`: `sampling_rate`.

    Raises `DataError`: more channels than samples, complex values, times that are not even or of another rate, no rate at all.
    """
    twice = {c.number: "a second column of times" for c in columns if roles[c.number] == "time"}
    channels = [column for column in columns if column.number not in twice]
    if not channels:
        raise nothing_measured(table, axis, "time", options)
    wrong = [column for column in channels if np.iscomplexobj(column.values)]
    if wrong:
        fault = f"{wrong[0]} is complex, and no column is of frequencies"
        rising = [c.number for c in table.columns if c not in wrong and not c.textual and rises(c.values)]
        remedy = f'Say which it is: --columns "frequency={rising[0]}"' if rising else "Export them in a column with it."
        raise needs(table.where, "frequencies of the complex values", fault, remedy)
    spectra = [column for column in channels if roles[column.number] == "spectrum"]
    if spectra and options.get("columns") is None:
        in_decibels = " in dB" if np.min(spectra[0].values) < 0 else ""  # powers and magnitudes are never negative
        fault = f"{spectra[0]} is by its name a spectrum{in_decibels}: the phase between signals is gone"
        waveform = "the waveform that it was computed from, or frequency responses with real and imaginary parts"
        remedy = f'Save {waveform}; if it is a record: --columns "out={spectra[0].number}"'
        raise unreadable(f"{table.where} as a record", fault, remedy)
    refuse_transposed(table.where, table.rows, len(channels), bool(options.get("transpose")))
    evenly: list[str] = []
    if axis is not None:
        axis, unit_notes = _with_seconds(table, axis, options)
        axis, channels, evenly = evened(table.where, axis, seconds_of(axis), channels, options.get("resample"))
        evenly = [*unit_notes, *evenly]
    rate, notes = sampling_rate(table, axis, options)
    notes = [*evenly, *notes]
    _refuse_few(table)
    if axis and options.get("columns") is None:
        _refuse_two_clocks(table, axis, [column for column in columns if column.number in twice])
    forces = [column for column in channels if roles[column.number] == "in"]
    others = [column for column in channels if roles[column.number] != "in"]
    if not others:
        forces, others = [], channels
        notes.append("all columns are forces; they were taken as outputs")
    elif not forces and len(others) > 1 and options.get("columns") is None and not table.roles:
        base = [column for column in others if names_base(column.name)]
        which = f"{base[0].name} may be a base that drives the rest" if base else "else"
        number = (base[0] if base else likeliest_force(others)[0]).number
        notes.append(f'no column is a force by name or unit: all are outputs ({which}: --columns "in={number}")')
    thing = Signals(
        outputs=_stacked(others),
        inputs=_stacked(forces) if forces else None,
        sampling_rate=rate,
        quantities=tuple(k if (k := kind_of_unit(c.unit)) in QUANTITIES else table.quantity for c in others),
        output_dofs=tuple(_labels(others, channels, notes)),
        input_dofs=tuple(_labels(forces, channels, notes)),
        units=(tuple(column.unit for column in others), tuple(column.unit for column in forces)),
    )
    return thing, notes, twice


def _refuse_few(table: Table) -> None:
    if table.rows < _MIN_SAMPLES:
        fault = f"{'one sample is' if table.rows == 1 else f'{table.rows} samples are'} too few for any motion"
        raise needs(table.where, f"{_MIN_SAMPLES} samples", fault, "Export the whole record.")


def nothing_measured(table: Table, axis: Column | None, kind: str, options: Options) -> DataError:
    """Return the error of a table of which no column is left but the axis; the example names columns that may be measured after all.

    `kind`: of the axis, "time" or "frequency".
    """
    ignored = {column.number for column in ignored_columns(table.columns, options.get("ignore"))}
    excluded = ignored | ({axis.number} if axis is not None else set())
    others = [column.number for column in table.columns if not column.textual and column.number not in excluded]
    change = "Export the measured channels, too."
    if others and kind == "frequency":
        change = "Export real and imaginary parts with the frequencies."
    elif others:
        time, rate = (f"time={axis.number},", "") if axis is not None else ("", " --sampling-rate HZ")
        change = f'If they are measured, say so: --columns "{time}out={span(others)}"{rate}'
    elif ignored:
        change = "Leave fewer columns out with --ignore."
    fault = f"its columns are {', '.join(map(str, table.columns[:6])) or '(none)'}"
    return needs(table.where, "a column of measured values", fault, change)


def free_decay(record: Signals, where: str, option: str) -> ImpulseResponse:
    """Return records without forces as one free decay of all channels, from the first row on.

    `where`: the table, for messages. `option`: what `--columns` says of it without the forces.
    """
    if record.inputs is not None:
        fault = f"{', '.join(record.input_dofs)} would be a force, which acts on no free decay"
        size = np.abs(record.inputs).max(axis=1)
        row = int(np.flatnonzero(np.append(True, size > _GONE * size.max()))[-1]) + 1  # rows count from 1
        remedy = f'Take rows after it has gone, and leave it out: --rows {row}- --columns "{option}"'
        raise unreadable(f"{where} as a free decay", fault, remedy)
    return ImpulseResponse(
        values=record.outputs[:, :, None],
        sampling_rate=record.sampling_rate,
        kind="free decay",
        quantity=record.quantity,
        output_dofs=record.output_dofs,
        input_dofs=("start",),
        units=(record.units[0], ("",)),
    )


def _stacked(columns: Sequence[Column]) -> Any:
    return np.stack([column.values for column in columns], axis=1).astype(float)


def _labels(columns: Sequence[Column], channels: Sequence[Column], notes: list[str]) -> list[str]:
    """Return a label for each of the columns among all channels; names that repeat get their place behind them."""
    labels = labels_of([column.label.removeprefix("out ").removeprefix("in ") for column in channels])
    by_number = {column.number: label for column, label in zip(channels, labels, strict=True)}
    bare = [by_number[column.number] for column in columns]
    twice = {label for label in bare if bare.count(label) > 1}
    if twice:
        notes.append(f"names that repeat have the number of their column behind them: {', '.join(sorted(twice)[:6])}")
    return [f"{label} ({c.number})" if label in twice else label for label, c in zip(bare, columns, strict=True)]


def _refuse_two_clocks(table: Table, axis: Column, others: Sequence[Column]) -> None:
    """Raise where another column of times is as even as the first and gives another rate."""
    first = sampling_of(seconds_of(axis))
    for other in others:
        sampling = even_sampling(seconds_of(other))
        if sampling and not same_rate(first.rate, sampling.rate, first.doubt + sampling.doubt):
            fault = f"the times of {axis} say {first.rate:.6g} Hz, those of {other} {sampling.rate:.6g} Hz"
            remedy = f"Leave out which is wrong: --ignore {as_word(axis.label)}, or --ignore {as_word(other.label)}"
            raise needs(table.where, "one column of times", fault, remedy)


def refuse_transposed(where: str, samples: int, channels: int, transposed: bool) -> None:
    """Raise where there are more channels than samples: rows and columns were exchanged.

    `transposed`: whether `--transpose` was given already.
    """
    if channels > samples:
        fault = f"it has {channels} channels of {samples} samples, which is more channels than samples"
        remedy = "If every row is a channel, exchange rows and columns: --transpose"
        if transposed:
            remedy = "Leave --transpose out: channels stand in columns."
        raise unreadable(f"{where} as records", fault, remedy)


def seconds_of(axis: Column) -> RealArray:
    """Return times in seconds, of a column in its unit; without one, counted from the first in the parts of a second that they say."""
    times = np.asarray(axis.values, float)
    parts = 1.0 if axis.unit else parts_of_second(times)
    return times * factor_to_base(axis.unit) if parts == 1.0 else _from_first(times, parts)


def begin_of(axis: Column) -> float:
    """Return the first time of a column in seconds, by the clock of its recorder."""
    first = np.asarray(axis.values[:1], float)
    return float(first[0] * factor_to_base(axis.unit) if axis.unit else first[0] / parts_of_second(axis.values))


def _from_first(times: RealArray, parts: float) -> RealArray:
    """Return seconds from the first of times in parts of a second, with the digits that numbers of their size hold."""
    spacing = float(np.spacing(np.abs(times).max(initial=0.0))) / parts
    return np.round((times - times[:1]) / parts, max(0, int(-np.log10(spacing)))) if spacing > 0 else times


def _with_seconds(table: Table, axis: Column, options: Options) -> tuple[Column, list[str]]:
    """Return times without a unit in seconds from the first where they count parts of a second, and a note."""
    times = np.asarray(axis.values, float)
    given = options.get("sampling_rate")
    rate = table.rate if given is None else check_positive("sampling_rate", given)
    parts = 1.0 if axis.unit else parts_of_second(times, rate)
    if parts == 1.0:
        return axis, []
    why = " since 1970"
    if parts != parts_of_second(times[:1]):
        why = f' by their step of {float(np.median(np.diff(times))):.6g} (else: --units "{axis.label}=s")'
    note = f"the times of column {axis.number} have no unit: taken as {_PARTS_OF_SECOND[parts]}{why}"
    return replace(axis, values=_from_first(times, parts), unit="s"), [note]


def _no_rate(first: Column, remedy: str) -> tuple[str, str]:
    """Return fault and remedy of a table without times: a rate, but not where its first column rises as lines of a spectrum do."""
    long = not first.textual and len(first.values) >= _MIN_RISING
    steps = np.diff(first.values.astype(float)) if long else np.zeros(1)
    if np.mean(steps >= 0) <= _MIN_SHARE_RISING or np.ptp(steps) <= 0.5 * steps.mean():
        return "no column is of times, and no header says a rate", remedy
    rise = f"{first} rises, by {steps.min():.6g} to {steps.max():.6g}"
    return (
        f"{rise}: no even times, and lines of a spectrum hold no phases",
        "Export times with all digits, or responses with real and imaginary parts",
    )


def _is_rounding(stated: float, sampling: Sampling) -> bool:
    """Whether times may be those of a stated rate: their digits leave it open, or their step is a rounded one; else they are a clock's."""
    step, other = 1 / sampling.rate, 1 / stated
    close = abs(sampling.rate - stated) <= sampling.doubt + CLOCK_ACCURACY * stated
    return close or any(abs(round(other, digits) - step) < CLOCK_ACCURACY * step for digits in range(1, 9))


def sampling_rate(table: Table, axis: Column | None, options: Options) -> tuple[float, list[str]]:
    """Return samples per second, and how they are known.

    An option goes before the header, the header before the times; each is held against the times.

    Raises `DataError`: times that are not even, or of another rate than the option or the header says; nothing that says a rate.
    """
    given = options.get("sampling_rate")
    option = None if given is None else check_positive("sampling_rate", given)
    stated, source = (table.rate, table.rate_from) if option is None else (option, "the option")
    remedy = "Give it in samples per second: --sampling-rate HZ"
    if axis is None:
        if stated is None:
            fault, remedy = _no_rate(table.columns[0], remedy)
            raise needs(table.where, "a sampling rate", fault, remedy)
        return stated, [] if given is not None else [f"sampling rate {stated:g} Hz by {source}"]
    times = seconds_of(axis)
    way_out = f"--ignore {as_word(axis.label)} --sampling-rate"
    try:
        sampling = sampling_of(times)
    except DataError as error:
        even, several = longest_even(times), records_of(times)
        above = table.first_row - 1
        if several:
            fault = f"the times of {axis} begin anew in row {above + several[1][0]}: {len(several)} records follow each other"
            ways = [f"--rows {above + first}-{above + last}" for first, last in several[:3]]
            raise needs(table.where, "one record", fault, f"Take one: {', or '.join(ways)}") from None
        rows = "" if even is None else f", or --rows {above + even[0]}-{above + even[1]}, the longest even stretch"
        clock = "or leave its clock out where that alone is uneven, not the samples"
        remedy = f"Resample the record, {clock}: --resample auto, or {way_out} HZ{rows}"
        raise needs(table.where, f"evenly sampled times in {axis}", error.found, remedy) from None
    if stated is None and sampling.doubt > _MAX_DOUBT_OF_RATE * sampling.rate:
        rate = f"{sampling.rate:.6g} Hz, give or take {figures(sampling.doubt, 2)}"
        remedy = remedy.replace("HZ", f"{sampling.rate:.6g}, if that is the one")
        raise needs(table.where, "a sampling rate", f"the times in {axis} have too few digits: {rate}", remedy)
    if stated is not None and not same_rate(stated, sampling.rate, sampling.doubt):
        asked = f"reading {table.where} at {stated:g} Hz, as {source} says:"
        remedy = f"Say what is right: --sampling-rate {sampling.rate:.6g}, or {way_out} {stated:g}"
        if given is not None:
            remedy = f"If the times are wrong, leave them out: {way_out} {stated:g}"
        raise DataError(asked, f"the times of {axis} say {sampling.rate:.6g} Hz", remedy)
    kept = stated is not None and (option is not None or _is_rounding(stated, sampling))
    rate_taken = stated if stated is not None and kept else sampling.rate
    open_still = f", the roundest of what their digits leave (±{figures(sampling.doubt, 2)} Hz)"
    coarse = open_still if stated is None and sampling.doubt > _DOUBT_TOLD * sampling.rate else ""
    return rate_taken, [f"sampling rate {rate_taken:.9g} Hz by the times of column {axis.number}{coarse}"]
