"""The commands: files in, results out; no mathematics."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from modalscope.model.checks import DataError, check_choice

__all__ = ["main"]

EXIT_WRONG = 2

#: What `simulate` can write.
KINDS = ("frf", "impulse", "records", "ambient")


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line on stderr."""

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_WRONG, f"{self.prog}: {message}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it is done, 2 with one line on stderr for wrong use or unusable data."""
    options = _parser().parse_args(arguments)
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


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="modalscope", description="Measured responses of a structure to its modes.")
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    parser.set_defaults(run=_version_or_help(parser))
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")

    identify = commands.add_parser(
        "identify", help="find the modes in a file", description="Find the modes in a file, automatically."
    )
    identify.add_argument("file", type=Path, help="universal file, .npz, .mat, .h5 or .csv")
    identify.add_argument(
        "--method", help="a row of the table (see: modalscope methods); by default the one that suits the data"
    )
    identify.add_argument("--domain", help="time, z or s; by default the one that suits the data")
    _add_analysis(identify)
    identify.add_argument("-o", "--output", type=Path, help="write .json, .csv, .uff or an .html report")
    identify.set_defaults(run=_identify)

    compare = commands.add_parser(
        "compare",
        help="try every method on a file, and say which modes to trust",
        description="Identify a file by every method of the table; say what they agree on, where they differ and why.",
    )
    compare.add_argument("file", type=Path, help="universal file, .npz, .mat, .h5 or .csv")
    compare.add_argument(
        "--methods",
        nargs="+",
        default=["all"],
        metavar="METHOD",
        help="rows or cells of the table, such as era alternate/s (default: all)",
    )
    _add_analysis(compare, by_hand=False)
    compare.add_argument("-o", "--output", type=Path, help="write .json, .csv, .uff (the consensus) or an .html report")
    compare.set_defaults(run=_compare)

    info = commands.add_parser("info", help="tell what a file holds, what is taken and how good it is")
    info.add_argument("file", type=Path)
    _add_reading(info)
    info.set_defaults(run=_info)

    convert = commands.add_parser("convert", help="read one format, write another")
    convert.add_argument("input", type=Path)
    convert.add_argument("output", type=Path)
    _add_reading(convert)
    convert.set_defaults(run=_convert)

    table = commands.add_parser("methods", help="print the table of methods")
    table.set_defaults(run=_methods)

    simulate = commands.add_parser("simulate", help="write a simulated test of a known structure")
    simulate.add_argument("system", help="a structure of the catalog; 'list' prints their names")
    simulate.add_argument("-o", "--output", type=Path, help="file to write")
    simulate.add_argument("--kind", default="frf", help=f"{', '.join(KINDS)} (default: frf)")
    simulate.add_argument(
        "--samples", type=int, help="samples or lines (default: 1000 lines, 2000 samples, 20000 of a record)"
    )
    simulate.add_argument("--quantity", default="acceleration", help="displacement, velocity or acceleration (default)")
    simulate.add_argument("--noise", type=float, metavar="DB", help="signal-to-noise ratio in dB; none by default")
    simulate.add_argument("--seed", type=int, default=0, help="seed of the noise (default: 0)")
    simulate.set_defaults(run=_simulate)
    return parser


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


def _add_analysis(parser: argparse.ArgumentParser, *, by_hand: bool = True) -> None:
    _add_reading(parser)
    parser.add_argument("--orders", metavar="A:B:STEP", help="orders to try, both ends included, such as 2:60:2")
    parser.add_argument("--band", nargs=2, type=float, metavar=("F1", "F2"), help="lowest and highest frequency, Hz")
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


def _read(options: argparse.Namespace, path: Path) -> Any:
    from modalscope.io import read

    return read(path, **_reading(options))


def _reading(options: argparse.Namespace) -> dict[str, Any]:
    given: dict[str, Any] = {}
    if options.quantity:
        given["quantity"] = options.quantity
    if options.rename:
        pairs = [item.partition("=") for item in options.rename]
        wrong = [item for item, (_, sign, new) in zip(options.rename, pairs, strict=True) if not (sign and new)]
        if wrong:
            raise DataError(
                f"--rename {wrong[0]} was asked",
                "it is not of the form OLD=NEW",
                "Write for instance --rename y=outputs.",
            )
        given["rename"] = {old: new for old, _, new in pairs}
    return given


def parse_orders(text: str | None) -> range | None:
    """Read `2:60:2`, `2:60` or `40`; both ends belong to the range.

    Examples
    --------
    >>> parse_orders("2:10:4"), parse_orders("12")
    (range(2, 11, 4), range(12, 13))
    """
    if text is None:
        return None
    try:
        parts = [int(part) for part in text.split(":")]
    except ValueError:
        parts = []
    first, last, step = {1: (*parts, *parts, 1), 2: (*parts, 1), 3: tuple(parts)}.get(len(parts), (0, 0, 0))
    if not (1 <= first <= last and step >= 1):
        raise DataError(
            f"orders {text!r} were asked",
            "they are not of the form FIRST:LAST:STEP, FIRST at least 1",
            "Write for instance --orders 2:60:2.",
        )
    return range(first, last + 1, step)


class _Progress:
    """A progress bar on stderr; nothing when that is not a terminal a person looks at."""

    def __init__(self, what: str) -> None:
        from tqdm import tqdm

        self._bar = tqdm(desc=what, unit="order", file=sys.stderr, leave=False, disable=None)

    def __call__(self, done: int, total: int) -> None:
        self._bar.total = total
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        """Take the bar away."""
        self._bar.close()


def _identify(options: argparse.Namespace) -> None:
    from modalscope.model import ModalModel
    from modalscope.select import select
    from modalscope.stabilize import stabilize

    orders = parse_orders(options.orders)
    if options.output is not None:
        _check_output(options.output)
    data = _read(options, options.file)
    if isinstance(data, ModalModel):
        raise DataError(
            f"modes in the data of {options.file} were asked",
            "the file holds modes already",
            "Give a file of responses or records.",
        )
    bar = _Progress("identifying")
    try:
        diagram = stabilize(
            data,
            method=options.method,
            domain=options.domain,
            orders=orders,
            band=None if options.band is None else tuple(options.band),
            exclude=options.exclude,
            progress=bar,
        )
    finally:
        bar.close()
    modes = select(diagram, frequencies=options.frequencies)
    _print_modes(modes, diagram)
    if options.output is not None:
        _write_result(options, modes, diagram)


def _compare(options: argparse.Namespace) -> None:
    from modalscope.compare import compare
    from modalscope.model import ModalModel

    orders = parse_orders(options.orders)
    if options.output is not None:
        _check_output(options.output)
    data = _read(options, options.file)
    if isinstance(data, ModalModel):
        raise DataError(
            f"methods compared on {options.file} were asked",
            "the file holds modes already",
            "Give a file of responses or records.",
        )
    bar = _Progress("comparing")
    try:
        found = compare(
            data,
            "all" if options.methods == ["all"] else options.methods,
            orders=orders,
            band=None if options.band is None else tuple(options.band),
            exclude=options.exclude,
            progress=bar,
        )
    finally:
        bar.close()
    print(found.table())
    if options.output is None:
        return
    if options.output.suffix.lower() in (".html", ".htm"):
        from modalscope.report import report

        report(found, options.output, source=str(options.file), command=_command(options))
    else:
        from modalscope.io import write

        beside = {"method": "consensus", "domain": "all", "orders": orders or (), "data": {"file": options.file.name}}
        write(options.output, found.modes, **(beside if options.output.suffix.lower() == ".json" else {}))
    print(f"written: {options.output}")


def _check_output(path: Path) -> None:
    """Refuse a name that cannot be written before the work is done, not after it."""
    known = (".json", ".csv", ".uff", ".unv", ".html", ".htm", ".npz", ".h5", ".mat")
    if path.suffix.lower() not in known:
        raise DataError(
            f"writing {path.name} was asked",
            f"results are written as {', '.join(known)}",
            "Choose one of these suffixes.",
        )
    if path.is_dir() or not path.resolve().parent.is_dir():
        what = "that is a folder" if path.is_dir() else f"there is no folder {path.resolve().parent}"
        raise DataError(f"writing {str(path)!r} was asked", what, "Name a file in a folder that is there.")


def _print_modes(modes: Any, diagram: Any) -> None:
    from modalscope.residues.rebuilt import fit_of

    print(f"{diagram.method} ({diagram.domain}), orders {diagram.orders[0]} to {diagram.orders[-1]}")
    for note in diagram.notes:
        print(f"  {note}")
    if not len(modes):
        print("no mode stands out of the data")
        return
    print()
    print(modes.table())
    print(
        f"\nthe rebuilt responses leave {100 * fit_of(modes, diagram.response):.2f} % of the measured ones (by norm, in the band)"
    )


def _write_result(options: argparse.Namespace, modes: Any, diagram: Any) -> None:
    path = options.output
    if path.suffix.lower() in (".html", ".htm"):
        from modalscope.report import report

        report((modes, diagram), path, source=str(options.file), command=_command(options))
    else:
        from modalscope.io import write

        beside = {
            "method": diagram.method,
            "domain": diagram.domain,
            "orders": diagram.orders,
            "data": {"file": options.file.name},
        }
        write(path, modes, **(beside if path.suffix.lower() == ".json" else {}))
    print(f"written: {path}")


def _command(options: argparse.Namespace) -> str:
    """Return the command that repeats the result."""
    given = vars(options)
    words = ["modalscope", "compare" if "methods" in given else "identify", str(options.file)]
    for name in ("method", "domain", "quantity", "orders"):
        words += [f"--{name} {given[name]}"] if given.get(name) else []
    if options.rename:
        words += [f"--rename {item}" for item in options.rename]
    for name in ("methods", "band", "exclude", "frequencies"):
        values = [f"{v:g}" if isinstance(v, float) else str(v) for v in given.get(name) or ()]
        words += [f"--{name} {' '.join(values)}"] if values else []
    return " ".join([*words, f"-o {options.output}"])


def _info(options: argparse.Namespace) -> None:
    from modalscope.io import survey
    from modalscope.model import ModalModel
    from modalscope.preprocess import examine

    told = survey(options.file, **_reading(options))
    print(told)
    data = _read(options, options.file)
    if isinstance(data, ModalModel):
        print(data.table())
        return
    findings = examine(data)
    print("quality: nothing to report" if not findings else "quality:")
    for finding in findings:
        print(f"  {finding}")


def _convert(options: argparse.Namespace) -> None:
    from modalscope.io import describe, write

    data = _read(options, options.input)
    write(options.output, data)
    print(f"written: {options.output}, {describe(data)}")


def _methods(_: argparse.Namespace) -> None:
    from modalscope.methods import methods

    rows = [("method", "domain", "realization", "report", "known as")]
    rows += [(m.name, m.domain, m.realization, m.section, "; ".join(m.known_as)) for m in methods()]
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    for row in rows:
        print("  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[4]]).rstrip())


def _simulate(options: argparse.Namespace) -> None:
    from modalscope import systems
    from modalscope.io import describe, write

    if options.system == "list":
        for name, make in systems.catalog().items():
            print(f"{name:15s} {(make.__doc__ or '').strip().splitlines()[0]}")
        return
    structure = systems.build(options.system)
    if options.output is None:
        raise DataError(
            f"simulating {options.system} was asked",
            "there is no file to write it to",
            "Add -o FILE, for instance -o test.npz.",
        )
    data = _simulated(structure, options)
    write(options.output, data)
    print(f"written: {options.output}, {describe(data)}")


def _simulated(structure: Any, options: argparse.Namespace) -> Any:
    """Return a simulated test whose band and rate hold all modes of the structure."""
    import numpy as np

    check_choice("kind", options.kind, KINDS)
    f = structure.modes().frequencies
    # a fraction of each channel's root mean square
    noise = None if options.noise is None else 10 ** (-options.noise / 20)
    if options.kind == "frf":
        lines = np.linspace(f.min() / 4, 1.25 * f.max(), options.samples or 1000)
        return structure.frequency_response(lines, quantity=options.quantity, noise=noise, seed=options.seed)
    rate = max(1 / structure.dt if structure.dt else 0.0, 2.56 * f.max())
    if options.kind == "impulse":
        samples = options.samples or 2000
        return structure.impulse_response(
            samples, sampling_rate=rate, quantity=options.quantity, noise=noise, seed=options.seed
        )
    return structure.simulate(
        inputs="ambient" if options.kind == "ambient" else "white",
        samples=options.samples or 20_000,
        sampling_rate=rate,
        quantity=options.quantity,
        noise=noise or 0.0,
        seed=options.seed,
    )
