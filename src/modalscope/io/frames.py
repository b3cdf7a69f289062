"""Read pandas and xarray objects as tables, without importing either package."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from modalscope.data import DataError
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.columns.vocabulary import key_meaning
from modalscope.io.columns.weights import role_by_words
from modalscope.io.columns.words import bare_unit, split_head
from modalscope.io.contents import DataObject, is_frame, unreadable
from modalscope.io.formats import check_options, overridden
from modalscope.io.options import COLUMNS, FIELDS
from modalscope.numerics.arguments import plainly
from modalscope.numerics.checks import Array


def table_of_frame(frame: Any, where: str) -> Table:
    """Return a DataFrame, Series, Dataset or DataArray as a table.

    Units stand in `attrs["units"]` of the column (xarray) or of the frame, there as a mapping of name to unit (pandas), or in the names.
    The index, or the one dimension that all variables have, is the axis.

    `where`: what it is called in messages.

    Raises `DataError`: no numbers in it.
    """
    kind = type(frame).__name__
    if kind == "Series":
        frame = frame.to_frame(frame.name if frame.name is not None else "y1")
    if kind == "DataArray":
        frame = frame.to_dataset(name=frame.name or "values")
    columns, roles = _of_dataset(frame, where) if kind in ("Dataset", "DataArray") else _of_frame(frame)
    if not columns:
        raise unreadable(where, "it has no columns of numbers", "Give measured values as columns.")
    stated = {name: value for name, value in frame.attrs.items() if isinstance(value, int | float | np.number)}
    rates = [float(value) for name, value in stated.items() if key_meaning(str(name)) == "rate"]
    return Table(
        where=where, columns=tuple(columns), rate=rates[0] if rates else None, rate_from="its attributes", roles=roles
    )


def _of_frame(frame: Any) -> tuple[list[Column], dict[int, str]]:
    """Return the columns of a DataFrame, the index first where it is more than a count."""
    units = frame.attrs.get("units")
    units = units if isinstance(units, Mapping) else {}
    columns: list[Column] = []
    roles: dict[int, str] = {}
    index = np.asarray(frame.index)
    if type(frame.index).__name__ != "RangeIndex" and index.dtype.kind in "fiumM":
        columns.append(_column(1, frame.index.name, "", index))
        if columns[0].stamps:
            roles[1] = "time"
    for label in frame.columns:
        name = " ".join(map(str, label)) if isinstance(label, tuple) else str(label)
        values = np.asarray(frame[label])
        columns.append(_column(len(columns) + 1, name, str(units.get(label, "")), values))
    return columns, roles


def _of_dataset(data: Any, where: str) -> tuple[list[Column], dict[int, str]]:
    """Return the variables of a Dataset along their common dimension, those of further dimensions column by column."""
    shared = [str(dim) for dim in data.sizes if all(dim in data[name].dims for name in data.data_vars)]
    roles_of_dims = {dim: role_by_words(*split_head(dim)) for dim in shared}
    axis = next((dim for dim, role in roles_of_dims.items() if role in ("time", "frequency")), None)
    axis = axis or max(shared, key=lambda dim: data.sizes[dim], default=None)
    if axis is None:
        fault = f"its variables ({', '.join(map(str, list(data.data_vars)[:6]))}) have no dimension in common"
        raise unreadable(where, fault, "Give the variables of one axis.")
    columns: list[Column] = []
    roles: dict[int, str] = {}
    if axis in data.coords:
        columns.append(_column(1, axis, str(data[axis].attrs.get("units", "")), np.asarray(data[axis])))
        if columns[0].stamps:
            roles[1] = "time"
    for name in data.data_vars:
        variable = data[name].transpose(axis, ...)
        values = np.asarray(variable)
        unit = str(variable.attrs.get("units", ""))
        flat = values.reshape(values.shape[0], -1)
        for k, label in enumerate(_labels(variable, str(name), flat.shape[1])):
            columns.append(_column(len(columns) + 1, label, unit, flat[:, k]))
    return columns, roles


def _labels(variable: Any, name: str, count: int) -> Iterable[str]:
    """Return a name for each column of a variable: by the coordinates of its further dimensions where there are such."""
    if count == 1 and variable.ndim == 1:
        return [name]
    if variable.ndim == 2 and variable.dims[1] in variable.coords:
        return [f"{name} {value}" for value in np.asarray(variable[variable.dims[1]])]
    return [f"{name} {k + 1}" for k in range(count)]


def _column(number: int, name: Any, unit: str, values: Array) -> Column:
    """Return a column; dates and durations become seconds from the first."""
    bare, unit_of_name = split_head("" if name is None else str(name))
    if values.dtype.kind in "mM":
        seconds = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9
        return Column(number=number, name=bare or "time", unit="s", values=seconds, stamps=True)
    if values.dtype.kind == "O":
        try:
            values = values.astype(float)
        except (TypeError, ValueError):
            values = np.array([""])
    return Column(number=number, name=bare, unit=bare_unit(unit or unit_of_name), values=values)


@plainly
def from_frame(frame: Any, **options: Any) -> DataObject:
    """Return the data that a pandas DataFrame or Series, or an xarray Dataset or DataArray, holds.

    Names, units and the rate of the index are kept. Units stand in names (`Force [N]`), in `frame.attrs["units"]` (pandas, a mapping of
    column to unit) or in `attrs["units"]` of each variable (xarray); forces are inputs. `analyze` takes such objects as they are.

    Parameters
    ----------
    frame : DataFrame, Series, Dataset or DataArray
    **options
        As of `read` for tables: `columns` ("time=1,in=2,out=3-9", where an index that is the axis counts as 1), `ignore`, `units`,
        `sampling_rate`, `quantity`, `output_dofs`, `input_dofs`, `geometry`.

    Returns
    -------
    Signals or FrequencyResponse

    Raises
    ------
    DataError
        Another kind of object, no rate, or what tables are refused for.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> frame = pd.DataFrame(
    ...     {"Force [N]": [0.0, 1.0, 0.0], "AccA [m/s2]": [0.1, 0.2, 0.0]}, index=np.array([0.0, 0.01, 0.02])
    ... )
    >>> record = from_frame(frame)
    >>> record.sampling_rate, record.input_dofs, record.units
    (100.0, ('Force',), (('m/s2',), ('N',)))
    """
    if not is_frame(frame):
        fault = f"it is {type(frame).__name__}"
        remedy = "Give such an object, a path to read, or make FrequencyResponse or Signals of arrays."
        raise DataError("from_frame needs a DataFrame, Series, Dataset or DataArray", fault, remedy)
    check_options(type(frame).__name__, options, (*COLUMNS, *FIELDS, "conjugate"), "reading")
    return overridden(contents_from_table(table_of_frame(frame, type(frame).__name__), options).thing, options, None)
