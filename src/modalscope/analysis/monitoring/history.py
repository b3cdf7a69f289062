"""Hold the modes of many records: one row per mode, with the time of its record and what else was measured then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data import ModalModel
from modalscope.data.shown import Shown, summary_of
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import (
    Array,
    BoolArray,
    ComplexArray,
    IntArray,
    RealArray,
    check_each,
    check_kind,
    check_path,
    check_shape,
    freeze,
    locked,
    real_array,
)
from modalscope.numerics.errors import DataError, optional_package
from modalscope.numerics.functions.poles import poles_from
from modalscope.numerics.plugins import READINGS, added

#: Columns of the table of modes -> fields.
_COLUMNS = {
    "frequency_hz": "frequencies",
    "damping_ratio": "damping_ratios",
    "frequency_std_hz": "frequencies_std",
    "damping_ratio_std": "damping_ratios_std",
}

#: Fields that hold one number per mode.
PER_MODE = tuple(_COLUMNS.values())


def as_times(name: str, values: Any) -> Array:
    """Return times as datetime64[ms], in the order given.

    `values`: datetime64, ISO texts, or seconds since 1970 (UTC).

    Examples
    --------
    >>> as_times("times", [0, 3600])
    array(['1970-01-01T00:00:00.000', '1970-01-01T01:00:00.000'],
          dtype='datetime64[ms]')
    """
    try:
        array = np.asarray(values)
        if array.dtype.kind in "iuf" and np.isfinite(array).all() and (np.abs(array) < 1e12).all():
            return (1000 * array).round().astype("datetime64[ms]")
        if array.dtype.kind in "MUO":
            times = array.astype("datetime64[ms]")
            if not np.isnat(times).any():
                return times
    except (ValueError, TypeError, OverflowError):
        pass
    remedy = f"Give {name} as datetime64, ISO texts or seconds since 1970."
    raise DataError(f"{name} needs times", f"it is {str(values)[:60]}", remedy)


def as_seconds(name: str, value: Any) -> float:
    """Return one time as seconds since 1970."""
    times = np.atleast_1d(as_times(name, value))
    if times.shape != (1,):
        raise DataError(f"{name} needs one time", f"there are {times.size}", f"Give {name} as one datetime64 or text.")
    return float(times[0].astype(np.int64) / 1000)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class History(Shown):
    """The modes of many records, one row per mode, in the order of time.

    Parameters
    ----------
    times : array of datetime64, ISO texts or seconds since 1970 (UTC), (R,)
        When each record began; they do not decrease.
    record : array of int, (n,)
        The record of each mode, counted from zero; they do not decrease.
    frequencies : array, (n,)
        Hz.
    damping_ratios : array, (n,), optional
    frequencies_std, damping_ratios_std : array, (n,), optional
        Stated standard deviations (Hz, ratio); NaN where they are not known.
    shapes : array of complex, (n, l), optional
        NaN where a record has not the channel.
    output_dofs : sequence of str, (l,)
    names : sequence of str, (R,)
        What the records are called.
    covariates : mapping of name to array (R,)
        What else was measured: temperature, wind; NaN where it is not known.
    notes : sequence of str
        What must be told.

    Raises
    ------
    DataError
        Arrays of other sizes, times that decrease, frequencies that are not positive.

    Examples
    --------
    >>> history = History(
    ...     times=["2026-06-01T00:00", "2026-06-01T01:00"], record=[0, 0, 1], frequencies=[1.0, 2.0, 1.01]
    ... )
    >>> history
    <modes of 2 records: 3, from 2026-06-01 00:00 to 2026-06-01 01:00>
    """

    times: Array
    record: IntArray
    frequencies: RealArray
    damping_ratios: RealArray = None  # type: ignore[assignment]
    frequencies_std: RealArray = None  # type: ignore[assignment]
    damping_ratios_std: RealArray = None  # type: ignore[assignment]
    shapes: ComplexArray = None  # type: ignore[assignment]
    output_dofs: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    covariates: Mapping[str, RealArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        times = np.atleast_1d(as_times("times", self.times))
        record = np.asarray(self.record, dtype=None if np.size(self.record) else int)
        n, count = record.size, times.size
        if record.ndim != 1 or record.dtype.kind not in "iu" or (n and not 0 <= record.min() <= record.max() < count):
            raise DataError("record needs the record of each mode", f"there are {count}", "Count them from 0.")
        if np.any(np.diff(record) < 0) or np.any(np.diff(times) < np.timedelta64(0)):
            raise DataError("record and times need the order of time", "they are not in it", "Sort times, and record.")
        unknown = np.full(n, np.nan)
        given = {name: getattr(self, name) for name in PER_MODE}
        rows = {
            name: real_array(name, unknown if values is None else values, "(modes,)", 1, finite=name == "frequencies")
            for name, values in given.items()
        }
        if np.any(rows["frequencies"] <= 0):
            raise DataError("frequencies need positive numbers", "one is not", "Leave such poles out.")
        shapes = np.ones((n, 0), complex) if self.shapes is None else np.asarray(self.shapes)
        if shapes.ndim != 2 or shapes.dtype.kind not in "fc":
            raise DataError("shapes need axes (modes, outputs)", f"they are {shapes.shape}", "Give a row per mode.")
        dofs = tuple(map(str, self.output_dofs)) or tuple(f"y{k + 1}" for k in range(shapes.shape[1]))
        names = tuple(map(str, self.names)) or tuple(f"record {k + 1}" for k in range(count))
        check_kind("covariates", self.covariates, Mapping)
        covariates = {
            str(name): real_array(name, x, "(records,)", 1, finite=False) for name, x in self.covariates.items()
        }
        for name, array, size in (
            *((name, values, (n,)) for name, values in rows.items()),
            *((name, values, (count,)) for name, values in covariates.items()),
            ("shapes", shapes, (n, len(dofs))),
            ("names", np.asarray(names, object), (count,)),
        ):
            check_shape(name, array, "one entry each", size)
        freeze(
            self,
            times=locked(times),
            record=locked(record.astype(np.intp)),
            **rows,
            shapes=locked(shapes.astype(complex)),
            output_dofs=dofs,
            names=names,
            covariates=covariates,
            notes=tuple(map(str, check_each("notes", self.notes, "texts"))),
        )

    def __len__(self) -> int:
        """Return the number of records."""
        return int(self.times.size)

    @property
    def seconds(self) -> RealArray:
        """Times as seconds since 1970, (R,)."""
        return np.asarray(self.times.astype(np.int64) / 1000.0)

    def to_pandas(self) -> Any:
        """Return a DataFrame, one row per mode: time, record, frequency, damping ratio, deviations and covariates.

        Raises
        ------
        DataError
            pandas is missing.
        """
        pandas = optional_package("a table of modes", "pandas", "pandas")
        columns: dict[str, Any] = {"time": self.times[self.record], "record": [self.names[k] for k in self.record]}
        columns |= {column: getattr(self, name) for column, name in _COLUMNS.items()}
        columns |= {name: values[self.record] for name, values in self.covariates.items()}
        return pandas.DataFrame(columns)


@summary_of.register
def _(history: History) -> str:
    if not len(history):
        return "modes of no record"
    first, last = (str(t.astype("datetime64[m]")).replace("T", " ") for t in history.times[[0, -1]])
    return f"modes of {len(history)} records: {history.record.size}, from {first} to {last}"


def part_of(history: History, which: BoolArray) -> History:
    """Return some of the records, (R,), with all channels."""
    own = which[history.record]
    rows = {name: getattr(history, name)[own] for name in (*PER_MODE, "shapes")}
    return History(
        times=history.times[which],
        record=(np.cumsum(which) - 1)[history.record[own]],
        output_dofs=history.output_dofs,
        names=tuple(np.array(history.names, object)[which]),
        covariates={name: x[which] for name, x in history.covariates.items()},
        **rows,
    )


def modes_of(history: History, which: IntArray) -> ModalModel:
    """Return some of the modes as a model."""
    poles = poles_from(history.frequencies[which], np.clip(np.nan_to_num(history.damping_ratios[which]), 0, 0.99))
    return ModalModel(poles=poles, shapes=np.nan_to_num(history.shapes[which]).T, output_dofs=history.output_dofs)


def rows_of(modes: ModalModel) -> dict[str, Any]:
    """Return what a history holds of the modes of one record, by field; `output_dofs` are the columns of `shapes`."""
    kept = modes.take(np.array([kind == "mode" for kind in modes.kinds], bool))
    none = np.full(len(kept), np.nan)
    known = {name: none if (a := getattr(kept, name)) is None else a for name in PER_MODE}
    return {**known, "shapes": kept.shapes.T, "output_dofs": kept.output_dofs}


def assembled(rows: Sequence[Mapping[str, Any]], times: ArrayLike, names: Sequence[str], **more: Any) -> History:
    """Return the history of records given row by row, each with the channels that it has, sorted by time."""
    dofs = tuple(dict.fromkeys(dof for row in rows for dof in row["output_dofs"]))
    place = {dof: k for k, dof in enumerate(dofs)}
    counts = [len(row["frequencies"]) for row in rows]
    shapes = np.full((sum(counts), len(dofs)), np.nan + 0j)
    start = 0
    for row, count in zip(rows, counts, strict=True):
        shapes[start : start + count, [place[dof] for dof in row["output_dofs"]]] = row["shapes"]
        start += count
    joined: dict[str, Any] = {name: np.concatenate([np.zeros(0), *(row[name] for row in rows)]) for name in PER_MODE}
    return History(
        times=as_times("times", times),
        record=np.repeat(np.arange(len(rows)), counts),
        shapes=shapes,
        output_dofs=dofs,
        names=tuple(names),
        **joined,
        **more,
    )


@named(damping=("auto", "ratio", "percent"))
def read_history(path: str | Path, *, damping: str = "auto") -> History:
    """Read the modes of many records from a NetCDF file: frequencies (time, mode), and what else is there.

    Parameters
    ----------
    path : path
        With `frequencies`, or another usual name of them, and `time`; damping, deviations (`std_frequencies`, `std_damping`), shapes
        (`modeshapes`) and `channels` where they are.
    damping : {"auto", "ratio", "percent"}
        The unit of damping; by default what the file states, else what its values are like.

    Returns
    -------
    History

    Raises
    ------
    DataError
        h5py is missing, a damaged file, no frequencies or times in it.
    """
    return History(**added(READINGS, "history")(check_path(path), damping))
