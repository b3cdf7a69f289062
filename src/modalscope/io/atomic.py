"""Files are written beside their target and moved into place: a failed write leaves an earlier file as it was."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from modalscope.model import DataError

__all__ = ["replacing"]


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary file in the target's own folder; move it over the target when the block ends without an error.

    Parameters
    ----------
    path : path
        The file to write. Its suffix is kept by the temporary name.

    Raises
    ------
    DataError
        The folder is missing, the target is a folder, or the system refuses to write.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "modes.txt"
    >>> with replacing(target) as temporary:
    ...     _ = temporary.write_text("seven")
    >>> target.read_text()
    'seven'
    """
    target = Path(path)
    if target.is_dir():
        raise DataError(f"writing {str(target)!r} was asked", "that is a folder", "Name a file in it.")
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
    except OSError as error:
        raise _unwritable(target, error) from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes private files; the result gets the rights of any new file
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(target)
    except OSError as error:
        raise _unwritable(target, error) from None
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _unwritable(target: Path, error: OSError) -> DataError:
    return DataError(
        f"writing {str(target)!r} was asked",
        f"the system refuses: {(error.strerror or str(error)).lower()}",
        "Choose a folder that exists and that you may write to, with room left.",
    )
