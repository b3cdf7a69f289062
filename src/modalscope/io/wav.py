"""Read sound files (.wav) of data recorders."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path
from threading import Lock

import numpy as np

from modalscope.data import DataError
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.contents import Contents, Options
from modalscope.io.limits import room

WAV_OPTIONS = ("columns", "ignore", "rows")

#: What scipy's reader raises on damaged files; where a part is missing it stops at a name that was never set.
_DAMAGED = (
    ValueError,
    EOFError,
    struct.error,
    ZeroDivisionError,
    TypeError,
    OverflowError,
    MemoryError,
    NameError,
    Warning,
)
#: Bytes of a sample that becomes a number of eight.
_LEAST = 1
#: Filters of warnings are those of the whole process: one file at a time changes them and puts them back.
_ALONE = Lock()


def read(path: Path, options: Options) -> Contents:
    """Read a sound file; samples of 8, 16, 24 or 32 bits are divided by the full scale, those of floating point taken as they are.

    Raises `DataError`: no such file, one that is compressed, or cut off.
    """
    from scipy.io import wavfile

    space = room(path.name, path.stat().st_size)
    space.take("its samples", 8 * space.size // (2 * _LEAST))
    try:
        with _ALONE, warnings.catch_warnings():
            warnings.simplefilter("error", wavfile.WavFileWarning)
            warnings.filterwarnings("ignore", "Chunk .*not understood", wavfile.WavFileWarning)
            rate, values = wavfile.read(path)
    except _DAMAGED as error:
        raise DataError(
            f"reading {path.name} as a sound file was asked",
            f"it is damaged or compressed ({str(error)[:100]})",
            "Export it as uncompressed WAV (PCM or floating point), or as text.",
        ) from None
    if not rate or not values.size:
        raise DataError(f"reading {path.name} was asked", "it has no samples or no rate", "Record or export it again.")
    with np.errstate(invalid="ignore"):  # signalling NaN, which is found later
        numbers = values.reshape(len(values), -1).astype(float)
    scale = "samples are floating point, taken as they are"
    if values.dtype.kind == "u":
        numbers, scale = (numbers - 128) / 128, "samples of 8 bits, 128 taken off, divided by 128: full scale is 1"
    elif values.dtype.kind == "i":
        full = 2.0 ** (8 * values.dtype.itemsize - 1)
        numbers, scale = numbers / full, f"samples of {values.dtype} divided by {full:g}: full scale is 1"
    table = Table(
        where=path.name,
        columns=tuple(
            Column(number=k + 1, name=f"ch{k + 1}", values=np.ascontiguousarray(column))
            for k, column in enumerate(numbers.T)
        ),
        rate=float(rate),
        rate_from="its header",
        notes=(f"{scale}; multiply by the sensor's range to have its unit",),
        layout=(("samples", f"{values.dtype} {len(values)}, {numbers.shape[1]} channels"),),
    )
    return contents_from_table(table, options)
