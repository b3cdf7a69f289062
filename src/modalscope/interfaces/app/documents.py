"""Store all documents of the server on disk, from one session to the next."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from secrets import token_hex
from typing import Any

from modalscope.data import DataError
from modalscope.data.analysis import VERSION, Analysis, SourceFile
from modalscope.data.shown import figures
from modalscope.interfaces.app.document import OpenDocument
from modalscope.interfaces.app.files import FileStore
from modalscope.interfaces.app.guard import Limits
from modalscope.interfaces.app.processes import ProcessPool
from modalscope.io.analysis import analysis_from, analysis_to, read_analysis
from modalscope.io.atomic import replacing
from modalscope.io.beside import is_file_in, lies_in, named_in
from modalscope.io.geometry import geometry_among

_DOCUMENT = ".analysis.json"

#: Letters of the title of a document, and of its key, at most.
_MAX_TITLE, _MAX_KEY = 200, 64

#: What damaged files of documents raise.
_DAMAGED = (OSError, ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError)

#: Steps of the history that are written before and after the current one.
_MAX_WRITTEN_STEPS = 100


class DocumentStore:
    """Open, find and save documents."""

    def __init__(self, files: FileStore, limits: Limits) -> None:
        self.files, self.limits = files, limits
        self.pool = ProcessPool(limits.workers, limits.spare)
        self._open: dict[str, OpenDocument] = {}
        self._place = files.place / "documents"
        self._place.mkdir(parents=True, exist_ok=True, mode=0o700)

    def listed(self) -> list[dict[str, Any]]:
        """Return the saved documents, the latest first."""
        files = sorted(self._stored(), key=lambda path: -path.stat().st_mtime)
        return [entry for path in files[: self.limits.documents] for entry in self._entry(path)]

    def _stored(self) -> list[Path]:
        """Return the files of documents."""
        return [path for path in self._place.glob("*.json") if path.is_file()]

    def _entry(self, path: Path) -> Iterator[dict[str, Any]]:
        with suppress(*_DAMAGED):
            kept = json.loads(path.read_text(encoding="utf-8"))
            name, steps = str(kept["name"])[:_MAX_TITLE], len(kept["history"])
            yield {"key": path.stem, "name": name, "steps": steps, "changed": path.stat().st_mtime}

    def find(self, key: str) -> OpenDocument:
        """Return a document; one that is not open is read from disk."""
        if key in self._open:
            return self._open[key]
        path = self._file_of(key)
        if path is None or not path.is_file():
            raise DataError(f"document {key[:40]!r}:", "there is no such document", "Open its file again.")
        try:
            kept = json.loads(path.read_text(encoding="utf-8"))
            history = [analysis_from(entries) for entries in kept["history"]]
            if not history:
                raise ValueError("it has no step")
            place = min(max(int(kept["place"]), 0), len(history) - 1)
            opened = self._placed(key, str(kept["name"])[:_MAX_TITLE], history)
        except DataError:
            raise
        except _DAMAGED as error:
            raise DataError(f"document {key!r}:", f"it is damaged ({error})", "Open its file again.") from None
        opened.place = place
        return opened

    async def open(self, names: list[str]) -> OpenDocument:
        """Open listed files, uploads, or a document; several files are parts of one test."""
        if not names:
            raise DataError("opening a file:", "none was named", "Choose a listed file, or drop one on the page.")
        paths = [self.files.resolve(name) for name in names]
        if len(paths) == 1 and paths[0].name.lower().endswith(_DOCUMENT):
            document = self._of_paths(read_analysis(paths[0]), paths[0].parent)
        else:
            # beside a file of any other kind a table of points alone is a geometry, too
            alone = [] if len(paths) > 1 else [Path("measurement")]
            data, geometry = await asyncio.to_thread(geometry_among, [*paths, *alone])
            paths = paths if alone else data
            if alone and geometry:
                fault = "it is a geometry: points, and no measurement"
                raise DataError(f"opening {paths[0].name}:", fault, "Drop the measurement with it, together.")
            reading = {"geometry": tuple(map(str, geometry))} if geometry else {}
            from modalscope.analysis.workflow.sources import source_of_file

            document = Analysis(files=tuple([await asyncio.to_thread(source_of_file, p, reading) for p in paths]))
        if len(self._open) >= self.limits.documents:
            most = f"at most {self.limits.documents} documents are open together"
            raise DataError(most, f"{len(self._open)} are open", "Close some.")
        opened = self._placed(token_hex(8), ", ".join(path.name for path in paths)[:_MAX_TITLE], [document])
        self.keep(opened)
        return opened

    def _of_paths(self, document: Analysis, folder: Path) -> Analysis:
        """Return a document with the paths of its files: as stored, or in the folder of the document."""
        files = []
        for file in document.files or (SourceFile(),):
            path = str(self._readable(Path(file.path), folder, "data"))
            points = [str(self._readable(Path(str(name)), folder, "geometry")) for name in named_in(file.reading)]
            reading = {**file.reading, **({"geometry": tuple(points)} if points else {})}
            files.append(replace(file, path=path, reading=reading))
        return replace(document, files=tuple(files))

    def _readable(self, stored: Path, folder: Path, what: str) -> Path:
        """Return a file of a document that may be read: as stored, or in the folder of the document."""
        path = stored if lies_in(stored, self._tops) else folder / stored.name
        if not stored.name or not is_file_in(path, self._tops):
            fault = f"its {what}, {stored.name[:60] or 'arrays'}, is no file in the folder"
            raise DataError("opening a document:", fault, "Put the file into the folder of the document.")
        return path

    @property
    def _tops(self) -> list[Path]:
        """The folders whose files may be read."""
        return [top for top in (self.files.folder, self.files.place) if top is not None]

    def _file_of(self, key: str) -> Path | None:
        """Return the file of a document; None where no document has such a key."""
        return self._place / f"{key}.json" if key.isalnum() and key.isascii() and len(key) <= _MAX_KEY else None

    def _placed(self, key: str, name: str, history: list[Analysis]) -> OpenDocument:
        opened = OpenDocument(key=key, name=name, history=history, pool=self.pool, limits=self.limits)
        self._open[key] = opened
        return opened

    def keep(self, opened: OpenDocument) -> None:
        """Write a document to disk."""
        first = max(0, opened.place - _MAX_WRITTEN_STEPS)
        history = opened.history[first : opened.place + _MAX_WRITTEN_STEPS]
        kept = {"modalscope": VERSION, "name": opened.name, "place": opened.place - first}
        kept |= {"history": list(map(analysis_to, history))}
        with replacing(self._place / f"{opened.key}.json") as temporary:
            temporary.write_text(json.dumps(kept), encoding="utf-8")

    def close(self, key: str) -> None:
        """Close a document and delete it."""
        opened = self._open.pop(key, None)
        if opened is not None:
            opened.close()
        path = self._file_of(key)
        if path is None or not path.is_file():
            return
        used = self._uploads_in(path)
        path.unlink()
        self._remove(used)

    def _uploads_in(self, path: Path) -> list[Path]:
        """Return the uploads that a document names, in any of its steps."""
        text = path.read_text(encoding="utf-8", errors="replace")
        return [folder for folder in self.files.uploads() if folder.name in text]

    def _remove(self, uploads: Iterable[Path]) -> None:
        """Delete the uploads that no document names."""
        kept = {folder for path in self._stored() for folder in self._uploads_in(path)}
        for folder in uploads:
            if folder not in kept:
                self.files.remove(folder)

    def age(self) -> None:
        """Delete documents of uploads, and uploads of no document, that were not changed for `Limits.days`."""
        before = time.time() - 86400 * self.limits.days
        for path in self._stored():
            if path.stat().st_mtime < before and self._uploads_in(path):
                path.unlink()
        self._remove([folder for folder in self.files.uploads() if folder.stat().st_mtime < before])

    def forget(self) -> str:
        """Delete all documents and uploads, and return what was deleted in words."""
        documents, uploads, size = self._stored(), self.files.uploads(), self.files.total
        for path in documents:
            path.unlink()
        self._remove(uploads)
        return f"{len(documents)} documents and {len(uploads)} dropped files ({figures(size / 1e6)} MB) deleted"

    def end(self) -> None:
        """End all processes; documents stay on disk."""
        for opened in self._open.values():
            opened.rest()
            opened.windows.send({"type": "ended"})
        self.pool.close()
