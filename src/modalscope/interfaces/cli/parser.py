"""Parse the command line: errors on one line, and the options that several commands share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from modalscope.interfaces.cli.process import EXIT_WRONG

#: Titles of groups of options.
_READING, _TABLES = "what the file does not state", "tables and bare numbers"
_STORED, _COMMON = "records that stay in their file (.h5, .zarr)", "all commands"
_EXPERT = "expert: the data matrix of the method (see the table of methods)"

#: The groups that the help of a command lists last, and what only `--help expert` lists: whole groups, and options of others.
_LAST = (_READING, _TABLES, _STORED, _EXPERT, _COMMON)
_RARE_GROUPS = (_STORED, _EXPERT)
_RARE = (
    "allow-outside axes config conjugate decimal delays delimiter exact-nodes lines log max-memory reciprocal rename route skip "
    "transpose"
)


class _Help(argparse.Action):
    """Print the help of a command: what most need, or with `expert` all options."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        """Print the help and exit."""
        rare, usual = {f"--{name}" for name in _RARE.split()}, values != "expert"
        members = [
            (action, group.title in _RARE_GROUPS) for group in parser._action_groups for action in group._group_actions
        ]
        hidden = [action for action, few in members if usual and (few or rare & set(action.option_strings))]
        for action in hidden:
            action.help = argparse.SUPPRESS
        if hidden:
            parser.epilog = f"{len(hidden)} more options: {parser.prog} --help expert"
        parser.print_help()
        parser.exit()


class Parser(argparse.ArgumentParser):
    """A parser with one-line errors that accepts no abbreviations: --order does not match --orders."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**{"allow_abbrev": False, **given, "add_help": False})
        if given.get("add_help", True):
            words = "print this help; --help expert: with all options"
            self.add_argument(
                "-h", "--help", action=_Help, nargs="?", metavar="expert", default=argparse.SUPPRESS, help=words
            )

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse the arguments; an unknown one is an error that names the nearest known option."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            given = sys.argv[1:] if args is None else list(args)
            hint = self._hint(unknown[0]) if unknown[0].startswith("-") else self._form_before(given, unknown[0])
            self.error(f"unknown: {' '.join(unknown)}{hint}")
        return options, unknown

    def _form_before(self, given: list[str], word: str) -> str:
        """Return the form of the option that precedes a surplus word."""
        options = [text for text in given[: given.index(word)] if text.startswith("-")] if word in given else []
        action = self._option_string_actions.get(options[-1]) if options else None
        if action is None or not action.metavar:
            return self._hint(word)
        form = action.metavar if isinstance(action.metavar, str) else " ".join(action.metavar)
        return f" (written {options[-1]} {form}; see {self.prog} --help)"

    def _hint(self, word: str) -> str:
        from difflib import get_close_matches

        options = [option for action in self._actions for option in action.option_strings if option.startswith("--")]
        near = get_close_matches(word.partition("=")[0], options, n=2)
        return f" (did you mean {' or '.join(near)}?)" if near else f" (see {self.prog} --help)"

    def error(self, message: str) -> NoReturn:
        """Exit with the message on one line."""
        from modalscope.numerics.errors import shortened

        self.exit(EXIT_WRONG, f"{self.prog}: {' '.join(shortened(message).split())}\n")

    def group(self, title: str) -> Callable[..., argparse.Action]:
        """Return what adds an option to the group of this title; the help lists groups in the order of their first option."""
        groups = (group for group in self._action_groups if group.title == title)
        return (next(groups, None) or self.add_argument_group(title)).add_argument

    def arrange(self) -> None:
        """Print the files of a command in its usage, its options in groups alone, and the groups that few need last."""
        last = {title: k for k, title in enumerate(_LAST)}
        self._action_groups.sort(key=lambda group: last.get(group.title or "", -1))
        told = [action for action in self._actions if not action.option_strings]
        formatter = self._get_formatter()
        formatter.add_usage(None, told, [], "")
        words = formatter.format_help().split()[len(self.prog.split()) :]
        self.usage = " ".join(["%(prog)s", "[options]", *words])


def add_file(parser: Parser) -> None:
    """Add the data file and the reading options."""
    parser.add_argument("file", type=Path, help="data file: .uff, .csv, .txt, .xlsx, .npz, .mat, .h5, .wav ...")
    add_reading(parser)


def add_files(parser: Parser) -> None:
    """Add the data files of one test and the reading options."""
    words = (
        "data: .uff, .csv, .npz, .mat ...; several files of one test are runs (same outputs) or setups (other outputs)"
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help=words)
    add_reading(parser)


def add_reading(parser: Parser) -> None:
    """Add the options for what a file does not state."""
    add = parser.group(_READING)
    add("--quantity", help="displacement, velocity or acceleration, if the file does not state it or is wrong")
    role = "role of a named array, such as y=outputs (.npz, .mat, .h5)"
    add("--rename", action="append", metavar="OLD=NEW", help=role)
    example = "such as values=inputs,outputs,lines"
    add("--axes", action="append", metavar="NAME=AXES", help=f"order of the axes of a named array, {example}")
    for side, what in (("input", "forces"), ("output", "sensors")):
        text = f"nodes and directions of the {what}, such as 1:+Z,2:+Z: one item for all files, or one per file"
        add(f"--{side}-dofs", nargs="+", metavar="DOFS", help=text)
    add_geometry(parser)


def add_geometry(parser: Parser) -> None:
    """Add the geometry, the options of tables and the memory limit of reading."""
    add = parser.group(_READING)
    add("--geometry", metavar="FILE", help="sensor positions: a table node,x,y,z, a universal file or a mesh")
    add("--lines", metavar="FILE", help="lines of the geometry: a table of pairs of nodes")
    add("--exact-nodes", action="store_true", help="place no channel by its number alone (P3 at node 3)")
    add_tables(parser)
    limit = "memory limit for reading and processing a file, such as 8GB (reading: 500 MB or 20 times the file)"
    add("--max-memory", type=memory, metavar="SIZE", help=limit)


def add_tables(parser: Parser) -> None:
    """Add the options for what a table, or a file of bare numbers, does not state."""
    add = parser.group(_TABLES)
    add("--sampling-rate", type=float, metavar="HZ", help="sampling rate in Hz, if the file does not state it")
    add("--columns", metavar="ROLES", help='roles of the columns, such as "time=1,in=2,out=3-9"')
    add("--ignore", action="append", metavar="COL", help="column (number or name) or array to ignore; repeatable")
    units = 'units of columns or channels, such as "2=N,AccA=m/s^2" or "outputs=100 mV/g,inputs=lbf"; converted to SI'
    add("--units", metavar="COL=UNIT", help=units)
    add("--resample", metavar="HZ", help='resample uneven times to this rate, or to their mean rate ("auto")')
    add("--rows", metavar="FIRST-LAST", help="rows of a table to read, counted from 1, such as 1101-4000")
    add("--skip", type=int, metavar="N", help="lines to skip at the top of a text file")
    several = "the one to read of several tests in a file: a sheet, a group, an experiment, a block or a set of arrays"
    add("--test", "--sheet", dest="sheet", metavar="NAME", help=several)
    add("--delimiter", metavar="SIGN", help='column separator: one character, "tab" or "space"')
    add("--decimal", choices=(".", ","), metavar="SIGN", help="decimal separator: . or ,")
    add("--conjugate", action="store_true", help="take complex conjugates of responses (time convention exp(-j w t))")
    add("--transpose", action="store_true", help="channels are rows: exchange rows and columns")


def memory(text: str) -> int:
    """Return `8GB`, `500MB` or a number of bytes as bytes.

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


#: Options of the data matrix and what they take; a method that has no use for one refuses it.
EXPERT: dict[str, dict[str, Any]] = {
    "block_rows": {"type": int, "metavar": "N", "help": "block rows of H(0); in z and s the degree of its polynomials"},
    "block_columns": {"type": int, "metavar": "N", "help": "block columns of H(0), or samples in the window"},
    "row_shifts": {"metavar": "K,K,...", "help": "shifts of the block rows, such as 0,1,2,4,8 (Eq. 20)"},
    "column_shifts": {"metavar": "K,K,...", "help": "shifts of the block columns"},
    "form": {"choices": ("observable", "controllable", "smaller"), "help": "the side that the shift is read off"},
    "source": {"choices": ("samples", "elimination"), "help": "where transfer functions come from, in z"},
    "weighting": {"choices": ("cva",), "help": "of projected records: canonical variates"},
    "factorization": {
        "choices": ("auto", "dense", "gram", "randomized", "lanczos"),
        "help": "how singular vectors are found",
    },
}


def add_expert(parser: Parser) -> None:
    """Add the options of the data matrix."""
    add = parser.group(_EXPERT)
    for name, form in EXPERT.items():
        add(f"--{name.replace('_', '-')}", **form)


def add_workers(parser: Parser) -> None:
    """Add the executor and the folder of partial sums for stored records."""
    add = parser.group(_STORED)
    add("--scheduler", metavar="ADDRESS", help="Dask scheduler, such as tcp://host:8786; local:4 starts four processes")
    add("--resume", type=Path, metavar="FOLDER", help="folder for partial sums: an interrupted job goes on from them")


def add_outputs(parser: Parser, what: str) -> None:
    """Add the output files, any number, and `--force`."""
    form: dict[str, Any] = {"dest": "outputs", "action": "append", "type": Path, "default": [], "metavar": "FILE"}
    parser.group("output")("-o", "--output", **form, help=f"{what}; repeatable; - writes JSON to stdout")
    add_force(parser)


def add_pictures(parser: Parser) -> None:
    """Add whether the pictures of a result are written, too."""
    words = "also write diagram, shapes, AutoMAC and strongest response as files named after the first -o"
    parser.group("output")("--pictures", choices=("png", "svg", "pdf"), help=words)
    words = "head of an .html report: project, structure, operator, sensors, conclusion"
    parser.group("output")("--header", type=Path, metavar="FILE.toml", help=words)


def add_outside(parser: Parser) -> None:
    """Add whether the geometry of a document is read wherever the document says that it lies."""
    words = "of an .analysis.json: read its geometry also outside of the folders of the document and of the data"
    parser.add_argument("--allow-outside", action="store_true", help=words)


def add_force(parser: Parser) -> None:
    """Add whether a file that modalscope did not write may be replaced."""
    parser.group("output")("--force", action="store_true", help="replace a file that modalscope did not write")


def add_common(parser: Parser) -> None:
    """Add the options of every command: verbosity and a file of options."""
    add = parser.group(_COMMON)
    add("-q", "--quiet", action="store_true", help="print the result only: no remarks, no progress")
    add("-v", "--verbose", action="store_true", help="also print all settings that were chosen")
    add("--log", type=Path, metavar="FILE", help="file that all remarks and settings are added to, with their times")
    add("--config", metavar="TOML", help="file of options, one table per command; the command line takes precedence")


def add_method(parser: Parser) -> None:
    """Add a cell of the table of methods."""
    add = parser.group("method and orders")
    add("--method", help="method, a row of `modalscope methods` (default: chosen by the data)")
    add("--domain", help="time, z or s; default: chosen by the data")


def add_orders(parser: Parser) -> None:
    """Add the model orders."""
    parser.group("method and orders")(
        "--orders", metavar="A:B:STEP", help="model orders, both ends included, such as 2:60:2, or the largest"
    )


def add_band(parser: Parser, *, several: bool = False) -> None:
    """Add the band, or several."""
    form: dict[str, Any] = {
        "nargs": 2,
        "type": float,
        "metavar": ("F1", "F2"),
        "action": "append" if several else "store",
    }
    more = "; repeatable, modes of several bands are merged" if several else ""
    parser.group("band and channels")("--band", **form, help=f"lowest and highest frequency, Hz{more}")


def add_choices(parser: Parser, *, bands: bool = False) -> None:
    """Add the band (several if `bands`), the route from records with inputs, their delays and excluded channels."""
    add_band(parser, several=bands)
    add = parser.group("band and channels")
    add(
        "--route",
        help="records with inputs: auto, records (on their own lines), frf, markov or subspace; without inputs: correlation, also where "
        "they look like free decays; default: auto",
    )
    delays = "outputs delayed after the forces, such as y3=12, or none; default: detected"
    add("--delays", nargs="+", metavar="DOF=SAMPLES", help=delays)
    add("--exclude", nargs="+", metavar="DOF", help="channels to exclude")
    same = "exchange inputs and outputs by reciprocity, or do not; default: where the inputs outnumber the outputs"
    add("--reciprocal", action=argparse.BooleanOptionalAction, default=None, help=same)
