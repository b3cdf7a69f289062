"""The mark that every file written here carries: the command line replaces such a file unasked, and no other.

| suffix | where the mark stands |
|---|---|
| .uff, .unv | the header, dataset 151, names the program |
| .csv | the first line is a comment; a table of modes is known by its columns |
| .npz | the comment of the archive |
| .mat | the description at the head of the file |
| .h5, .hdf5 | an attribute of the root group |
| .json | the first entry |
| .html, .htm | the generator in the head of the page |
| .png, .svg, .pdf | the program in the description of the picture |
"""

from __future__ import annotations

import re
from pathlib import Path

from modalscope.model.version import VERSION

__all__ = ["MARK", "is_ours"]

#: What is written into a file.
MARK = f"modalscope {VERSION}"

#: The mark stands within so many bytes of the beginning, or of the end.
_HEAD = 8192
_TAIL = {".npz": 256, ".pdf": 8192}

_UNIVERSAL = rb"\A    -1\s+151\s(?s:.){0,400}?^modalscope \d"
_HDF5 = rb"\A\x89HDF\r\n\x1a\n(?s:.)*?modalscope_layout"
_HTML = rb'\A<!DOCTYPE html>(?s:.){0,400}?<meta name="generator" content="[^"]*modalscope \d'

_MARKS = {
    ".uff": _UNIVERSAL,
    ".unv": _UNIVERSAL,
    ".csv": rb"\A(# written by: modalscope \d|mode,frequency_hz,damping_ratio,)",
    ".npz": rb"modalscope \d[^\n]*\Z",
    ".mat": rb"\AMATLAB [^\n]{0,110}modalscope \d",
    ".h5": _HDF5,
    ".hdf5": _HDF5,
    ".json": rb'\A\{\s*"modalscope":',
    ".html": _HTML,
    ".htm": _HTML,
    ".png": rb"\A\x89PNG(?s:.){0,200}?tEXtSoftware\x00modalscope \d",
    ".svg": rb"<dc:title>modalscope \d",
    ".pdf": rb"/Creator \(modalscope \d",
}


def is_ours(path: Path) -> bool:
    """Whether a file carries the mark of its format.

    Parameters
    ----------
    path : path
        A file that is there.

    Raises
    ------
    OSError
        It cannot be read.
    """
    mark = _MARKS.get(path.suffix.lower())
    if mark is None:
        return False
    with path.open("rb") as file:
        head = file.read(_HEAD)
        tail = _TAIL.get(path.suffix.lower(), 0)
        file.seek(max(path.stat().st_size - tail, 0))
        text = head + file.read(tail)
    return re.search(mark, text, re.MULTILINE) is not None
