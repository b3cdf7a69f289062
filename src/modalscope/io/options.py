"""Names of options of each format, and of suffixes that many have."""

from __future__ import annotations

#: Suffixes of meshes.
MESHES = (".msh", ".vtk", ".vtu", ".inp", ".bdf", ".nas", ".fem", ".med", ".stl", ".obj", ".ply")
#: Fields of a data object that may be given, or overridden, while it is read from any format.
FIELDS = (
    *("quantity", "quantities", "sampling_rate", "kind", "output_dofs", "input_dofs", "units", "geometry", "averages"),
    *("added_damping", "groups"),
)
#: Of named arrays, and of those that may stay in their file.
ARRAYS = ("rename", "axes", "ignore", "columns", "transpose", "rows", "resample", "sheet")
STORED = (*ARRAYS, "stored")
#: Of tables of any kind; of text; of recorders' files, workbooks and sound.
COLUMNS = ("columns", "ignore", "transpose", "rows", "resample")
TEXT = (*COLUMNS, "skip", "decimal", "delimiter", "sheet")
RECORDERS, WORKBOOKS, SOUND = (*COLUMNS, "sheet"), (*COLUMNS, "skip", "sheet"), ("columns", "ignore", "rows")

#: Of universal files, read and written, and of JSON, written.
UNIVERSAL, UNIVERSAL_WRITTEN = ("want", "repeated"), ("text", "dataset", "nodes", "lines")
#: Of a file that holds another, whatever that one takes.
EVERY = tuple(dict.fromkeys((*STORED, *TEXT, *UNIVERSAL)))
JSON_WRITTEN = ("method", "domain", "orders", "route", "data", "result")
