"""What a page may take: sizes, counts and times."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Limits"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of one server.

    Parameters
    ----------
    upload : int
        Bytes of one uploaded file.
    body : int
        Bytes of any other request.
    documents : int
        Documents that are open at a time.
    workers : int
        Processes at a time; the one that waited longest is ended for another.
    spare : bool
        Whether a process waits, warm, for the next document.
    history : int
        Steps that can be undone.
    kept : int
        Bytes of finished stages that a document keeps.
    patience : float
        Seconds from a cancel to the end of the process.
    seconds : float
        The longest job.
    listeners : int
        Windows on one document.
    """

    upload: int = 2 << 30
    body: int = 1 << 20
    documents: int = 100
    workers: int = 8
    spare: bool = True
    history: int = 500
    kept: int = 256 << 20
    patience: float = 0.3
    seconds: float = 3600.0
    listeners: int = 64
