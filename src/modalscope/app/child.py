"""Where a process of its own begins: what computes is loaded there, not in the server."""

from __future__ import annotations

from multiprocessing.connection import Connection

__all__ = ["main"]


def main(pipe: Connection) -> None:
    """Load all that computes, and serve the pipe.

    Parameters
    ----------
    pipe : Connection
    """
    from modalscope.app.worker import main as serve

    serve(pipe)
