"""Estimate frequency responses from records with inputs, and write them."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser, add_band, add_files, add_outputs
from modalscope.cli.process import remark, say

#: Options that `joined_frf` takes, too; without a value its default counts.
_ESTIMATOR_OPTIONS = ("estimator", "segment", "overlap", "window", "period")


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_files(parser)
    parser.add_argument("--estimator", help="h1 (default), h2, hv, or leakage-free: lpm, lrm")
    parser.add_argument("--segment", type=int, metavar="N", help="samples per segment; default: chosen by the record")
    parser.add_argument("--overlap", type=float, help="overlap of consecutive segments, 0 to 1")
    parser.add_argument("--window", help="window of each segment, such as hann or none")
    parser.add_argument("--period", type=int, metavar="N", help="samples per period of a periodic excitation")
    add_band(parser)
    add_outputs(parser, "write .uff, .npz, .mat, .h5, .csv, or a picture .png, .svg or .pdf")


def run(options: argparse.Namespace) -> None:
    """Estimate frequency responses, write them, and print their quality."""
    from modalscope.cli.output import DATA, PICTURES, check_outputs, require_output, write_data, write_picture
    from modalscope.cli.reading import read_test
    from modalscope.data import Records, Signals
    from modalscope.data.records import as_records
    from modalscope.data.shown import summary_of
    from modalscope.doctor import examine
    from modalscope.numerics.checks import check_kind
    from modalscope.plot import response
    from modalscope.preprocess.merging import joined_frf

    require_output(options, "frf.uff")
    check_outputs(options, options.files, (*DATA, *PICTURES))
    data, notes = read_test(options)
    check_kind("frequency responses of records", data, (Signals, Records))
    given = {name: value for name in _ESTIMATOR_OPTIONS if (value := getattr(options, name)) is not None}
    frf = joined_frf(as_records(data).stacked(), **given)
    if options.band is not None:
        frf = frf.band(*options.band)
    written = [
        write_picture(path, response(frf)) if path.suffix.lower() in PICTURES else write_data(path, frf)
        for path in options.outputs
    ]
    remark(*notes, summary_of(frf), *(f"  {line}" for line in (*frf.processing, *examine(frf))))
    say(*written)
