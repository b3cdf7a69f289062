"""List and store the files that the page may open: those of the given folder and uploads."""

from __future__ import annotations

import os
import re
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from pathlib import Path
from secrets import token_hex

from modalscope.data import DataError

# ------------------------------------------------------------------------------------------------------------- formats
# What can be exported.

#: The suffix, and what is told of it.
FORMATS = {
    ".json": "modes with everything that is known of them, and the analysis",
    ".csv": "a table of the modes",
    ".uff": "universal file, dataset 55",
    ".unv": "universal file, dataset 55",
    ".npz": "NumPy arrays",
    ".mat": "MATLAB arrays",
    ".h5": "HDF5 arrays",
    ".html": "the report: one file, pictures and all",
    ".analysis.json": "the document: every choice, to do it again",
}


# --------------------------------------------------------------------------------------------------------------- files

#: Suffixes of data that the folder's listing shows, and of documents.
_SHOWN = (".uff", ".unv", ".npz", ".mat", ".h5", ".hdf5", ".csv", ".txt", ".asc", ".tsv", ".dat", ".lvm", ".xlsx")
_MORE = (".npy", ".wav", ".tdms", ".mf4", ".nc", ".parquet", ".analysis.json")

#: Files listed at most, and folders below the given one that are looked into.
_LISTED, _DEEP = 500, 3

#: An upload is named by this and its place.
_UPLOAD = "upload:"


class Shelf:
    """The folder that was given, and a place of our own for uploads and documents.

    `folder`: nothing outside of it is listed or opened. `place`: where uploads and documents are kept.
    """

    def __init__(self, folder: Path | None, place: Path) -> None:
        self.folder = None if folder is None else folder.resolve()
        self.place = place.resolve()
        self._uploads = self.place / "uploads"
        self._uploads.mkdir(parents=True, exist_ok=True, mode=0o700)

    def listed(self) -> list[dict[str, object]]:
        """Return the files of the folder that can be opened."""
        return [] if self.folder is None else list(self._walk(self.folder))[:_LISTED]

    def _walk(self, top: Path) -> Iterator[dict[str, object]]:
        for where, folders, names in os.walk(top):
            here = Path(where)
            folders[:] = sorted(
                f for f in folders if not f.startswith(".") and len((here / f).relative_to(top).parts) <= _DEEP
            )
            for name in sorted(names):
                if name.lower().endswith((*_SHOWN, *_MORE)) and not name.startswith("."):
                    with suppress(OSError):
                        size = (here / name).stat().st_size
                        yield {"name": (here / name).relative_to(top).as_posix(), "size": size}

    def resolve(self, name: str) -> Path:
        """Return the file of a name from the listing or an upload; nothing outside of these.

        Raises `DataError`: A path that leads elsewhere, or no such file.
        """
        top, inner = (self._uploads, name.removeprefix(_UPLOAD)) if name.startswith(_UPLOAD) else (self.folder, name)
        if top is None or "\0" in inner:
            raise self._outside(name)
        path = (top / inner).resolve()
        if not path.is_relative_to(top):
            raise self._outside(name)
        if not path.is_file():
            raise DataError(f"{name!r} was asked", "there is no such file", "Choose one of the list.")
        return path

    def _outside(self, name: str) -> DataError:
        where = "no folder was given" if self.folder is None else "that is outside of the folder that was given"
        return DataError(f"{name!r} was asked", where, "Start `modalscope app --folder` there, or drop the file here.")

    async def take(self, name: str, chunks: AsyncIterator[bytes], most: int) -> str:
        """Write an upload as it comes and return what it goes by; one too large or broken off leaves nothing behind.

        `most`: bytes.
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
    """Return the error of a file that is too large.

    `most`: bytes.
    """
    found = f"it has more than {most / 1e6:g} MB"
    return DataError(f"{name} was dropped", found, "Put it into a folder and start `modalscope app --folder` there.")


def _plain(name: str) -> str:
    """Return a name that is nothing but the name of a file.

    Examples
    --------
    >>> _plain("../../etc/passwd"), _plain("a b(1).uff"), _plain("..")
    ('passwd', 'a b(1).uff', 'file')
    """
    last = re.split(r"[/\\]", name)[-1]
    kept = re.sub(r"[^\w .()+-]", "_", last).strip(". ")
    return kept[-120:] or "file"
