"""modalscope frf: frequency responses from records."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands, add_band, add_files, add_outputs
from modalscope.cli.process import remark, say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser("frf", help="estimate frequency responses from records with inputs, and write them")
    add_files(parser)
    parser.add_argument("--estimator", help="h1 (default), h2, hv, or without leakage: lpm, lrm")
    parser.add_argument(
        "--segment", type=int, metavar="N", help="samples of a segment; by default what suits the record"
    )
    parser.add_argument("--overlap", type=float, help="part of a segment that the next one shares")
    parser.add_argument("--window", help="of every segment, such as hann or none")
    parser.add_argument("--period", type=int, metavar="N", help="samples of one period of a periodic excitation")
    add_band(parser)
    add_outputs(parser, "write .uff, .npz, .mat, .h5, .csv, or a picture .png, .svg or .pdf")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Estimate frequency responses, write them, and say how good they are."""
    from modalscope.cli.output import DATA, PICTURES, check_outputs, needed, write_data, write_picture
    from modalscope.cli.reading import read_test
    from modalscope.data import Records, Signals
    from modalscope.data.records import as_records
    from modalscope.data.shown import summary_of
    from modalscope.doctor import examine
    from modalscope.numerics.checks import check_kind
    from modalscope.plot import response
    from modalscope.preprocess.merging import joined_frf

    needed(options, "frf.uff")
    check_outputs(options, options.files, (*DATA, *PICTURES))
    data, told = read_test(options)
    check_kind("frequency responses of records", data, (Signals, Records))
    names = ("estimator", "segment", "overlap", "window", "period")
    found = joined_frf(
        as_records(data).stacked(),
        **{name: getattr(options, name) for name in names if getattr(options, name) is not None},
    )
    if options.band is not None:
        found = found.band(*options.band)
    written = [
        write_picture(path, response(found)) if path.suffix.lower() in PICTURES else write_data(path, found)
        for path in options.outputs
    ]
    for note in told:
        remark(note)
    remark(summary_of(found))
    for line in (*found.processing, *examine(found)):
        remark(f"  {line}")
    for line in written:
        say(line)
