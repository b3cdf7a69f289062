"""Files in and out: one module a format, one row each in the table of `formats`."""

from typing import TYPE_CHECKING

from modalscope.io.contents import Finding, Survey
from modalscope.io.formats import FORMATS, read, survey, write
from modalscope.io.limits import set_max_memory
from modalscope.numerics.handed import later

if TYPE_CHECKING:
    from modalscope.io.frames import from_frame as from_frame
    from modalscope.io.geometry import geometry_from_tables as geometry_from_tables

__all__ = [
    "FORMATS",
    "Finding",
    "Survey",
    "from_frame",
    "geometry_from_tables",
    "read",
    "set_max_memory",
    "survey",
    "write",
]

if not TYPE_CHECKING:
    __getattr__ = later(__name__, {"frames": ("from_frame",), "geometry": ("geometry_from_tables",)})
