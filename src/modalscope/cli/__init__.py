"""The commands: files in, results out; no mathematics."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from modalscope.cli.parser import EXIT_WRONG, build_parser
from modalscope.cli.reading import parse_orders
from modalscope.model.checks import DataError

__all__ = ["main", "parse_orders"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it is done, 2 with one line on stderr for wrong use or unusable data."""
    options = build_parser().parse_args(arguments)
    try:
        options.run(options)
    except DataError as error:
        print(f"modalscope: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_WRONG
    except BrokenPipeError:  # the reader of our output has enough, `| head` for instance
        sys.stderr.close()
    except KeyboardInterrupt:
        print("modalscope: stopped; no file was written", file=sys.stderr)
        return 130
    return 0
