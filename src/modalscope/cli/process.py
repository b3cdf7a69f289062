"""Run a command as a process: output, progress, signals and exit codes."""

from __future__ import annotations

import io
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

#: The name of an output that means JSON on stdout.
STDOUT = "-"

#: Exit status for wrong use or unusable data.
EXIT_WRONG = 2

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")

_STOPPED = b"modalscope: stopped; an output file is complete or what it was before"

#: Said where partial sums were kept, which happens every ten seconds.
_GOES_ON = b"; the same command goes on from the sums kept so far"


def take_over() -> None:
    """Prepare the process of the command line: characters that a terminal lacks are escaped, and signals end it cleanly.

    The handler ends the process itself, without an exception that some library could take for one of its own. What was ignored
    before, as by nohup, stays ignored.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    for number in _numbers():
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _stop)


def _numbers() -> list[signal.Signals]:
    """Return the signals that this system has."""
    return [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    """Take half-written files away, say one line, and end with the status that shells expect."""
    for other in _numbers():
        signal.signal(other, signal.SIG_IGN)
    writers = [sys.modules.get(f"modalscope.{name}") for name in ("io.atomic", "numerics.sums")]
    for path in [path for writer in writers for path in tuple(getattr(writer, "PENDING", ()))]:
        with suppress(OSError):
            path.unlink()
    kept = any(path.exists() for path in tuple(getattr(writers[-1], "UNDER_WAY", ())))
    with suppress(OSError):
        os.write(2, _STOPPED + (_GOES_ON if kept else b"") + b"\n")
    os._exit(128 + number)


class Voice:
    """How much the command says, and where: the result, side remarks, and how it was found.

    Attributes
    ----------
    quiet : bool
        Side remarks and progress are left out.
    verbose : bool
        What was chosen, with which values, is said, too.
    aside : bool
        Stdout is for a document: all else goes to stderr.
    """

    quiet: bool = False
    verbose: bool = False
    aside: bool = False


VOICE = Voice()


def say(text: object) -> None:
    """Print a result; what is no sign of its own, such as the codes that move a terminal's cursor, is escaped."""
    from modalscope.numerics.errors import printable

    print(printable(str(text)), file=sys.stderr if VOICE.aside else sys.stdout)


def remark(text: object) -> None:
    """Print what is to be known beside the result, unless quiet was asked."""
    if not VOICE.quiet:
        say(text)


def explain(text: object) -> None:
    """Print how the result was found, where that was asked."""
    if VOICE.verbose:
        say(text)


def complain(text: object) -> None:
    """Print one line on stderr, if there is one."""
    from modalscope.numerics.errors import shortened

    if sys.stderr is not None:
        with suppress(OSError):
            print(f"modalscope: {' '.join(shortened(str(text)).split())}", file=sys.stderr)


def hang_up() -> None:
    """Send what is still to be printed nowhere: nobody reads it, and Python would complain of that when it ends."""
    if sys.stdout is sys.__stdout__ and sys.stdout is not None:
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


# ------------------------------------------------------------------------------------------------------------ progress
# Progress on stderr, for a person who waits.


@contextmanager
def progress(what: str, unit: str = "order") -> Iterator[Callable[[int, int], None]]:
    """Show a bar while the block runs: `show(done, total)`; nothing when stderr is not a terminal a person looks at."""
    from tqdm import tqdm

    with tqdm(desc=what, unit=unit, file=sys.stderr, leave=False, disable=VOICE.quiet or None) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show
