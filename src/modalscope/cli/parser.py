"""What can be written on the command line."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from modalscope.cli import analysis, files

__all__ = ["EXIT_WRONG", "build_parser"]

EXIT_WRONG = 2

_Commands: TypeAlias = "argparse._SubParsersAction[_Parser]"


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line on stderr."""

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_WRONG, f"{self.prog}: {message}\n")


def build_parser() -> argparse.ArgumentParser:
    """Return the parser; each command carries the function that runs it."""
    parser = _Parser(prog="modalscope", description="Measured responses of a structure to its modes.")
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    parser.set_defaults(run=_version_or_help(parser))
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    for add in (_add_identify, _add_compare, _add_info, _add_convert, _add_methods, _add_simulate):
        add(commands)
    return parser


def _add_identify(commands: _Commands) -> None:
    parser = commands.add_parser(
        "identify", help="find the modes in a file", description="Find the modes in a file, automatically."
    )
    parser.add_argument("file", type=Path, help="universal file, .npz, .mat, .h5 or .csv")
    parser.add_argument(
        "--method", help="a row of the table (see: modalscope methods); by default the one that suits the data"
    )
    parser.add_argument("--domain", help="time, z or s; by default the one that suits the data")
    _add_analysis(parser)
    parser.add_argument("-o", "--output", type=Path, help="write .json, .csv, .uff or an .html report")
    parser.set_defaults(run=analysis.identify)


def _add_compare(commands: _Commands) -> None:
    parser = commands.add_parser(
        "compare",
        help="try every method on a file, and say which modes to trust",
        description="Identify a file by every method of the table; say what they agree on, where they differ and why.",
    )
    parser.add_argument("file", type=Path, help="universal file, .npz, .mat, .h5 or .csv")
    parser.add_argument(
        "--methods",
        nargs="+",
        default=["all"],
        metavar="METHOD",
        help="rows or cells of the table, such as era alternate/s (default: all)",
    )
    _add_analysis(parser, by_hand=False)
    parser.add_argument("-o", "--output", type=Path, help="write .json, .csv, .uff (the consensus) or an .html report")
    parser.set_defaults(run=analysis.compare)


def _add_info(commands: _Commands) -> None:
    parser = commands.add_parser("info", help="tell what a file holds, what is taken and how good it is")
    parser.add_argument("file", type=Path)
    _add_reading(parser)
    parser.set_defaults(run=files.info)


def _add_convert(commands: _Commands) -> None:
    parser = commands.add_parser("convert", help="read one format, write another")
    parser.add_argument("input", type=Path)
    parser.add_argument("output", type=Path)
    _add_reading(parser)
    parser.set_defaults(run=files.convert)


def _add_methods(commands: _Commands) -> None:
    parser = commands.add_parser("methods", help="print the table of methods")
    parser.set_defaults(run=files.methods)


def _add_simulate(commands: _Commands) -> None:
    parser = commands.add_parser("simulate", help="write a simulated test of a known structure")
    parser.add_argument("system", help="a structure of the catalog; 'list' prints their names")
    parser.add_argument("-o", "--output", type=Path, help="file to write")
    parser.add_argument("--kind", default="frf", help=f"{', '.join(files.KINDS)} (default: frf)")
    parser.add_argument(
        "--samples", type=int, help="samples or lines (default: 1000 lines, 2000 samples, 20000 of a record)"
    )
    parser.add_argument("--quantity", default="acceleration", help="displacement, velocity or acceleration (default)")
    parser.add_argument("--noise", type=float, metavar="DB", help="signal-to-noise ratio in dB; none by default")
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise (default: 0)")
    parser.set_defaults(run=files.simulate)


def _add_reading(parser: argparse.ArgumentParser) -> None:
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


def _add_analysis(parser: argparse.ArgumentParser, *, by_hand: bool = True) -> None:
    _add_reading(parser)
    parser.add_argument("--orders", metavar="A:B:STEP", help="orders to try, both ends included, such as 2:60:2")
    parser.add_argument(
        "--band",
        nargs=2,
        type=float,
        action="append" if by_hand else "store",
        metavar=("F1", "F2"),
        help="lowest and highest frequency, Hz" + ("; given several times, the bands are merged" if by_hand else ""),
    )
    parser.add_argument("--exclude", nargs="+", metavar="DOF", help="channels to leave out")
    if by_hand:
        parser.add_argument(
            "--frequencies", nargs="+", type=float, metavar="HZ", help="report the modes at these frequencies"
        )


def _version_or_help(parser: argparse.ArgumentParser) -> Any:
    def run(options: argparse.Namespace) -> None:
        from modalscope import __version__

        if not options.version:
            parser.error("a command is needed: identify, compare, info, convert, methods or simulate (see --help)")
        print(__version__)

    return run
