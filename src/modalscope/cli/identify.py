"""Run `modalscope identify`: the modes in a file, in the files of one test, or in each of many files."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.cli.parser import Commands, add_cell, add_choices, add_files, add_outputs, add_workers
from modalscope.cli.process import complain, explain, remark, say

if TYPE_CHECKING:
    from modalscope.data import ModalModel
    from modalscope.data.notes import Note
    from modalscope.data.results import Result
    from modalscope.numerics.checks import RealArray


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
    from modalscope.cli.process import progress
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
    from modalscope.data import DataError

    raise DataError(
        f"one report on {what} was asked",
        "a report is on one measurement",
        "Write .json or .csv, or one report for each.",
    )


def _print(result: Result, *, everything: bool = False) -> None:
    """Print how the modes were found, what was noted, and the modes; of all bands together what a report says of them."""
    from modalscope.plot.web.poles import fit_of_bands
    from modalscope.reporting.modes import verdict_of

    for note in result.notes:
        if note.kind in ("file", "places", "base", "units", "units not known", "bands chosen"):
            remark(note)
    _print_diagrams(result)
    known = len(result.modes) > 0 and not result.analysis.apart
    fit = fit_of_bands(result.modes, result.diagrams) if known else None
    verdict = verdict_of(result.modes, result.diagrams[0].response, fit)
    for text in verdict.taken:
        remark(text)
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
    say("")
    for text in (*verdict.explained, *verdict.warnings):
        say(text)
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
    from modalscope.identification.method_names import cell_label
    from modalscope.reporting.sections import bands_of

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
        from modalscope.data.shown import counted

        remark(f"{counted(len(left), 'candidate')} left out; --all says which, and why")
        return
    say("\nleft out:")
    for each in left:
        gain = "" if each.gain != each.gain else f" ({each.gain:.1f} deviations)"
        say(f"  {each}{gain}. {each.remedy}")


# --------------------------------------------------------------------------------------------------------------- batch
# modalscope identify --each: many tests of one structure, and one table of their modes.


def run_each(options: argparse.Namespace) -> None:
    """Identify every file by itself; print the modes of all, paired with those of the first that has any.

    An output names the files to write: `-o results.json` gives results_NAME.json for every NAME. A file that cannot be used is
    named, and the others are done all the same.
    """
    from modalscope.cli.output import check_output
    from modalscope.cli.reading import read_modes
    from modalscope.data import DataError
    from modalscope.io import write

    reference = None if options.reference is None else read_modes(options, options.reference)
    places = {
        path: [out.with_name(f"{out.stem}_{path.stem}{out.suffix}") for out in options.outputs]
        for path in options.files
    }
    written = [place for each in places.values() for place in each]
    for place in written:
        check_output(place, options.files, options.force)
        if written.count(place) > 1:
            raise DataError(
                f"a file for each of {len(places)} tests was asked",
                f"{place.name} would be that of several",
                "Give the tests names of their own, or identify them one by one.",
            )
    found: list[tuple[str, ModalModel]] = []
    failed = []
    for path in options.files:
        try:
            result = found_in(options, [path])
        except DataError as error:
            complain(f"{path}: {error}")
            failed.append(path)
            continue
        for place in places[path]:
            write(place, result)
            remark(f"written: {place}")
        found.append((path.name, result.modes))
    if found:
        say(table_of(found, reference))
    if failed:
        raise DataError(
            f"modes in {len(options.files)} files were asked",
            f"{len(failed)} of them cannot be used: {', '.join(path.name for path in failed)}",
            "What is wrong with each stands above.",
        )


def table_of(found: Sequence[tuple[str, ModalModel]], reference: ModalModel | None = None) -> str:
    """Return frequencies and damping ratios of several tests, a column a test, a row a mode of the reference.

    `reference`: by default the first test that has modes.
    """
    import numpy as np

    from modalscope.data.shown import text_table
    from modalscope.modal.pairing import pair_modes

    first = next((modes for _, modes in found if len(modes)), None) if reference is None else reference
    if first is None:
        return "no mode stands out of any file"
    columns, others = [], []
    frequencies = np.full((len(found), len(first)), np.nan)
    for k, (name, modes) in enumerate(found):
        cells = [name, *["-"] * len(first)]
        pairs = pair_modes(first, modes)
        for i, j in zip(pairs.first, pairs.second, strict=True):
            cells[i + 1] = f"{modes.frequencies[j]:.4f} Hz {100 * modes.damping_ratios[j]:.3f} %"
        frequencies[k, pairs.first] = modes.frequencies[pairs.second]
        columns.append(cells)
        alone = ", ".join(f"{f:.4f} Hz" for f in modes.frequencies[pairs.alone[1]])
        others += [f"only in {name}: {alone}"] if alone else []
    if reference is not None:
        own = [f"{f:.4f} Hz {100 * z:.3f} %" for f, z in zip(first.frequencies, first.damping_ratios, strict=True)]
        columns.insert(0, ["reference", *own])
    columns.insert(0, ["mode", *(str(i + 1) for i in range(len(first)))])
    columns.append(["scatter of f", *(_scatter(f[np.isfinite(f)]) for f in frequencies.T)])
    return "\n".join([text_table(zip(*columns, strict=True), left=(len(columns) - 1,)), *others])


def _scatter(f: RealArray) -> str:
    return f"{100 * f.std(ddof=1) / f.mean():.3f} %" if f.size > 1 else "-"
