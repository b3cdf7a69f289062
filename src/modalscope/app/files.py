"""List and store the files that the page may open: those of the given folder and uploads."""

from __future__ import annotations

import os
import re
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from pathlib import Path
from secrets import token_hex

from modalscope.data import DataError

#: Formats of the export: suffix -> description.
FORMATS = {
    ".json": "modes with all results, and the analysis",
    ".csv": "a table of the modes",
    ".uff": "universal file, dataset 55",
    ".unv": "universal file, dataset 55",
    ".npz": "NumPy arrays",
    ".mat": "MATLAB arrays",
    ".h5": "HDF5 arrays",
    ".html": "the report, one file with its pictures",
    ".analysis.json": "the document: every choice, to repeat the analysis",
}

#: Suffixes of the listed files: data and documents.
_LISTED_SUFFIXES = (
    *(".uff", ".unv", ".npz", ".mat", ".h5", ".hdf5", ".csv", ".txt", ".asc", ".tsv", ".dat", ".lvm", ".xlsx"),
    *(".npy", ".wav", ".tdms", ".mf4", ".nc", ".parquet", ".analysis.json"),
)

#: Maximum number of listed files, and maximum depth of folders below the given one.
_MAX_LISTED, _MAX_DEPTH = 500, 3

#: Prefix of the names of uploads.
_UPLOAD = "upload:"


class FileStore:
    """The files that the page may open: those of one folder, and uploads.

    `folder`: nothing outside of it is listed or opened. `place`: folder of uploads and documents.
    """

    def __init__(self, folder: Path | None, place: Path) -> None:
        self.folder = None if folder is None else folder.resolve()
        self.place = place.resolve()
        self._uploads = self.place / "uploads"
        self._uploads.mkdir(parents=True, exist_ok=True, mode=0o700)

    def listed(self) -> list[dict[str, object]]:
        """Return the files of the folder that can be opened."""
        return [] if self.folder is None else list(self._walk(self.folder))[:_MAX_LISTED]

    def _walk(self, top: Path) -> Iterator[dict[str, object]]:
        for where, folders, names in os.walk(top):
            here = Path(where)
            folders[:] = sorted(
                f for f in folders if not f.startswith(".") and len((here / f).relative_to(top).parts) <= _MAX_DEPTH
            )
            for name in sorted(names):
                if name.lower().endswith(_LISTED_SUFFIXES) and not name.startswith("."):
                    with suppress(OSError):
                        size = (here / name).stat().st_size
                        yield {"name": (here / name).relative_to(top).as_posix(), "size": size}

    def resolve(self, name: str) -> Path:
        """Return the path of a listed file or an upload.

        Raises `DataError`: a path outside of the folder, or no such file.
        """
        top, inner = (self._uploads, name.removeprefix(_UPLOAD)) if name.startswith(_UPLOAD) else (self.folder, name)
        if top is None or "\0" in inner:
            raise self._outside(name)
        path = (top / inner).resolve()
        if not path.is_relative_to(top):
            raise self._outside(name)
        if not path.is_file():
            raise DataError(f"{name!r} was asked", "there is no such file", "Choose a listed file.")
        return path

    def _outside(self, name: str) -> DataError:
        where = "no folder was given" if self.folder is None else "it is outside of the folder"
        return DataError(
            f"{name!r} was asked", where, "Start `modalscope app --folder` there, or drop the file on the page."
        )

    async def take(self, name: str, chunks: AsyncIterator[bytes], most: int) -> str:
        """Write an upload chunk by chunk and return its name; one that is too large or interrupted is removed.

        `most`: maximum size in bytes.
        """
        folder = self._uploads / token_hex(8)
        folder.mkdir(mode=0o700)
        path, size = folder / _plain(name), 0
        try:
            with path.open("xb") as file:
                async for chunk in chunks:
                    size += len(chunk)
                    if size > most:
                        raise too_large(name, most)
                    file.write(chunk)
        except BaseException:
            path.unlink(missing_ok=True)
            folder.rmdir()
            raise
        return f"{_UPLOAD}{folder.name}/{path.name}"


def too_large(name: str, most: int) -> DataError:
    """Return the error of an upload of more than `most` bytes."""
    remedy = "Move it to a folder and start `modalscope app --folder` there."
    return DataError(f"uploading {name} was asked", f"it has more than {most / 1e6:g} MB", remedy)


def _plain(name: str) -> str:
    """Return the name of a file without folders and special characters.

    Examples
    --------
    >>> _plain("../../etc/passwd"), _plain("a b(1).uff"), _plain("..")
    ('passwd', 'a b(1).uff', 'file')
    """
    last = re.split(r"[/\\]", name)[-1]
    kept = re.sub(r"[^\w .()+-]", "_", last).strip(". ")
    return kept[-120:] or "file"
