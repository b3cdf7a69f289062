"""Files are written beside their target and moved into place: a failed write leaves an earlier file as it was."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from modalscope.model import DataError

__all__ = ["PENDING", "check_target", "replacing"]

#: Temporary files that are being written: what ends the process without an exception takes them away itself.
PENDING: set[Path] = set()

#: Letters of the target's name that its temporary file keeps: names may be as long as the system lets them.
_LETTERS = 40


@contextmanager
def replacing(path: str | Path, sources: Iterable[Path | None] = ()) -> Iterator[Path]:
    """Give a temporary file in the target's own folder; move it over the target when the block ends without an error.

    A file that is there keeps its rights, and a symbolic link stays one: what it points to is replaced. Another hard link to it keeps
    the earlier content.

    Parameters
    ----------
    path : path
        The file to write. Its suffix is kept by the temporary name.
    sources : iterable of path or None
        Files that must not be overwritten: those that the data came from.

    Raises
    ------
    DataError
        The folder is missing, the target is a folder, a pipe, a device or one of the sources, or the system refuses to write.

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
    temporary = target.with_name(f".{target.stem[:_LETTERS]}-{token_hex(4)}{target.suffix}")
    PENDING.add(temporary)
    try:
        rights = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666 if rights is None else 0o600))
        yield temporary
        if rights is not None:
            temporary.chmod(rights)
        temporary.replace(target)
    except OSError as error:
        raise _unwritable(path, error) from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        PENDING.discard(temporary)


def check_target(path: str | Path, sources: Iterable[Path | None] = ()) -> Path:
    """Return the file that would be replaced, at the end of symbolic links, or raise as `replacing` does.

    Parameters
    ----------
    path : path
    sources : iterable of path or None
        Files that must not be overwritten, by whatever name.
    """
    try:
        target = Path(os.path.realpath(path))
        if not target.exists():
            return target
        if not target.is_file():
            kind = "a folder" if target.is_dir() else "a pipe or a device"
            raise DataError(
                f"writing {str(path)!r} was asked", f"that is {kind}", "Name a file in a folder that is there."
            )
        for source in sources:
            if source is not None and source.exists() and target.samefile(source):
                raise DataError(
                    f"writing {str(path)!r} was asked",
                    "the data came from that file, and a measurement is never overwritten",
                    "Choose another name.",
                )
        if not os.access(target, os.W_OK):
            raise DataError(f"writing {str(path)!r} was asked", "that file is write-protected", "Choose another name.")
    except OSError as error:
        raise _unwritable(path, error) from None
    return target


def _unwritable(path: str | Path, error: OSError) -> DataError:
    return DataError(
        f"writing {str(path)!r} was asked",
        f"the system refuses: {(error.strerror or str(error)).lower()}",
        "Choose a folder that exists and that you may write to, with room left.",
    )
