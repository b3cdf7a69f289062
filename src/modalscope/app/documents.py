"""Store all documents of the server on disk, from one session to the next."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from secrets import token_hex
from typing import Any

from modalscope.app.document import OpenDocument
from modalscope.app.files import FileStore
from modalscope.app.guard import Limits
from modalscope.app.processes import ProcessPool
from modalscope.data import DataError
from modalscope.data.analysis import VERSION, Analysis, SourceFile
from modalscope.io.analysis import analysis_from, analysis_to, read_analysis
from modalscope.io.atomic import replacing
from modalscope.io.beside import lies_in, named_in
from modalscope.io.geometry import geometry_among

_DOCUMENT = ".analysis.json"

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
        files = sorted(self._place.glob("*.json"), key=lambda path: -path.stat().st_mtime)
        return [entry for path in files[: self.limits.documents] for entry in self._entry(path)]

    def _entry(self, path: Path) -> Iterator[dict[str, Any]]:
        with suppress(OSError, ValueError, KeyError, TypeError):
            kept = json.loads(path.read_text(encoding="utf-8"))
            changed = path.stat().st_mtime
            yield {"key": path.stem, "name": str(kept["name"]), "steps": len(kept["history"]), "changed": changed}

    def find(self, key: str) -> OpenDocument:
        """Return a document; one that is not open is read from disk."""
        if key in self._open:
            return self._open[key]
        path = self._place / f"{key}.json"
        if not key.isalnum() or not path.is_file():
            raise DataError(f"document {key[:40]!r} was asked", "there is no such document", "Open its file again.")
        try:
            kept = json.loads(path.read_text(encoding="utf-8"))
            history = [analysis_from(entries) for entries in kept["history"]]
            place = min(max(int(kept["place"]), 0), len(history) - 1)
            opened = self._placed(key, str(kept["name"]), history)
        except DataError:
            raise
        except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
            raise DataError(f"document {key!r} was asked", f"it is damaged ({error})", "Open its file again.") from None
        opened.place = place
        return opened

    async def open(self, names: list[str]) -> OpenDocument:
        """Open listed files, uploads, or a document; several files are parts of one test."""
        if not names:
            raise DataError(
                "opening a file was asked", "none was named", "Choose a listed file, or drop one on the page."
            )
        paths = [self.files.resolve(name) for name in names]
        if len(paths) == 1 and paths[0].name.lower().endswith(_DOCUMENT):
            document = self._of_paths(read_analysis(paths[0]), paths[0].parent)
        else:
            paths, geometry = await asyncio.to_thread(geometry_among, paths)
            reading = {"geometry": tuple(map(str, geometry))} if geometry else {}
            document = Analysis(files=tuple([await asyncio.to_thread(hashed, path, reading) for path in paths]))
        if len(self._open) >= self.limits.documents:
            raise DataError(
                f"at most {self.limits.documents} documents are open together",
                f"{len(self._open)} are open",
                "Close some.",
            )
        opened = self._placed(token_hex(8), ", ".join(path.name for path in paths)[:200], [document])
        self.keep(opened)
        return opened

    def _of_paths(self, document: Analysis, folder: Path) -> Analysis:
        """Return a document with the paths of its files: as stored, or in the folder of the document."""
        files = []
        for file in document.files:
            stored = Path(file.path)
            path = stored if self._may_read(stored) else folder / stored.name
            if not file.path or not self._may_read(path) or not path.is_file():
                missing = f"its data, {stored.name or 'arrays'}, are no file in the folder"
                raise DataError(
                    "opening a document was asked", missing, "Put the file into the folder of the document."
                )
            files.append(replace(file, path=str(path), reading=self._of_geometry(file.reading, folder)))
        return replace(document, files=tuple(files))

    def _of_geometry(self, reading: Mapping[str, Any], folder: Path) -> dict[str, Any]:
        """Return options of reading whose geometry is a file that may be read: as stored, or in the folder of the document."""
        if not named_in(reading):
            return dict(reading)
        stored = [Path(str(name)) for name in named_in(reading)]
        paths = [path if self._may_read(path) else folder / path.name for path in stored]
        lost = next((path.name for path in paths if not self._may_read(path) or not path.is_file()), None)
        if lost is not None:
            fault = f"its geometry, {lost[:60]}, is no file in the folder"
            raise DataError("opening a document was asked", fault, "Put the file into the folder of the document.")
        return {**reading, "geometry": tuple(map(str, paths))}

    def _may_read(self, path: Path) -> bool:
        return lies_in(path, [top for top in (self.files.folder, self.files.place) if top is not None])

    def _placed(self, key: str, name: str, history: list[Analysis]) -> OpenDocument:
        opened = OpenDocument(key=key, name=name, history=history, pool=self.pool, limits=self.limits)
        self._open[key] = opened
        return opened

    def keep(self, opened: OpenDocument) -> None:
        """Write a document to disk."""
        first = max(0, opened.place - _MAX_WRITTEN_STEPS)
        history = opened.history[first : opened.place + _MAX_WRITTEN_STEPS]
        kept = {
            "modalscope": VERSION,
            "name": opened.name,
            "place": opened.place - first,
            "history": [analysis_to(document) for document in history],
        }
        with replacing(self._place / f"{opened.key}.json") as temporary:
            temporary.write_text(json.dumps(kept), encoding="utf-8")

    def close(self, key: str) -> None:
        """Close a document and delete it."""
        opened = self._open.pop(key, None)
        if opened is not None:
            opened.close()
        if key.isalnum():
            (self._place / f"{key}.json").unlink(missing_ok=True)

    def end(self) -> None:
        """End all processes; documents stay on disk."""
        for opened in self._open.values():
            opened.rest()
            opened.windows.send({"type": "ended"})
        self.pool.close()


def hashed(path: Path, reading: Mapping[str, Any]) -> SourceFile:
    """Return size and hash of a file that is read with these options."""
    from modalscope.workflow.sources import source_of_file

    return source_of_file(path, reading)
