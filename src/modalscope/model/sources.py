"""The files that data came from: nothing that is written may take their place."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeAlias

from modalscope.model.checks import check_path

__all__ = ["SourcePath", "check_source", "files_of", "source_of"]

#: One file; several where data of several were put together; None where data were made.
SourcePath: TypeAlias = Path | tuple[Path, ...] | None


def check_source(given: Any) -> SourcePath:
    """Return a name, or several, as paths; each once.

    Parameters
    ----------
    given : path, sequence of paths or None

    Raises
    ------
    DataError
        Something that names no file.

    Examples
    --------
    >>> check_source(["a.npz", "a.npz"]) == Path("a.npz")
    True
    """
    names = given if isinstance(given, tuple | list) else () if given is None else (given,)
    paths = tuple(dict.fromkeys(check_path(name) for name in names))
    return paths if len(paths) > 1 else next(iter(paths), None)


def files_of(data: Any) -> tuple[Path, ...]:
    """Return the files that data came from, none where that is not known.

    Parameters
    ----------
    data : object
        With a `source_path`, or without.
    """
    held = getattr(data, "source_path", None)
    return held if isinstance(held, tuple) else () if held is None else (held,)


def source_of(parts: Iterable[Any]) -> SourcePath:
    """Return where data that are put together came from: the files of all parts.

    Parameters
    ----------
    parts : iterable of data
    """
    return check_source([file for part in parts for file in files_of(part)])
