"""Commands on files: contents, conversion, merging, simulation."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.interfaces.cli.parser import EXCLUDED, Parser, add_files, add_force, add_outputs, add_reading
from modalscope.interfaces.cli.process import progress, remark, say

if TYPE_CHECKING:
    from modalscope.data import Note

#: Files of one kind that are listed one by one; more are one line.
_MOST_LISTED = 4


def add_info(parser: Parser) -> None:
    """Add the arguments of `info`."""
    add_files(parser)
    whole = "search every pair of many channels for outlying lines, and every output for a wrong quantity"
    parser.add("--whole", whole)
    parser.add("--each", "each file, and each test in it, by itself")
    parser.add(*EXCLUDED)


def info(options: argparse.Namespace) -> None:
    """Print the contents of a file, how they are interpreted, and their quality; of several files what they are together."""
    from modalscope.data import Geometry, ModalModel, StabilizationDiagram, StateSpace
    from modalscope.data.shown import summary_of
    from modalscope.interfaces.cli.reading import each_test, reading_options
    from modalscope.io import survey
    from modalscope.io.contents import SeveralTests

    if options.each:
        for name, one in each_test(options):
            say(f"== {name}")
            info(argparse.Namespace(**{**vars(one), "each": False}))
        return
    if len(options.files) > 1:
        data, notes = _together(options)
        say(f"together: {summary_of(data)}", *(f"note: {note}" for note in notes))
        _say_quality(options, data)
        return
    try:
        with progress("reading"):
            found = survey(options.files[0], **reading_options(options, options.files[0]))
    except SeveralTests as several:
        head = f"{options.files[0].name}: {len(several.names)} tests"
        say(head, *(f"  {name}" for name in several.names), f"{several.change}. All: modalscope identify --each")
        return
    say(found)
    if isinstance(found.thing, ModalModel):
        say(found.thing.table())
    elif not isinstance(found.thing, Geometry | StateSpace | StabilizationDiagram):  # these are not measured
        _say_quality(options, found.thing)


def _together(options: argparse.Namespace) -> tuple[Any, tuple[Note, ...]]:
    """Print what several files hold, those that are alike in one line, and return what they are together, with notes."""
    from modalscope.data.shown import summary_of
    from modalscope.interfaces.cli.reading import read_parts

    parts, merged = read_parts(options)
    alike: dict[str, list[str]] = {}
    for path, part in zip(options.files, parts, strict=True):
        alike.setdefault(summary_of(part), []).append(path.name)
    for what, names in alike.items():
        if len(names) > _MOST_LISTED:
            say(f"{len(names)} files alike ({names[0]} to {names[-1]}): {what}")
        else:
            say(*(f"{name}: {what}" for name in names))
    return merged()


def _say_quality(options: argparse.Namespace, data: Any) -> None:
    """Print what is wrong with measured data."""
    from modalscope.data import Signals
    from modalscope.data.units import si_form
    from modalscope.signals.doctor import examine
    from modalscope.signals.doctor.together import from_its_start

    measured, units = si_form(data)
    if isinstance(measured, Signals):
        measured, start = from_its_start(measured)
        units = (*units, *start)
    measured = measured.select(exclude=options.exclude) if options.exclude else measured
    with progress("examining"):
        findings = examine(measured, whole=options.whole)
    say(*(f"{'note' if note.kind == 'start' else 'units'}: {note}" for note in units))
    say("quality:" if findings else "quality: no data problem found", *(f"  {finding}" for finding in findings))


def add_convert(parser: Parser) -> None:
    """Add the arguments of `convert`."""
    parser.add("input", "file to read", type=Path)
    parser.add("output", "file to write; its suffix is the format", type=Path)
    add_reading(parser)
    add_force(parser)


def convert(options: argparse.Namespace) -> None:
    """Convert a file to another format."""
    from modalscope.interfaces.cli.output import check_output, write_data
    from modalscope.interfaces.cli.reading import read_data

    check_output(options.output, (options.input,), options.force)
    data, notes = read_data(options, options.input)
    written = write_data(options.output, data)
    remark(*notes)
    say(written)


def add_anonymize(parser: Parser) -> None:
    """Add the arguments of `anonymize`."""
    parser.add("file", "text, .xlsx, .mat or universal file", type=Path)
    parser.add("-o/--output FILE", "stand-in to write, of the same suffix", required=True)
    add_force(parser)


def anonymize(options: argparse.Namespace) -> None:
    """Write a stand-in of a file that may not be shown: the same layout, clocks and kinds, other values and names.

    Values are those of a simulated structure, names are P1, P2, ... Look through the stand-in before you send it.
    """
    from modalscope import systems
    from modalscope.interfaces.cli.output import check_output
    from modalscope.numerics.plugins import WRITINGS, added

    target = options.output if options.output.suffix else options.output.with_suffix(options.file.suffix)
    check_output(target, (options.file,), options.force, (options.file.suffix.lower(),))
    with progress("simulating"):
        read = added(WRITINGS, "stand-in")(options.file, target, systems.build("iasc_asce"))
    say(*read, f"written: {target}")


def add_merge(parser: Parser) -> None:
    """Add the arguments of `merge`."""
    add_files(parser)
    add_outputs(parser, "write .uff, .npz, .mat or .h5")


def merge(options: argparse.Namespace) -> None:
    """Merge the files of one test, runs or setups, into one file."""
    from modalscope.data import Setups
    from modalscope.interfaces.cli.output import DATA, check_outputs, write_data
    from modalscope.interfaces.cli.reading import read_test
    from modalscope.signals.preprocess.setups import correlations, merge_setups

    check_outputs(options, options.files, DATA, "test.npz")
    data, notes = read_test(options)
    if isinstance(data, Setups):  # no format stores several records: their merged correlation is one
        with progress("merging"):
            data = merge_setups(correlations(data))
    written = [write_data(path, data) for path in options.outputs]
    remark(*notes)
    say(*written)


def add_simulate(parser: Parser) -> None:
    """Add the arguments of `simulate`."""
    parser.add("system", "a structure of the catalog; 'list' prints the catalog")
    parser.add("-o/--output OUTPUT", "file to write", type=Path)
    add_force(parser)
    parser.add("--kind KIND", "frf, impulse, records or ambient (default: frf)", default="frf")
    samples = "samples or lines (default: 1000 lines, 2000 samples, 20000 samples of a record)"
    parser.add("--samples SAMPLES", samples, type=int)
    parser.add("--quantity QUANTITY", "displacement, velocity or acceleration (default)", default="acceleration")
    parser.add("--noise DB", "signal-to-noise ratio in dB (default: no noise)")
    parser.add("--seed SEED", "seed of the noise (default: 0)", type=int, default=0)


def simulate(options: argparse.Namespace) -> None:
    """Write a simulated test of a known structure."""
    from modalscope import systems
    from modalscope.data import DataError
    from modalscope.interfaces.cli.output import check_output, write_data
    from modalscope.systems.listing import trial

    if options.system == "list":
        for name, make in systems.catalog().items():
            say(f"{name:15s} {(make.__doc__ or '').strip().splitlines()[0]}")
        return
    structure = systems.build(options.system)
    if options.output is None:
        raise DataError(f"simulating {options.system} needs an output file", "none was given", "Add -o test.npz.")
    check_output(options.output, (), options.force)
    size = {"samples": options.samples, "quantity": options.quantity}
    with progress("simulating"):
        data = trial(structure, options.kind, **size, snr_db=options.noise, seed=options.seed)
    say(write_data(options.output, data))
