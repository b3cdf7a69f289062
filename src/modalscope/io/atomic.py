"""Write files: to a temporary name and then into place, with the program's mark, and without texts that no format holds.

The command line replaces files that carry the mark unasked, and no other:

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

import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from secrets import token_hex
from typing import Any

from modalscope.data import DataError
from modalscope.data.analysis import VERSION

#: Temporary files that are being written: what ends the process without an exception takes them away itself.
PENDING: set[Path] = set()
#: Letters of the target's name in that of its temporary file: the system bounds names.
_LETTERS_KEPT = 40
#: What is written into a file.
MARK = f"modalscope {VERSION}"
#: Bytes at the beginning of a file, or at its end, that hold the mark.
_BYTES_OF_HEAD = 8192
_BYTES_OF_TAIL = {".npz": 256, ".pdf": 8192}

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


@contextmanager
def replacing(path: str | Path, sources: Iterable[Path | None] = ()) -> Iterator[Path]:
    """Give a temporary file in the target's own folder; move it over the target when the block ends without an error.

    A file that is there keeps its rights, and a symbolic link stays one: what it points to is replaced. Another hard link to it keeps
    the earlier content.

    `path`: the file to write. Its suffix is kept by the temporary name. `sources`: files that must not be overwritten: those that the
    data came from.

    Raises `DataError`: the folder is missing, the target is a folder, a pipe, a device or one of the sources, or the system refuses to
    write.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "modes.txt"
    >>> with replacing(target) as temporary:
    ...     _ = temporary.write_text("seven")
    >>> target.read_text()
    'seven'
    """
    target = check_target(path, sources)
    temporary = target.with_name(f".{target.stem[:_LETTERS_KEPT]}-{token_hex(4)}{target.suffix}")
    PENDING.add(temporary)
    try:
        rights = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666 if rights is None else 0o600))
        yield temporary
        if rights is not None:
            temporary.chmod(rights)
        _kept(temporary)
        temporary.replace(target)
        _kept(target.parent)
    except OSError as error:
        raise _unwritable(path, error) from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        PENDING.discard(temporary)


def _kept(path: Path) -> None:
    """Have the disk keep what was written into a file or a folder, though the power fails."""
    if os.name == "posix":
        opened = os.open(path, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)


def check_target(path: str | Path, sources: Iterable[Path | None] = ()) -> Path:
    """Return the file that would be replaced, at the end of symbolic links, or raise as `replacing` does.

    `sources`: files that must not be overwritten, by whatever name.
    """
    try:
        target = Path(os.path.realpath(path))
        if not target.exists():
            return target
        if not target.is_file():
            fault = "that is a folder" if target.is_dir() else "that is a pipe or a device"
            raise DataError(f"writing {str(path)!r}:", fault, "Name a file in a folder that is there.")
        for source in sources:
            if source is not None and source.exists() and target.samefile(source):
                fault = "the data came from that file, and a measurement is never overwritten"
                raise DataError(f"writing {str(path)!r}:", fault, "Choose another name.")
        if not os.access(target, os.W_OK):
            raise DataError(f"writing {str(path)!r}:", "that file is write-protected", "Choose another name.")
    except OSError as error:
        raise _unwritable(path, error) from None
    return target


def _unwritable(path: str | Path, error: OSError) -> DataError:
    fault = f"the system refuses: {(error.strerror or str(error)).lower()}"
    remedy = "Choose a folder that exists and that you may write to, with room left."
    return DataError(f"writing {str(path)!r}:", fault, remedy)


def is_ours(path: Path) -> bool:
    """Whether a file carries the mark of its format.

    `path`: A file that is there.

    Raises
    ------
    OSError
        It cannot be read.
    """
    mark = _MARKS.get(path.suffix.lower())
    if mark is None:
        return False
    with path.open("rb") as file:
        head = file.read(_BYTES_OF_HEAD)
        tail = _BYTES_OF_TAIL.get(path.suffix.lower(), 0)
        file.seek(max(path.stat().st_size - tail, 0))
        text = head + file.read(tail)
    return re.search(mark, text, re.MULTILINE) is not None


def check_texts(kind: str, thing: Any) -> None:
    """Raise on texts that no file keeps: those with a NUL, at which most programs stop, and halves of characters.

    Names of indicators are names of arrays in a file, and need to be printable and without a slash, too.

    `kind`: the suffix, for the message.
    """
    for where, text in _texts(thing):
        odd = "\0" in text or any("\ud800" <= c <= "\udfff" for c in text)
        if odd or (where.startswith("indicators") and ("/" in text or not text.isprintable())):
            fault = "that text has characters which files do not keep"
            raise DataError(f"writing {where} {text!r} as {kind}:", fault, "Rename it.")


def _texts(thing: Any, where: str = "") -> Iterator[tuple[str, str]]:
    """Give every text of a data object with the name of its field; notes and reasons are written as JSON, which has escapes."""
    if isinstance(thing, str):
        yield where, thing
    elif isinstance(thing, Mapping):
        for key in thing:
            yield from _texts(key, where)
    elif isinstance(thing, tuple | list):
        for item in thing:
            yield from _texts(item, where)
    elif is_dataclass(thing):
        for field in fields(thing):
            if field.name not in ("notes", "reasons", "left_out", "harmonics"):
                yield from _texts(getattr(thing, field.name), field.name)
