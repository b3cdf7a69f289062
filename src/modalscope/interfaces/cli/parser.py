"""Parse the command line: errors on one line, and the options that several commands share."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from functools import partial
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


def expanded(files: list[Path]) -> list[Path]:
    """Return files, and of patterns what matches them: some shells hand them on as they are typed, as all do in quotes."""
    patterns = {
        file: re.sub(r"\*+", "*", file.name) for file in files if set("*?[") & set(file.name) and not file.exists()
    }
    found = {file: sorted(file.parent.glob(pattern)) for file, pattern in patterns.items()}
    shown = {file: [each for each in names if not each.name.startswith(".")] for file, names in found.items()}
    return [each for file in files for each in shown.get(file) or [file]]


#: Name of a value in the usage of an option -> its type; of others it is text.
_TYPES: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("FILE", "FILE.toml", "DIR", "FOLDER", "MODES", "CSV", "PICTURE", "REPORT"), Path),
    **dict.fromkeys(("HZ", "S", "SECONDS", "DB", "PART"), float),
    "N": int,
    "SIZE": memory,
}


class Parser(argparse.ArgumentParser):
    """A parser with one-line errors that accepts no abbreviations: --order does not match --orders."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**{"allow_abbrev": False, **given, "add_help": False})
        if given.get("add_help", True):
            words = "print this help; --help expert: with all options"
            self.add("-h/--help expert", words, action=_Help, nargs="?", default=argparse.SUPPRESS)

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

    def add(self, usage: str, words: str, group: str = "", **form: Any) -> None:
        """Add an option, or an argument, as its usage is written; without a value an option is a switch.

        `usage`: such as `-o/--output FILE`, `--band F1 F2`, `--exclude DOF...`, `--form {observable,controllable}` or `files FILE...`.
        `form`: what argparse knows besides.
        """
        names, *values = usage.split()
        shown = [value if "," in value else value.removesuffix("...") for value in values]
        if not shown and names.startswith("-"):
            form.setdefault("action", "store_true")
        elif shown and shown[0].startswith("{"):
            form["choices"] = tuple(shown[0][1:-1].split(","))
        elif shown:
            form = {"type": _TYPES.get(shown[0], str), "metavar": tuple(shown) if shown[1:] else shown[0], **form}
        if len(shown) > 1 or shown != values:
            form.setdefault("nargs", len(shown) if shown == values else "+")
        titled = (titled for titled in self._action_groups if titled.title == group)
        place = (next(titled, None) or self.add_argument_group(group)) if group else self
        place.add_argument(*names.split("/"), help=words, **form)

    def group(self, title: str) -> Callable[..., None]:
        """Return what adds an option to the group of this title; the help lists groups in the order of their first option."""
        return partial(self.add, group=title)

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
    parser.add("file", "data file: .uff, .csv, .txt, .xlsx, .npz, .mat, .h5, .wav ...", type=Path)
    add_reading(parser)


def add_files(parser: Parser) -> None:
    """Add the data files of one test and the reading options."""
    words = (
        "data: .uff, .csv, .npz, .mat ...; several files of one test are runs (same outputs) or setups (other outputs)"
    )
    parser.add("files FILE...", words)
    add_reading(parser)


def add_reading(parser: Parser) -> None:
    """Add the options for what a file does not state."""
    add = parser.group(_READING)
    add("--quantity QUANTITY", "displacement, velocity or acceleration, if the file does not state it or is wrong")
    add("--rename OLD=NEW", "role of a named array, such as y=outputs (.npz, .mat, .h5)", action="append")
    axes = "order of the axes of a named array, such as values=inputs,outputs,lines"
    add("--axes NAME=AXES", axes, action="append")
    for side, what in (("input", "forces"), ("output", "sensors")):
        text = f"nodes and directions of the {what}, such as 1:+Z,2:+Z: one item for all files, or one per file"
        add(f"--{side}-dofs DOFS...", text)
    add_geometry(parser)


def add_geometry(parser: Parser) -> None:
    """Add the geometry, the memory limit of reading, and what a table or a file of bare numbers does not state."""
    add = parser.group(_READING)
    add("--geometry FILE", "sensor positions: a table node,x,y,z, a universal file or a mesh", type=str)
    add("--lines FILE", "lines of the geometry: a table of pairs of nodes", type=str)
    add("--exact-nodes", "place no channel by its number alone (P3 at node 3)")
    limit = "memory limit for reading and processing a file, such as 8GB (reading: 500 MB, or 20 to 80 times the file)"
    add("--max-memory SIZE", limit)
    add = parser.group(_TABLES)
    add("--sampling-rate HZ", "sampling rate in Hz, if the file does not state it")
    add("--columns ROLES", 'roles of the columns, such as "time=1,in=2,out=3-9"')
    add("--ignore COL", "column (number or name) or array to ignore; repeatable", action="append")
    units = 'units of columns or channels, such as "2=N,AccA=m/s^2" or "outputs=100 mV/g,inputs=lbf"; converted to SI'
    add("--units COL=UNIT", units)
    add("--resample HZ", 'resample uneven times to this rate, or to their mean rate ("auto")', type=str)
    add("--rows FIRST-LAST", "rows of a table to read, counted from 1, such as 1101-4000")
    add("--skip N", "lines to skip at the top of a text file")
    several = "the one to read of several tests in a file: a sheet, a group, an experiment, a block or a set of arrays"
    add("--test/--sheet NAME", several, dest="sheet")
    add("--delimiter SIGN", 'column separator: one character, "tab" or "space"')
    add("--decimal SIGN", "decimal separator: . or ,", choices=(".", ","))
    add("--conjugate", "take complex conjugates of responses (time convention exp(-j w t))")
    add("--transpose", "channels are rows: exchange rows and columns")


#: Options of the data matrix; a method that has no use for one refuses it.
_OF_MATRIX = {
    "--block-rows N": "block rows of H(0); in z and s the degree of its polynomials",
    "--block-columns N": "block columns of H(0), or samples in the window",
    "--row-shifts K,K,...": "shifts of the block rows, such as 0,1,2,4,8 (Eq. 20)",
    "--column-shifts K,K,...": "shifts of the block columns",
    "--form {observable,controllable,smaller}": "the side that the shift is read off",
    "--source {samples,elimination}": "where transfer functions come from, in z",
    "--weighting {cva}": "of projected records: canonical variates",
    "--factorization {auto,dense,gram,randomized,lanczos}": "how singular vectors are found",
}
EXPERT = tuple(usage.split()[0].removeprefix("--").replace("-", "_") for usage in _OF_MATRIX)


def add_expert(parser: Parser) -> None:
    """Add the options of the data matrix."""
    add = parser.group(_EXPERT)
    for usage, words in _OF_MATRIX.items():
        add(usage, words)


def add_workers(parser: Parser) -> None:
    """Add the executor and the folder of partial sums for stored records."""
    add = parser.group(_STORED)
    add("--scheduler ADDRESS", "Dask scheduler, such as tcp://host:8786; local:4 starts four processes")
    add("--resume FOLDER", "folder for partial sums: an interrupted job goes on from them")


def add_outputs(parser: Parser, what: str) -> None:
    """Add the output files, any number, and `--force`."""
    words = f"{what}; repeatable; - writes JSON to stdout"
    parser.group("output")("-o/--output FILE", words, dest="outputs", action="append", default=[])
    add_force(parser)


def add_page(parser: Parser, name: str, what: str) -> None:
    """Add the one output file of a command that has a name without being told, and `--force`."""
    parser.add("-o/--output FILE", f"{what} (default: {name})", default=Path(name))
    add_force(parser)


def add_pictures(parser: Parser) -> None:
    """Add whether the pictures of a result are written, too."""
    add = parser.group("output")
    words = "also write diagram, shapes, AutoMAC and strongest response as files named after the first -o"
    add("--pictures {png,svg,pdf}", words)
    add("--header FILE.toml", "head of an .html report: project, structure, operator, sensors, conclusion")


def add_outside(parser: Parser) -> None:
    """Add whether the geometry of a document is read wherever the document says that it lies."""
    words = "of an .analysis.json: read its geometry also outside of the folders of the document and of the data"
    parser.add("--allow-outside", words)


def add_force(parser: Parser) -> None:
    """Add whether a file that modalscope did not write may be replaced."""
    parser.group("output")("--force", "replace a file that modalscope did not write")


def add_common(parser: Parser) -> None:
    """Add the options of every command: verbosity and a file of options."""
    add = parser.group(_COMMON)
    add("-q/--quiet", "print the result only: no remarks, no progress")
    add("-v/--verbose", "also print reasons of notes, and all settings that were chosen")
    add("--log FILE", "file that all remarks and settings are added to, with their times")
    add("--config TOML", "file of options, one table per command; the command line takes precedence")


def add_method(parser: Parser) -> None:
    """Add a cell of the table of methods."""
    add = parser.group("method and orders")
    add("--method METHOD", "method, a row of `modalscope methods` (default: chosen by the data)")
    add("--domain DOMAIN", "time, z or s; default: chosen by the data")


def add_orders(parser: Parser) -> None:
    """Add the model orders."""
    words = "model orders, both ends included, such as 2:60:2, or the largest"
    parser.group("method and orders")("--orders A:B:STEP", words)


def add_band(parser: Parser, *, several: bool = False) -> None:
    """Add the band, or several."""
    more = "; repeatable, modes of several bands are merged" if several else ""
    form = {"action": "append"} if several else {}
    parser.group("band and channels")("--band F1 F2", f"lowest and highest frequency, Hz{more}", type=float, **form)


#: Channels that are left out, as every command says it.
EXCLUDED = "--exclude DOF...", "channels to exclude"


def add_choices(parser: Parser, *, bands: bool = False) -> None:
    """Add the band (several if `bands`), the route from records with inputs, their delays and excluded channels."""
    add_band(parser, several=bands)
    add = parser.group("band and channels")
    route = (
        "records with inputs: auto, records (on their own lines), frf, markov, subspace or decays (after hits); "
        "without inputs: correlation, also where they look like free decays; default: auto"
    )
    add("--route ROUTE", route)
    add("--delays DOF=SAMPLES...", "outputs delayed after the forces, such as y3=12, or none; default: detected")
    add(*EXCLUDED)
    same = "exchange inputs and outputs by reciprocity, or do not; default: where the inputs outnumber the outputs"
    add("--reciprocal", same, action=argparse.BooleanOptionalAction, default=None)


def add_search(parser: Parser) -> None:
    """Add what modes are searched with: a cell of the table, orders, bands and channels."""
    add_method(parser)
    add_orders(parser)
    add_choices(parser, bands=True)
