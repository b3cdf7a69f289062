"""Build the parser of a command: errors in one line, and options that several commands share."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from modalscope.cli.process import EXIT_WRONG


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line on stderr, and which takes words whole: --order is never taken for --orders."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**{"allow_abbrev": False, **given})

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Read what is known; the rest is an error, with the nearest word that is."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            given = sys.argv[1:] if args is None else list(args)
            hint = self._hint(unknown[0]) if unknown[0].startswith("-") else self._form_before(given, unknown[0])
            self.error(f"unknown: {' '.join(unknown)}{hint}")
        return options, unknown

    def _form_before(self, given: list[str], word: str) -> str:
        """Return how the option is written that a word too many stands behind."""
        before = [each for each in given[: given.index(word)] if each.startswith("-")] if word in given else []
        action = self._option_string_actions.get(before[-1]) if before else None
        if action is None or not action.metavar:
            return self._hint(word)
        form = action.metavar if isinstance(action.metavar, str) else " ".join(action.metavar)
        return f" (written {before[-1]} {form}; see {self.prog} --help)"

    def _hint(self, word: str) -> str:
        from difflib import get_close_matches

        known = [option for action in self._actions for option in action.option_strings if option.startswith("--")]
        near = get_close_matches(word.partition("=")[0], known, n=2)
        return f" (did you mean {' or '.join(near)}?)" if near else f" (see {self.prog} --help)"

    def error(self, message: str) -> NoReturn:
        """Stop with the message on one line."""
        from modalscope.numerics.errors import shortened

        self.exit(EXIT_WRONG, f"{self.prog}: {' '.join(shortened(message).split())}\n")


#: The list that a command adds its parser to.
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def add_file(parser: argparse.ArgumentParser) -> None:
    """Take the file to work on, and how its arrays are meant."""
    parser.add_argument(
        "file", type=Path, help="universal file, table (.csv, .txt, .xlsx ...), .npz, .mat, .h5, .wav ..."
    )
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
    for side, what in (("input", "forces act"), ("output", "sensors are")):
        parser.add_argument(
            f"--{side}-dofs",
            nargs="+",
            metavar="DOFS",
            help=f"where the {what}, such as 1:+Z,2:+Z: once for all files, or an item for each",
        )
    add_memory(parser)


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Take who sums over records that stay in their file, and where partial sums are kept."""
    group = parser.add_argument_group("records that stay in their file (.h5, .zarr)")
    group.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of a Dask scheduler whose workers share the work, such as tcp://host:8786; or local:4, four processes here",
    )
    group.add_argument(
        "--resume", type=Path, metavar="FOLDER", help="keep partial sums there, and go on with those that are"
    )


def add_memory(parser: argparse.ArgumentParser) -> None:
    """Take what reading may take of the memory."""
    parser.add_argument(
        "--geometry", metavar="FILE", help="where the sensors are: a table node,x,y,z, a universal file or a mesh"
    )
    parser.add_argument("--lines", metavar="FILE", help="lines of the geometry: a table of pairs of nodes")
    add_tables(parser)
    parser.add_argument(
        "--max-memory",
        type=memory,
        metavar="SIZE",
        help="memory that reading one file, and work on it, may take, such as 8GB (reading: 500 MB, or twenty times the file)",
    )


def add_tables(parser: argparse.ArgumentParser) -> None:
    """Take what a table, or a file of bare numbers, does not say itself."""
    group = parser.add_argument_group("tables and bare numbers")
    group.add_argument(
        "--sampling-rate", type=float, metavar="HZ", help="samples per second, when the file does not say"
    )
    group.add_argument("--columns", metavar="ROLES", help='what the columns are, such as "time=1,in=2,out=3-9"')
    group.add_argument(
        "--ignore",
        action="append",
        metavar="COL",
        help="a column (number or name) or named array to leave; may be repeated",
    )
    group.add_argument(
        "--units",
        metavar="COL=UNIT",
        help='units of columns or channels, such as "2=N,AccA=m/s^2" or "outputs=100 mV/g,inputs=lbf"; they are converted to SI',
    )
    group.add_argument(
        "--resample", metavar="HZ", help='even samples out of uneven times: a rate, or "auto" for that of the samples'
    )
    group.add_argument("--rows", metavar="FIRST-LAST", help="rows of a table to take, from 1, such as 1101-4000")
    group.add_argument("--skip", type=int, metavar="N", help="lines to leave at the top of a text")
    group.add_argument("--sheet", metavar="NAME", help="sheet of a workbook")
    group.add_argument("--delimiter", metavar="SIGN", help='what parts columns: one sign, "tab" or "space"')
    group.add_argument("--decimal", choices=(".", ","), help="the decimal sign")
    group.add_argument("--transpose", action="store_true", help="rows are channels: exchange rows and columns")


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
    """Take orders, band (several where `bands` says so), way and the channels left out."""
    parser.add_argument("--orders", metavar="A:B:STEP", help="orders to try, both ends included, such as 2:60:2")
    add_band(parser, several=bands)
    add_part(parser)


def add_cell(parser: argparse.ArgumentParser) -> None:
    """Take a cell of the table."""
    parser.add_argument(
        "--method", help="a row of the table (see: modalscope methods); by default the one that suits the data"
    )
    parser.add_argument("--domain", help="time, z or s; by default the one that suits the data")


def add_band(parser: argparse.ArgumentParser, *, several: bool = False) -> None:
    """Take a band, or several."""
    parser.add_argument(
        "--band",
        nargs=2,
        type=float,
        action="append" if several else "store",
        metavar=("F1", "F2"),
        help="lowest and highest frequency, Hz" + ("; given several times, the bands are merged" if several else ""),
    )


def add_part(parser: argparse.ArgumentParser) -> None:
    """Take the way from records with inputs, which of their outputs come late, and the channels left out."""
    parser.add_argument(
        "--route",
        help="from records with inputs: auto, records (their own lines), frf, markov or subspace; by default what suits them",
    )
    parser.add_argument(
        "--delays",
        nargs="+",
        metavar="DOF=SAMPLES",
        help="outputs that come late after the forces, such as y3=12, or none of them: none; by default what the records show",
    )
    parser.add_argument("--exclude", nargs="+", metavar="DOF", help="channels to leave out")
