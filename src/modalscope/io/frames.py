"""Read pandas and xarray objects as tables, without importing either package."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

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

#: Name -> dimensions, values and unit.
Variables: TypeAlias = dict[str, tuple[Sequence[str], Array, str]]


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
    if kind not in ("Dataset", "DataArray"):
        return _table(where, _of_frame(frame), frame.attrs)

    def of(names: Iterable[Any]) -> Variables:
        return {str(n): (frame[n].dims, np.asarray(frame[n]), str(frame[n].attrs.get("units", ""))) for n in names}

    return table_of_variables(where, of(frame.data_vars), of(frame.coords), frame.attrs)


def _table(where: str, columns: Sequence[Column], stated: Mapping[Any, Any]) -> Table:
    """Return the table of columns, of which the first may be dates and times, and of what attributes state."""
    if not columns:
        raise unreadable(where, "it has no columns of numbers", "Give measured values as columns.")
    numbers = {name: value for name, value in stated.items() if isinstance(value, int | float | np.number)}
    rate = next((float(value) for name, value in numbers.items() if key_meaning(str(name)) == "rate"), None)
    roles = {1: "time"} if columns[0].stamps else {}
    return Table(where=where, columns=tuple(columns), rate=rate, rate_from="its attributes", roles=roles)


def _of_frame(frame: Any) -> list[Column]:
    """Return the columns of a DataFrame, the index first where it is more than a count."""
    units = frame.attrs.get("units")
    units = units if isinstance(units, Mapping) else {}
    columns: list[Column] = []
    index = np.asarray(frame.index)
    if type(frame.index).__name__ != "RangeIndex" and index.dtype.kind in "fiumM":
        columns.append(_column(1, frame.index.name, "", index))
    for label in frame.columns:
        name = " ".join(map(str, label)) if isinstance(label, tuple) else str(label)
        values = np.asarray(frame[label])
        columns.append(_column(len(columns) + 1, name, str(units.get(label, "")), values))
    return columns


def table_of_variables(where: str, variables: Variables, coords: Variables, stated: Mapping[Any, Any]) -> Table:
    """Return variables along their common dimension as a table, those of further dimensions column by column.

    `coords`: those that give dimensions their values. `stated`: numbers of the whole, such as a rate.

    Raises `DataError`: no dimension that all have, or another number of its values.
    """
    sizes = {dim: n for dims, values, _ in variables.values() for dim, n in zip(dims, values.shape, strict=True)}
    shared = [dim for dim in sizes if all(dim in dims for dims, _, _ in variables.values())]
    roles_of_dims = {dim: role_by_words(*split_head(dim)) for dim in shared}
    axis = next((dim for dim, role in roles_of_dims.items() if role in ("time", "frequency")), None)
    axis = axis or max(shared, key=sizes.__getitem__, default=None)
    if axis is None:
        fault = f"its variables ({', '.join(list(variables)[:6])}) have no dimension in common"
        raise unreadable(where, fault, "Give the variables of one axis.")
    own = coords.get(axis)
    if own is not None and own[1].shape != (sizes[axis],):
        raise unreadable(where, f"{axis!r} has {own[1].size} values for {sizes[axis]} of the others", "Write it anew.")
    columns = [] if own is None else [_column(1, axis, own[2], own[1])]
    for name, (dims, values, unit) in variables.items():
        flat = np.moveaxis(values, dims.index(axis), 0).reshape(sizes[axis], -1)
        further = [dim for dim in dims if dim != axis]
        known = len(further) == 1 and further[0] in coords
        places = coords[further[0]][1] if known else range(1, flat.shape[1] + 1)
        labels = [f"{name} {place}" for place in places] if further else [name]
        for label, column in zip(labels, flat.T, strict=True):
            columns.append(_column(len(columns) + 1, label, unit, column))
    return _table(where, columns, stated)


def _column(number: int, name: Any, unit: str, values: Array) -> Column:
    """Return a column; dates and durations become seconds from the first."""
    bare, unit_of_name = split_head("" if name is None else str(name))
    if values.dtype.kind in "mM":
        values, named = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9, bare or "time"
        return Column(number=number, name=named, unit="s", values=values, stamps=True)
    if values.dtype.kind in "OUS":
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
