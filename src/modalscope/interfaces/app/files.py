"""List and store the files that the page may open: those of the given folder and uploads."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from secrets import token_hex

from modalscope.data import DataError
from modalscope.datasets import shipped
from modalscope.interfaces.app.guard import Limits
from modalscope.io.beside import is_file_in, lies_in
from modalscope.io.formats import FORMATS as READ
from modalscope.io.options import MESHES

#: Formats that the page's menu of exports offers: suffix -> description.
FORMATS = {
    ".json": "modes with all results, and the analysis",
    ".csv": "a table of the modes",
    ".xlsx": "a workbook: modes, shapes, MAC, responses",
    ".uff": "universal file, dataset 55",
    ".npz": "NumPy arrays",
    ".mat": "MATLAB arrays",
    ".h5": "HDF5 arrays",
    ".model.mat": "state-space model A, B, C, D for MATLAB",
    ".model.json": "state-space model A, B, C, D",
    ".html": "the report, one file with its pictures",
    ".zip": "pictures of diagram, shapes, AutoMAC and response, SVG",
    ".gif": "film of the chosen mode",
    ".docx": "the report as a Word document",
    ".pptx": "the report as slides",
    ".analysis.json": "the document: every choice, to repeat the analysis",
}

#: Suffix -> the package that writes it, and the extra that brings it.
_NEEDED = {".docx": ("docx", "office"), ".pptx": ("pptx", "office")}
_NEEDED |= {".h5": ("h5py", "hdf5"), ".xlsx": ("openpyxl", "excel")}


def missing_formats() -> dict[str, str]:
    """Return the formats that cannot be written here, with the reason."""
    return {
        suffix: f"needs the package {package}: pip install 'modalscope[{extra}]'"
        for suffix, (package, extra) in _NEEDED.items()
        if find_spec(package) is None
    }


#: Suffixes of the files that the page lists: measurements in one file, and documents of analyses. Meshes can be dropped on the page.
_LISTED_SUFFIXES = (*(suffix for suffix in READ if suffix not in (*MESHES, ".json", ".zarr")), ".analysis.json")

#: Maximum number of files in the list, and maximum depth of folders below the given one. Both are choices: the list is made anew at each
#: start of the page, and has to be short enough to read, also where the folder is a whole disk.
_MAX_FILES, _MAX_DEPTH = 500, 3

#: Prefixes of the names of uploads and of examples, which tell them from files of the folder.
_UPLOAD, _EXAMPLE = "upload:", "example:"

#: Maximum number of bytes of the name of an upload, counted from its end, where the suffix is: file systems take names of 255 bytes.
_MAX_NAME = 240


class FileStore:
    """The files that the page may open: those of one folder, and uploads.

    Parameters
    ----------
    folder : path, optional
        The folder whose files are listed; nothing outside of it is listed or opened. Without one only uploads can be opened.
    place : path
        Folder of the server's own files, in which uploads are written.
    """

    def __init__(self, folder: Path | None, place: Path) -> None:
        self.folder = None if folder is None else folder.resolve()
        self.place = place.resolve()
        self._uploads = self.place / "uploads"
        self._uploads.mkdir(parents=True, exist_ok=True, mode=0o700)
        #: Bytes of all uploads.
        self.total = sum(map(_size_of, self.uploads()))

    def listing(self) -> list[dict[str, object]]:
        """Return name (below the folder), size (bytes) and time of change of the files of the folder that the page offers."""
        return [] if self.folder is None else list(islice(self._walk(self.folder), _MAX_FILES))

    def _walk(self, top: Path) -> Iterator[dict[str, object]]:
        """Yield the files of a folder with a listed suffix, in the order of their names; hidden files and folders are left out."""
        for parent, folders, names in os.walk(top):
            folder = Path(parent)
            depth = len(folder.relative_to(top).parts) + 1
            # `os.walk` descends into the folders that remain in this list
            folders[:] = sorted(name for name in folders if not name.startswith(".") and depth <= _MAX_DEPTH)
            for name in sorted(names):
                path = folder / name
                if name.lower().endswith(_LISTED_SUFFIXES) and not name.startswith("."):
                    with suppress(OSError):  # a file that was removed meanwhile, or that may not be read
                        known = path.stat()
                        name = path.relative_to(top).as_posix()
                        yield {"name": name, "size": known.st_size, "changed": known.st_mtime}

    def resolve(self, name: str) -> Path:
        """Return the path of a file of the folder, or of an upload.

        Parameters
        ----------
        name : str
            As `listing` and `store_upload` return it.

        Raises
        ------
        DataError
            A path outside of the folder, also by a link, or no such file.
        """
        if name.startswith(_EXAMPLE):
            return self._example(name.removeprefix(_EXAMPLE))
        top, inner = (self._uploads, name.removeprefix(_UPLOAD)) if name.startswith(_UPLOAD) else (self.folder, name)
        if top is None or not lies_in(top / inner, [top]):
            fault = "no folder was given" if self.folder is None else "it is outside of the folder"
            remedy = "Drop the file on the page, or start the page in the folder of the file."
            raise DataError(f"{name!r}:", fault, remedy)
        if not is_file_in(top / inner, [top]):
            raise DataError(f"{name!r}:", "there is no such file", "Choose a listed file.")
        return (top / inner).resolve()

    def _example(self, name: str) -> Path:
        """Return a copy of a measured test that comes with the program, among the uploads."""
        source = shipped.folder(name) / shipped.FILES[name]
        place = self._uploads / token_hex(8)
        place.mkdir(mode=0o700)
        self.total += source.stat().st_size
        return Path(shutil.copy(source, place))

    async def store_upload(
        self, name: str, chunks: AsyncIterator[bytes], max_bytes: int, limits: Limits | None = None
    ) -> str:
        """Write an upload chunk by chunk and return its name; one that is too large or interrupted is removed.

        `limits`: of all uploads together.

        Each upload has a folder with a random name, so that uploads of one name do not replace each other.

        Raises
        ------
        DataError
            More than `max_bytes` bytes, more than may be with all others, or no space on the disk.
        """
        most, count = (limits.uploads, limits.files) if limits else (float("inf"), float("inf"))
        if len(self.uploads()) >= count:
            raise _full(name, f"{count} files")
        folder = self._uploads / token_hex(8)
        path, size = folder / safe_name(name), 0
        try:
            folder.mkdir(mode=0o700)
            with path.open("xb") as file:
                async for chunk in chunks:
                    size, self.total = size + len(chunk), self.total + len(chunk)
                    if size > max_bytes:
                        raise too_large(name, max_bytes)
                    if self.total > most:
                        raise _full(name, f"{most / 1e9:g} GB")
                    file.write(chunk)
        except BaseException as error:  # a cancelled request, too
            self.total -= size
            shutil.rmtree(folder, ignore_errors=True)
            if isinstance(error, OSError) and error.strerror:
                fault = f"the system refuses: {error.strerror.lower()}"
                raise DataError(f"uploading {name}:", fault, "Make room on the disk.") from None
            raise
        return f"{_UPLOAD}{folder.name}/{path.name}"

    def uploads(self) -> list[Path]:
        """Return the folders of the uploads."""
        return [folder for folder in self._uploads.iterdir() if folder.is_dir() and not folder.is_symlink()]

    def remove(self, folder: Path) -> None:
        """Delete an upload with its folder."""
        size = _size_of(folder)
        shutil.rmtree(folder, ignore_errors=True)
        self.total -= size


def _size_of(folder: Path) -> int:
    return sum(path.lstat().st_size for path in folder.iterdir())


def _full(name: str, most: str) -> DataError:
    """Return the error of an upload for which there is no room."""
    fault = f"the files that were dropped on the page would be more than {most} together"
    remedy = "Delete recent documents that are done with: their files go with them."
    return DataError(f"uploading {name}:", fault, remedy)


def too_large(name: str, max_bytes: int) -> DataError:
    """Return the error of an upload of more than `max_bytes` bytes."""
    remedy = "Start the page in its folder and choose it there."
    return DataError(f"uploading {name}:", f"it has more than {max_bytes / 1e6:g} MB", remedy)


def safe_name(name: str, most: int = _MAX_NAME) -> str:
    """Return the name of a file without folders and special characters, the last `most` bytes of it.

    Examples
    --------
    >>> safe_name("../../etc/passwd"), safe_name("a b(1).uff"), safe_name("..")
    ('passwd', 'a b(1).uff', 'file')
    """
    file_name = re.split(r"[/\\]", name)[-1]
    plain = re.sub(r"[^\w .()+-]", "_", file_name).strip(". ")
    return plain.encode(errors="replace")[-most:].decode(errors="ignore") or "file"
