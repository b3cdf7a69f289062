"""modalscope identify: the modes in a file, or in the files of one test."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.cli.parser import Commands, add_cell, add_choices, add_files, add_outputs, add_workers
from modalscope.cli.process import explain, remark, say

if TYPE_CHECKING:
    from modalscope.model.notes import Note
    from modalscope.model.result import Result

__all__ = ["add", "run"]


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "identify", help="find the modes in a file", description="Find the modes in a file, automatically."
    )
    add_files(parser)
    add_cell(parser)
    add_choices(parser, bands=True)
    parser.add_argument(
        "--frequencies", nargs="+", type=float, metavar="HZ", help="report the modes at these frequencies"
    )
    parser.add_argument("--take", nargs="+", type=float, metavar="HZ", help="report these modes, too")
    parser.add_argument("--refuse", nargs="+", type=float, metavar="HZ", help="do not report these modes")
    parser.add_argument(
        "--no-refine",
        dest="refine",
        action="store_false",
        help="report the values of the diagram, not those of the maximum of the likelihood",
    )
    parser.add_argument("--all", action="store_true", help="print what was left out, too, and why")
    parser.add_argument(
        "--each",
        action="store_true",
        help="every file is a test of its own: one table, modes paired with those of the first file",
    )
    parser.add_argument(
        "--reference",
        type=Path,
        metavar="MODES",
        help="with --each: a file of modes to pair with, instead of the first file's",
    )
    parser.add_argument(
        "--apart",
        action="store_true",
        help="setups of one test are identified one by one and their modes merged, instead of their records",
    )
    add_workers(parser)
    add_outputs(parser, "write .json, .csv, .uff or an .html report")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Find the modes in a file, write them where that is asked, and print them: a closed pipe loses no file."""
    from modalscope.cli.output import check_outputs, is_page, write_outputs

    if options.each:
        from modalscope.cli.batch import run_each

        run_each(options)
        return
    check_outputs(options, options.files)
    if options.apart and any(is_page(path) for path in options.outputs):
        _refuse_page_of("setups identified apart")
    result = found_in(options, options.files)
    written = write_outputs(options, result, ", ".join(map(str, options.files)))
    _print(result, everything=options.all)
    for line in written:
        say(line)


def found_in(options: argparse.Namespace, files: list[Any]) -> Result:
    """Return the result of the choices on the command line for the files of one test."""
    from modalscope.cli.progress import progress
    from modalscope.cli.reading import parse_delays, parse_orders, reading_options
    from modalscope.cli.workers import workers_of
    from modalscope.workflow.analyze import analyze
    from modalscope.workflow.replay import replay

    if len(files) == 1 and files[0].name.lower().endswith(".analysis.json"):
        with progress("identifying") as show:
            return replay(files[0], progress=show)
    bands = [tuple(band) for band in options.band or ()]
    given: dict[str, Any] = {"band": bands[0] if len(bands) == 1 else bands or None, "exclude": options.exclude}
    given |= {"route": options.route, "delays": parse_delays(options.delays)}
    with workers_of(options), progress("identifying") as show:
        return analyze(
            files[0] if len(files) == 1 else files,
            method=options.method,
            domain=options.domain,
            orders=parse_orders(options.orders),
            frequencies=options.frequencies,
            take=options.take or (),
            refuse=options.refuse or (),
            refine=options.refine,
            apart=options.apart,
            reading=[reading_options(options, path) for path in files],
            progress=show,
            **given,
        )


def _refuse_page_of(what: str) -> None:
    from modalscope.model import DataError

    raise DataError(
        f"one report on {what} was asked",
        "a report is on one measurement",
        "Write .json or .csv, or one report for each.",
    )


def _print(result: Result, *, everything: bool = False) -> None:
    """Print how the modes were found, what was noted, and the modes."""
    from modalscope.modal.explained import explained
    from modalscope.modal.rebuilt import fit_of

    for note in result.notes:
        if note.kind in ("file", "places", "units", "units not known", "bands chosen"):
            remark(note)
    _print_diagrams(result)
    if result.findings:
        remark("quality:")
        for finding in result.findings:
            remark(f"  {finding}")
    if not len(result.modes):
        why = [str(note) for note in result.modes.notes if note.kind == "no mode"]
        say(next(iter(why), "no mode stands out of the data"))
        _print_of_noise(result)
        _print_left_out(result, everything)
        return
    parts = "setups identified apart" if result.analysis.apart else "bands merged"
    several = f"{len(result.diagrams)} {parts}\n\n" if len(result.diagrams) > 1 else ""
    say(f"\n{several}{result.modes.table()}")
    shown = {note for diagram in result.diagrams for note in diagram.notes}
    for note in result.modes.notes:
        if note not in shown:
            remark(f"  {note}")
    if len(result.diagrams) == 1:
        say(f"\n{explained(fit_of(result.modes, result.diagram.response))}")
        _print_of_noise(result)
    _print_left_out(result, everything)
    for index, reasons in enumerate(result.modes.reasons):
        explain(f"mode {index + 1}: {reasons}")


def _print_of_noise(result: Result) -> None:
    """Print which lines hold noise alone."""
    for note in result.notes:
        if note.kind == "lines of noise":
            remark(f"  {note}")


def _print_diagrams(result: Result) -> None:
    """Print how each band or setup was identified; what an earlier one noted, too, is not said again."""
    from modalscope.identification.lookup import cell_label
    from modalscope.reporting.banded import bands_of

    apart, shown = result.analysis.apart, bands_of(result.modes, result.diagrams)
    told: set[Note] = set()
    for each in shown:
        diagram = each.diagram
        which = f"setup {each.number}: " if apart else f"{each.words}: " if len(shown) > 1 else ""
        remark(
            f"{which}{cell_label(diagram.method, diagram.domain)}, orders {diagram.orders[0]} to {diagram.orders[-1]}"
        )
        for note in diagram.notes if not (apart and told) else ():
            if note not in told:
                remark(f"  {note}")
        told |= set(diagram.notes)
        explain("  " + ", ".join(f"{name}={value!r}" for name, value in diagram.settings.items()))


def _print_left_out(result: Result, everything: bool) -> None:
    """Print the candidates that are no modes, with the reasons; without `--all` how many there are."""
    left = result.modes.left_out
    if not left:
        return
    if not everything:
        from modalscope.model.shown import counted

        remark(f"{counted(len(left), 'candidate')} left out; --all says which, and why")
        return
    say("\nleft out:")
    for each in left:
        gain = "" if each.gain != each.gain else f" ({each.gain:.1f} deviations)"
        say(f"  {each}{gain}. {each.remedy}")
