"""What the parser of every command is made of: errors in one line, and what several commands let users write."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from modalscope.cli.process import EXIT_WRONG

__all__ = [
    "Commands",
    "Parser",
    "add_choices",
    "add_common",
    "add_file",
    "add_files",
    "add_force",
    "add_output",
    "add_outputs",
    "add_reading",
]


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line on stderr, and which takes words whole: --order is never taken for --orders."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**{"allow_abbrev": False, **given})

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Read what is known; the rest is an error, with the nearest word that is."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unknown: {' '.join(unknown)}{self._hint(unknown[0])}")
        return options, unknown

    def _hint(self, word: str) -> str:
        from difflib import get_close_matches

        known = [option for action in self._actions for option in action.option_strings if option.startswith("--")]
        near = get_close_matches(word.partition("=")[0], known, n=2)
        return f" (did you mean {' or '.join(near)}?)" if near else f" (see {self.prog} --help)"

    def error(self, message: str) -> NoReturn:
        """Stop with the message on one line."""
        from modalscope.model.errors import shortened

        self.exit(EXIT_WRONG, f"{self.prog}: {' '.join(shortened(message).split())}\n")


#: The list that a command adds its parser to.
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def add_file(parser: argparse.ArgumentParser) -> None:
    """Take the file to work on, and how its arrays are meant."""
    parser.add_argument("file", type=Path, help="universal file, .npz, .mat, .h5 or .csv")
    add_reading(parser)


def add_files(parser: argparse.ArgumentParser) -> None:
    """Take the files to work on: one, or the parts of one test."""
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="universal file, .npz, .mat, .h5 or .csv; several are parts of one test: of the same outputs runs, of others setups",
    )
    add_reading(parser)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Take what a file does not say itself."""
    parser.add_argument(
        "--quantity", help="displacement, velocity or acceleration, when the file does not say or is wrong"
    )
    parser.add_argument(
        "--rename",
        action="append",
        metavar="OLD=NEW",
        help="name of an array in the file and what it is (.npz, .mat, .h5)",
    )
    parser.add_argument(
        "--axes",
        action="append",
        metavar="NAME=AXES",
        help="order of an array's axes in the file, such as values=inputs,outputs,lines",
    )
    parser.add_argument(
        "--max-memory",
        type=memory,
        metavar="SIZE",
        help="memory that reading one file may take, such as 8GB (500 MB, or twenty times the file)",
    )


def memory(text: str) -> int:
    """Read `8GB`, `500MB` or a number of bytes.

    Examples
    --------
    >>> memory("8GB"), memory("1.5 MB"), memory("4096")
    (8000000000, 1500000, 4096)
    """
    number = text.strip().upper().removesuffix("B").strip()
    times = {"K": 10**3, "M": 10**6, "G": 10**9, "T": 10**12}.get(number[-1:], 1)
    size = float(number[:-1] if times > 1 else number) * times
    if not 1 <= size < float("inf"):
        raise ValueError
    return int(size)


def add_output(parser: argparse.ArgumentParser, what: str) -> None:
    """Take the file to write, and whether it may take the place of one that modalscope did not write."""
    parser.add_argument("-o", "--output", type=Path, help=what)
    add_force(parser)


def add_outputs(parser: argparse.ArgumentParser, what: str) -> None:
    """Take the files to write, any number, and whether they may take the place of what modalscope did not write."""
    parser.add_argument(
        "-o",
        "--output",
        dest="outputs",
        action="append",
        type=Path,
        default=[],
        metavar="FILE",
        help=f"{what}; may be given several times, and - is JSON on stdout",
    )
    add_force(parser)


def add_common(parser: argparse.ArgumentParser) -> None:
    """Take what every command takes: how much is said, and a file of options."""
    parser.add_argument("-q", "--quiet", action="store_true", help="say the result alone: no remarks, no progress")
    parser.add_argument("-v", "--verbose", action="store_true", help="say what was chosen, with all values, too")
    parser.add_argument(
        "--config", metavar="TOML", help="file of options, a table a command; what is written here counts more"
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    """Take whether a file that modalscope did not write may be replaced."""
    parser.add_argument("--force", action="store_true", help="replace a file that modalscope did not write, too")


def add_choices(parser: argparse.ArgumentParser, *, bands: bool = False) -> None:
    """Take orders, band (several where `bands` says so) and the channels left out."""
    parser.add_argument("--orders", metavar="A:B:STEP", help="orders to try, both ends included, such as 2:60:2")
    parser.add_argument(
        "--band",
        nargs=2,
        type=float,
        action="append" if bands else "store",
        metavar=("F1", "F2"),
        help="lowest and highest frequency, Hz" + ("; given several times, the bands are merged" if bands else ""),
    )
    parser.add_argument(
        "--route",
        help="from records with inputs: auto, records (their own lines), frf, markov or subspace; by default what suits them",
    )
    parser.add_argument("--exclude", nargs="+", metavar="DOF", help="channels to leave out")
