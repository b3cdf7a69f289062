"""The commands: files in, results out; no mathematics."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextvars import copy_context

from modalscope.interfaces.cli.process import EXIT_WRONG, STDOUT, VOICE, complain, hang_up, listen, progress, take_over

__all__ = ["main"]

#: Exit status after Ctrl-C.
_STOPPED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return 0, or 2 with one line on stderr for wrong use or unusable data.

    Without arguments those of the process are used, and its signals and streams are set up.
    """
    if arguments is None:
        take_over()
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        copy_context().run(_run, words)
    except ValueError as error:
        from modalscope.data import DataError  # a ValueError; --help does not load it

        if not isinstance(error, DataError):
            raise
        complain(error.args[0])
        return EXIT_WRONG
    except BrokenPipeError:  # the reader has gone, as with `| head`; files are already written
        hang_up()
    except OSError as error:
        hang_up()
        complain(f"the system refuses: {(error.strerror or str(error)).lower()}")
        return EXIT_WRONG
    except MemoryError:
        complain("out of memory; use fewer orders, channels, lines or samples")
        return EXIT_WRONG
    except KeyboardInterrupt:
        complain("stopped; no file was written")
        return _STOPPED
    return 0


def _run(words: Sequence[str]) -> None:
    """Run the command; its output is flushed when this returns."""
    import argparse
    import shlex

    from modalscope.interfaces.cli.commands import build_parser
    from modalscope.interfaces.cli.config import command_first, configured
    from modalscope.interfaces.cli.parser import expanded
    from modalscope.numerics.errors import AT_TERMINAL
    from modalscope.numerics.progress import stages_shown

    AT_TERMINAL.set(True)
    command_line = shlex.join(["modalscope", *words])
    parser = build_parser()
    try:
        options = parser.parse_args(configured(command_first(words)), argparse.Namespace(command_line=command_line))
        if hasattr(options, "files"):
            options.files = expanded(options.files)
        listen(options.quiet, options.verbose, options.log)
        VOICE.aside = STDOUT in map(str, getattr(options, "outputs", ()))
        with stages_shown(progress):
            options.run(options)
    finally:
        if sys.stdout is not None:
            sys.stdout.flush()
