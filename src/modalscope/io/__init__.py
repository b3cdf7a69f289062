"""Files in and out: one module a format, one row each in the table of `formats`."""

from modalscope.io.contents import Finding, Survey
from modalscope.io.formats import FORMATS, read, survey, write
from modalscope.io.frames import from_frame
from modalscope.io.geometry import geometry_from_tables
from modalscope.io.limits import set_max_memory

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
