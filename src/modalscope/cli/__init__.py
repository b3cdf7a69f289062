"""The commands: files in, results out; no mathematics."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence

from modalscope.cli.commands import build_parser
from modalscope.cli.parser import EXIT_WRONG

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it is done, 2 with one line on stderr for wrong use or unusable data."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    options = build_parser().parse_args(words, argparse.Namespace(command_line=shlex.join(["modalscope", *words])))
    try:
        options.run(options)
    except ValueError as error:
        from modalscope.model import DataError  # a ValueError: an answer to a question alone does not load it

        if not isinstance(error, DataError):
            raise
        print(f"modalscope: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_WRONG
    except BrokenPipeError:  # the reader of our output has enough, `| head` for instance
        sys.stderr.close()
    except KeyboardInterrupt:
        print("modalscope: stopped; no file was written", file=sys.stderr)
        return 130
    return 0
