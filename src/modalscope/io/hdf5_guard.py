"""Check an HDF5 file before it is read: by its checksum, or by a walk through it in another process.

Files that are written here end in a seal, the SHA-256 of all before it, behind what HDF5 takes for the file. Where the seal
holds, nothing is damaged; where it does not, something is. Files without one are walked by a Python of their own first
(`hdf5_walk`). The seal finds damage, not malice: what leads out of a file is refused in both cases.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

from modalscope.data import DataError
from modalscope.io import hdf5_walk
from modalscope.io.limits import Room

_MARK = b"\nmodalscope sha256 "
_DIGEST = 64
#: Seconds, and bytes a second, that a walk may take of a processor; and of the clock, which other programs hold up.
_SECONDS, _CLOCK = (2, 50_000_000), (20, 10_000_000)
#: An array, a piece of it as it is packed, and one as it is inflated.
_COPIES = 3


def seal(path: Path) -> None:
    """Append the checksum of a file that is complete."""
    with path.open("r+b") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(0, os.SEEK_END)
        file.write(_MARK + digest.encode())


def check_hdf5(path: Path, room: Room, streamed: str = "") -> None:
    """Raise a `DataError` where a file is damaged, leads out of itself, or is larger than it may be.

    `room`: what its arrays may take. `streamed`: the dataset that is read stretch by stretch: it may have any size, in pieces of a modest
    one.

    Raises
    ------
    DataError
    """
    try:
        answer = (_here if _is_sealed(path) or not _python() else _apart)(path, room, streamed)
    except UnicodeEncodeError:
        answer = ["its name has characters that no text has", "Rename the file."]
    if answer:
        raise DataError(
            f"reading {path.name} as HDF5 was asked",
            answer[0],
            answer[1] or "If you trust the file, raise the limit: --max-memory, or modalscope.io.set_max_memory.",
        )


def _is_sealed(path: Path) -> bool:
    """Whether the file carries a seal that holds."""
    size = path.stat().st_size - len(_MARK) - _DIGEST
    if size < 0:
        return False
    digest = hashlib.sha256()
    with path.open("rb") as file:
        file.seek(size)
        mark, written = file.read(len(_MARK)), file.read(_DIGEST)
        if mark != _MARK:
            return False
        file.seek(0)
        while size > 0:
            part = file.read(min(size, 1 << 20))
            digest.update(part)
            size -= len(part)
    if digest.hexdigest().encode() != written:
        raise DataError(
            f"reading {path.name} as HDF5 was asked",
            "its contents are not those that its checksum was made of: it is damaged",
            "Copy it again, or write it again.",
        )
    return True


def _python() -> str:
    """Return the program that runs this Python; none where Python is a part of another program."""
    program = sys.executable or ""
    return program if Path(program).stem.lower().startswith(("python", "pypy")) else ""


def _here(path: Path, room: Room, streamed: str = "") -> list[str]:
    try:
        hdf5_walk.walk(str(path), room.left, streamed)
    except hdf5_walk.Refused as refused:
        return [refused.found, refused.change]
    return []


def _apart(path: Path, room: Room, streamed: str = "") -> list[str]:
    """Walk in a Python of its own, which finds h5py where this one does and nothing else."""
    seconds, clock = (first + room.size // rate for first, rate in (_SECONDS, _CLOCK))
    numbers = (room.left, seconds, _COPIES * room.left)
    command = [_python(), "-P", "-S", "-B", hdf5_walk.__file__, str(path), *map(str, numbers), streamed]
    folders = os.pathsep.join(folder for folder in sys.path if folder)
    environment = os.environ | {"PYTHONPATH": folders, "OPENBLAS_NUM_THREADS": "1"}  # a thread is much memory
    try:
        done = subprocess.run(command, env=environment, capture_output=True, timeout=clock, check=False)
    except subprocess.TimeoutExpired:
        return [f"the HDF5 library did not come to an end within {clock} s: it is damaged", "Copy or write it again."]
    try:
        answer: list[str] = json.loads(done.stdout)
    except ValueError:
        found = f"the HDF5 library breaks off in it or comes to no end (status {done.returncode}): it is damaged"
        return [found, "Copy or write the file again."]
    return answer
