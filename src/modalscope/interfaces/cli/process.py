"""Run a command as a process: output, progress, signals and exit codes."""

from __future__ import annotations

import io
import logging
import os
import re
import shutil
import signal
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import current_thread, main_thread
from time import monotonic
from types import FrameType, SimpleNamespace
from typing import Any, NoReturn

#: The name of an output that means JSON on stdout.
STDOUT = "-"

#: Exit status for wrong use or unusable data.
EXIT_WRONG = 2

#: Exit status when some of several files could not be used.
EXIT_PARTLY = 4

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")

_STOPPED = b"modalscope: stopped; every output file is complete or unchanged"

#: Added if partial sums were saved, which happens after the first task and every ten seconds.
_GOES_ON = b"; the same command resumes from the saved sums"


def take_over() -> None:
    """Set up the process of the command line: escape characters that the terminal lacks, and stop cleanly on signals.

    The handler ends the process itself: a library could catch an exception. Signals that are ignored, as under nohup, stay ignored; but for
    Ctrl-C, which shells let background jobs ignore, where no terminal can send it.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    for number in _signals():
        if signal.getsignal(number) is not signal.SIG_IGN or (number == signal.SIGINT and not _in_foreground()):
            signal.signal(number, _stop)


def _in_foreground() -> bool:
    """Whether a terminal sends Ctrl-C to this process."""
    try:
        terminal = os.open("/dev/tty", os.O_RDONLY)
    except OSError:
        return False
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except (OSError, AttributeError):
        return False
    finally:
        os.close(terminal)


def _signals() -> list[signal.Signals]:
    """Return the handled signals that this system has."""
    return [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    """Remove half-written files, print one line, and exit with the status that shells expect."""
    for other in _signals():
        signal.signal(other, signal.SIG_IGN)
    writers = [sys.modules.get(f"modalscope.{name}") for name in ("io.atomic", "numerics.sums")]
    for path in [path for writer in writers for path in tuple(getattr(writer, "PENDING", ()))]:
        with suppress(OSError):
            path.unlink()
    kept = any(path.exists() for path in tuple(getattr(writers[-1], "UNDER_WAY", ())))
    with suppress(OSError):
        os.write(2, _STOPPED + (_GOES_ON if kept else b"") + b"\n")
    os._exit(128 + number)


#: Where messages go; `aside`: to stderr, as stdout is for a document.
VOICE = SimpleNamespace(aside=False)

#: What the command line tells beside results. Its records also reach the logger of the program, `modalscope`.
_LOG = logging.getLogger("modalscope.interfaces.cli")


class _Terminal(logging.Handler):
    """Print records: remarks on stdout, errors on stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print one record."""
        if record.levelno < logging.WARNING:
            say(getattr(record, "brief", record.getMessage()))
        elif sys.stderr is not None:
            with suppress(OSError):
                print(f"modalscope: {record.getMessage()}", file=sys.stderr)


_LOG.addHandler(_Terminal())
_LOG.setLevel(logging.INFO)


def listen(quiet: bool, verbose: bool, file: Path | None) -> None:
    """Set what is told: results alone, remarks, or the settings, too; and a file that what is told is added to, with its times."""
    _LOG.setLevel(logging.WARNING if quiet else logging.DEBUG if verbose else logging.INFO)
    log = logging.getLogger("modalscope")
    for handler in [handler for handler in log.handlers if isinstance(handler, _File)]:
        log.removeHandler(handler)  # of an earlier run in this process
        handler.close()
    if file is not None:
        handler = _File(file, encoding="utf-8")
        handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)-7s %(message)s"))
        handler.addFilter(_Once())
        log.addHandler(handler)
        log.setLevel(logging.DEBUG)


class _File(logging.FileHandler):
    """The file of --log, told from those of a program that calls this one."""


class _Once(logging.Filter):
    """Let each text pass once: a note that a run records is also printed by the command line."""

    def __init__(self) -> None:
        super().__init__()
        self._told = {""}

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the text is new."""
        text = record.getMessage().strip()
        new = text not in self._told
        self._told.add(text)
        return new


def say(*texts: object) -> None:
    """Print results, one below the other; control characters, such as codes that move the cursor, are escaped."""
    from modalscope.numerics.errors import printable

    out = sys.stderr if VOICE.aside else sys.stdout
    _LINE.clear()
    for text in texts:
        print(_shown(printable(str(text)), out), file=out)
    _LINE.draw()


#: Columns of a line that is read without turning the head.
MAX_COLUMNS = 100

#: Words that are coloured on a terminal, and their codes: green, yellow, bold yellow.
_COLOURS = {"good": "32", "look": "33", "doubtful": "35", "WARNING": "1;33"}


def _shown(text: str, out: Any) -> str:
    """Return text as a terminal shows it, sentences folded at 100 columns, with colours where it has them (see no-color.org)."""
    if out.isatty():
        columns = min(shutil.get_terminal_size().columns, MAX_COLUMNS)
        text = "\n".join(map(partial(folded, columns=columns), text.splitlines()))
    if not out.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return text
    return _COLOURED.sub(lambda found: f"\x1b[{_COLOURS[found[0]]}m{found[0]}\x1b[0m", text)


#: Grades in a table stand between blanks; a warning is the first word.
_COLOURED = re.compile(r"(?<=  )(?:good|look|doubtful)(?=  )|^WARNING(?=:)", re.MULTILINE)


def folded(line: str, columns: int) -> str:
    """Return a sentence in lines of at most `columns`, those after the first indented; a row of a table, with gaps, stays.

    Examples
    --------
    >>> print(folded("  a sentence of some words", 16))
      a sentence of
        some words
    """
    inside = line.strip()
    if len(line) <= columns or "  " in inside:
        return line
    margin = line[: len(line) - len(line.lstrip())]
    return "\n".join(textwrap.wrap(inside, columns, initial_indent=margin, subsequent_indent=f"{margin}  "))


def narrowed(table: str, columns: int) -> str:
    """Return a table whose last column is cut where a line is wider than `columns`."""
    return "\n".join(line if len(line) <= columns else f"{line[: columns - 1]}…" for line in table.splitlines())


def remark(*texts: object) -> None:
    """Print remarks on the result, unless --quiet was given."""
    for text in texts:
        _LOG.info("%s", text)


def note(*texts: object) -> None:
    """Print notes on the result, one line each, unless --quiet was given; with --verbose, and in the log, they have their reasons."""
    verbose = _LOG.isEnabledFor(logging.DEBUG)
    for text in map(str, texts):
        _LOG.info("%s", text, extra={"brief": text if verbose else brief(text)})


#: A reason in brackets; a remedy begins with "else:".
_REASON = re.compile(r" \((?!else:)[^()]*\)(?=[\s,;.:]|$)")


def brief(text: str, columns: int = MAX_COLUMNS) -> str:
    """Return a note without the reasons in brackets, and with the clauses that fit into a line: --verbose prints the others.

    Examples
    --------
    >>> brief("Residual not white (lag-1 correlation 0.93): intervals widened")
    'Residual not white: intervals widened'
    >>> brief("hit 3: a second pulse, 1164 samples later. It is used, as its force is recorded", 60)
    'hit 3: a second pulse, 1164 samples later (-v)'
    """
    text = _REASON.sub("", text)
    if len(text) <= columns:
        return text
    room = text[: columns - len(" (-v)") + 1]
    ends = [max(map(room.rfind, signs)) for signs in ((". ", "; ", " (else:"), (": ", ", "), (" ",))]
    return f"{room[: next((end for end in ends if end > columns / 3), len(room) - 1)]} (-v)"


def explain(*texts: object) -> None:
    """Print the settings behind the result, if --verbose was given."""
    for text in texts:
        _LOG.debug("%s", text)


def complain(text: object) -> None:
    """Print one line on stderr, if the process has one."""
    from modalscope.numerics.errors import shortened

    _LOG.error("%s", " ".join(shortened(str(text)).split()))


def hang_up() -> None:
    """Discard the remaining output: its reader has gone, and Python would report that at its end."""
    if sys.stdout is sys.__stdout__ and sys.stdout is not None:
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


#: Seconds of a stage from which on its end is told.
_TOLD_SECONDS = 1.0


@contextmanager
def progress(what: str, unit: str = "order", at_once: bool = True) -> Iterator[Callable[[int, int], None]]:
    """Name a stage while the block runs, with a bar from the first `show(done, total)` on; nothing if stderr is no terminal.

    `unit`: what is counted. `at_once`: whether the stage begins before it counts. What took more than a second ends with a line that gives
    the time; with --verbose each stage within it has such a line, too, and its own time is without these. The work of other threads has no
    line, and no stage has one within work that is counted.
    """
    quiet = not _on_terminal() or not _LOG.isEnabledFor(logging.INFO)
    if quiet or _LINE.counts or current_thread() is not main_thread():
        yield lambda done, total: None
        return
    start, every = monotonic() if at_once else None, _LOG.isEnabledFor(logging.DEBUG)
    told = every or not _LINE.shown
    with _LINE.named(what if at_once else "") as stage:

        def show(done: int, total: int) -> None:
            nonlocal start
            start = monotonic() if start is None else start
            _LINE.count(what, unit, done, total)
            if done == total:
                _LINE.draw()

        yield show
    took = 0.0 if start is None else monotonic() - start - (stage.within if at_once and every else 0.0)
    if told and took > _TOLD_SECONDS:
        _LINE.clear()
        print(f"{what}: done in {took:.1f} s", file=sys.stderr)
        _LINE.draw()


def _on_terminal() -> bool:
    """Whether stderr is a terminal."""
    return sys.stderr is not None and sys.stderr.isatty()


@dataclass
class _Stage:
    """The name of a stage, and the seconds of stages within it."""

    name: str
    within: float = 0.0


class _Line:
    """The line of a terminal that says what is being done: the name of the innermost stage that has one, or a bar of what counts."""

    def __init__(self) -> None:
        self._stages: list[_Stage] = []
        self._bar: Any = None
        self._width = 0

    @property
    def counts(self) -> bool:
        """Whether a bar is shown."""
        return self._bar is not None

    @property
    def shown(self) -> str:
        """The name of the innermost stage that has one."""
        return next((stage.name for stage in reversed(self._stages) if stage.name), "")

    @contextmanager
    def named(self, what: str) -> Iterator[_Stage]:
        """Show the name of a stage while the block runs; then again that of the stage around it."""
        stage, start = _Stage(what), monotonic()
        self._stages.append(stage)
        self.draw()
        try:
            yield stage
        finally:
            self._stages.pop()
            for around in self._stages[-1:]:
                around.within += monotonic() - start
            self.draw()

    def count(self, what: str, unit: str, done: int, total: int) -> None:
        """Show how much of a stage is done."""
        if self._bar is None or self._bar.desc != what:
            from tqdm import tqdm  # what does not count goes without

            self.clear()
            self._bar = tqdm(desc=what, unit=unit, initial=done, total=total, file=sys.stderr, leave=False)
        self._bar.total = total
        self._bar.update(done - self._bar.n)

    def clear(self) -> None:
        """Remove what is shown."""
        if self._bar is not None:
            self._bar.close()
        if self._width:
            print(f"\r{' ' * self._width}\r", end="", file=sys.stderr, flush=True)
        self._bar, self._width = None, 0

    def draw(self) -> None:
        """Show the name of the innermost stage that has one."""
        self.clear()
        if self.shown:
            self._width = len(self.shown) + 4
            print(f"{self.shown} ...", end="", file=sys.stderr, flush=True)


_LINE = _Line()
