"""Read NetCDF data sets of modes, and of what was measured beside them, as other programs write them (netCDF 4, which is HDF5)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data.shown import figures
from modalscope.io.contents import damage_as_error, unreadable
from modalscope.io.hdf5 import check_hdf5
from modalscope.io.limits import room
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError, optional_package

#: Names that programs give what a history holds.
_NAMES = {
    "time": ("time", "times", "t"),
    "frequencies": ("frequencies", "frequency", "natural_frequencies", "natural_frequency", "fn", "f"),
    "damping_ratios": ("damping", "damping_ratios", "damping_ratio", "zeta", "xi"),
    "frequencies_std": ("std_frequencies", "frequencies_std", "std_frequency", "frequency_std", "fn_std"),
    "damping_ratios_std": ("std_damping", "damping_std", "damping_ratios_std", "std_damping_ratios", "xi_std"),
    "shapes": ("modeshapes", "mode_shapes", "shapes", "phi"),
    "channels": ("channels", "channel", "sensors", "outputs", "dof"),
}

#: Names with one number per mode.
_PER_MODE = ("frequencies", "damping_ratios", "frequencies_std", "damping_ratios_std")

#: Seconds of the units of time.
_SECONDS = {"millisecond": 1e-3, "second": 1.0, "minute": 60.0, "hour": 3600.0, "day": 86400.0}

#: A median above this is taken for per cent: at 20 % of critical damping a structure shows no resonances.
_MAX_MEDIAN_RATIO = 0.2


def history_in(place: Path, damping: str) -> dict[str, Any]:
    """Return the modes of a NetCDF file as the fields of a `History`."""
    found = _variables(place)
    values = {name: _named(found, names) for name, names in _NAMES.items()}
    times, f = values["time"], values["frequencies"]
    if times is None or f is None or f.values.ndim != 2 or times.values.ndim != 1:
        fault = f"it has no time, or no frequencies of (time, mode); there are {', '.join(sorted(found)[:12])}"
        raise unreadable(f"{place.name} as modes of many records", fault, "Name the variables time and frequencies.")
    first = f.axes.index(times.axes[0]) if times.axes[0] in f.axes else 0
    grid = {name: np.moveaxis(v.values, first, 0) for name in _PER_MODE if (v := values[name]) is not None}
    if any(a.shape != grid["frequencies"].shape for a in grid.values()):
        raise unreadable(f"{place.name} as modes", "deviations or damping have other sizes than frequencies")
    record, mode = np.nonzero(np.isfinite(grid["frequencies"]) & (grid["frequencies"] > 0))
    rows: dict[str, Any] = {name: np.asarray(array[record, mode], float) for name, array in grid.items()}
    notes = _as_ratios(rows, values["damping_ratios"], damping, place.name)
    shapes, channels = values["shapes"], values["channels"]
    if shapes is not None:
        rows["shapes"] = _shapes(shapes, f, times, place.name)[record, mode]
        if channels is not None and channels.values.shape == rows["shapes"].shape[1:]:
            rows["output_dofs"] = tuple(map(_text, channels.values))
    when = _times(times, place.name)
    order = np.argsort(when, kind="stable")
    rank = np.argsort(order)[record]
    by_time = np.argsort(rank, kind="stable")
    rows = {name: a[by_time] if isinstance(a, np.ndarray) else a for name, a in rows.items()}
    return {"times": when[order], "record": rank[by_time], "notes": notes, **rows}


def weather_in(path: Path, statistic: str) -> tuple[Array, dict[str, RealArray]]:
    """Return times and the values of every channel of one statistic, or of every variable along time, of a NetCDF file."""
    found = _variables(path)
    times, channels = _named(found, _NAMES["time"]), _named(found, _NAMES["channels"])
    if times is None or times.values.ndim != 1:
        raise unreadable(f"{path.name} as covariates", "it has no time", "Name the variable time.")
    grid = found.get(statistic)
    count = times.values.size
    if grid is not None and channels is not None and grid.values.shape == (count, channels.values.size):
        columns = {_text(c): grid.values[:, k] for k, c in enumerate(channels.values)}
    else:
        columns = {n: v.values for n, v in found.items() if v is not times and v.values.shape == (count,)}
    numbers = {name: np.asarray(column, float) for name, column in columns.items() if column.dtype.kind in "iuf"}
    if not numbers:
        fault = f"it has no variable {statistic} of (time, channels), and no other variable over time"
        raise unreadable(f"{path.name} as covariates", fault, f"There are {', '.join(sorted(found)[:12])}.")
    return _times(times, path.name), numbers


class _Variable:
    """Values, the names of the axes, and the unit of a variable."""

    def __init__(self, item: Any) -> None:
        self.values: Array = np.asarray(item[()])
        self.axes = [axis[0].name if len(axis) else f"{item.name} {k}" for k, axis in enumerate(item.dims)]
        if item.is_scale:
            self.axes = [item.name]
        self.unit = _text(item.attrs.get("units", ""))


def _variables(path: Path) -> dict[str, _Variable]:
    """Return the variables of the root of a file, which is walked through first: what it states may be anything."""
    h5py = optional_package(f"reading {path.suffix}", "h5py", "hdf5")
    if not path.is_file():
        raise unreadable(repr(str(path)), "there is no such file", "Check the name and the folder.")
    space = room(path.name, path.stat().st_size)
    check_hdf5(path, space)
    with damage_as_error(f"{path.name} as NetCDF", "Write it again as netCDF 4."), h5py.File(path, "r") as file:
        items = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset) and item.shape}
        for name, item in items.items():
            space.array(name, item.dtype, item.size or 0)
        return {name: _Variable(item) for name, item in items.items()}


def _named(found: Mapping[str, _Variable], names: tuple[str, ...]) -> _Variable | None:
    lower = {name.lower(): variable for name, variable in found.items()}
    return next((lower[name] for name in names if name in lower), None)


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _times(times: _Variable, name: str) -> Array:
    """Return the times of a file, `hours since 2026-06-01T00:00` and the like, as datetime64[ms]."""
    form = re.fullmatch(r"\s*([A-Za-z]+?)s?\s+since\s+(.+?)\s*(?:Z|\+00:?00|UTC)?\s*", times.unit)
    asked = f"the times of {name}:"
    remedy = 'Give time the unit "hours since 2026-06-01T00:00:00", in UTC.'
    if form is None or form[1].lower() not in _SECONDS or times.values.dtype.kind not in "iuf":
        raise DataError(asked, f"their unit is {times.unit!r}", remedy)
    try:
        start = np.datetime64(form[2].replace(" ", "T", 1), "ms")
    except ValueError:
        raise DataError(asked, f"they count from {form[2]!r}", remedy) from None
    milliseconds = 1000 * _SECONDS[form[1].lower()] * times.values.astype(float)
    if not np.isfinite(milliseconds).all() or np.abs(milliseconds).max(initial=0) > 1e15:
        raise DataError(asked, "some are no times", remedy)
    return np.asarray(start + milliseconds.round().astype("timedelta64[ms]"))


def _as_ratios(rows: dict[str, Any], damping: _Variable | None, unit: str, name: str) -> tuple[str, ...]:
    """Turn damping in per cent into ratios, and say so where the file does not state it."""
    if damping is None:
        return ()
    stated = damping.unit.strip().lower() in ("%", "percent", "per cent")
    middle = float(np.nanmedian(rows["damping_ratios"])) if np.isfinite(rows["damping_ratios"]).any() else 0.0
    guessed = unit == "auto" and not stated and middle > _MAX_MEDIAN_RATIO
    if unit == "percent" or (unit == "auto" and stated) or guessed:
        for field in ("damping_ratios", "damping_ratios_std"):
            if field in rows:
                rows[field] = rows[field] / 100
    return (f"damping in {name} is taken for per cent: its median is {figures(middle, 2)}",) if guessed else ()


def _shapes(shapes: _Variable, f: _Variable, times: _Variable, name: str) -> Array:
    """Return shapes as (time, mode, channel); what is nothing at all is not known."""
    if shapes.values.ndim != 3 or shapes.values.dtype.kind not in "fc":
        raise unreadable(f"{name} as modes", "its shapes are not of (time, mode, channel)")
    mode = next((axis for axis in f.axes if axis != times.axes[0]), "")
    order = [shapes.axes.index(axis) for axis in (times.axes[0], mode) if axis in shapes.axes]
    order = order if len(order) == 2 else [0, 1]
    array = np.transpose(shapes.values, [*order, 3 - sum(order)]).astype(complex)
    if array.shape[:2] != (times.values.size, max(f.values.size // max(times.values.size, 1), 0)):
        raise unreadable(f"{name} as modes", f"its shapes {array.shape} do not match its frequencies")
    return np.where((array == 0).all(axis=2, keepdims=True) | ~np.isfinite(array), np.nan, array)
