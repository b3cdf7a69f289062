"""Data out of the objects of pandas and xarray."""

from __future__ import annotations

from typing import Any

from modalscope.io.columns import contents_from_table
from modalscope.io.contents import Thing
from modalscope.io.frames import is_frame, table_of_frame
from modalscope.io.overrides import overridden
from modalscope.model import DataError
from modalscope.model.entries import plainly

__all__ = ["from_frame"]


@plainly
def from_frame(frame: Any, **options: Any) -> Thing:
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
        raise DataError(
            "data out of a DataFrame, Series, Dataset or DataArray were asked",
            f"it is {type(frame).__name__}",
            "Give such an object, a path to read, or make FrequencyResponse or Signals of arrays.",
        )
    contents = contents_from_table(table_of_frame(frame, type(frame).__name__), options)
    return overridden(contents.thing, options, None)
