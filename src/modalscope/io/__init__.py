"""Files in and out: one module a format, one row each in the table of `formats`."""

from typing import TYPE_CHECKING

from modalscope.io.contents import Finding, Survey
from modalscope.io.formats import FORMATS, read, survey, write
from modalscope.io.limits import set_max_memory
from modalscope.numerics.handed import later

if TYPE_CHECKING:
    from modalscope.io.frames import from_frame as from_frame

__all__ = ["FORMATS", "Finding", "Survey", "from_frame", "read", "set_max_memory", "survey", "write"]

if not TYPE_CHECKING:
    __getattr__ = later(__name__, {"frames": ("from_frame",)})
