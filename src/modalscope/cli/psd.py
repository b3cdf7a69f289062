"""Compute the singular values of the spectra of records, and their peaks (FDD, EFDD).

The first singular value of the cross spectra of all outputs peaks at resonances and harmonics. The estimate is independent of the
methods of the table.
"""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser, add_files, add_outputs
from modalscope.cli.process import remark, say


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_files(parser)
    parser.add_argument("--segment", type=int, metavar="N", help="samples per segment (default: 1/20 of the record)")
    parser.add_argument("--overlap", type=float, default=0.5, help="overlap of consecutive segments (default: 0.5)")
    parser.add_argument("--window", default="hann", help="window of each segment (default: hann)")
    parser.add_argument("--peaks", type=int, metavar="N", help="number of peaks (default: all significant ones)")
    add_outputs(parser, "write a picture, .png, .svg or .pdf")


def run(options: argparse.Namespace) -> None:
    """Print the peaks of the first singular value, and draw all singular values if asked."""
    from modalscope.cli.output import PICTURES, check_outputs, write_picture
    from modalscope.cli.reading import read_test
    from modalscope.data import Signals
    from modalscope.numerics.checks import check_kind
    from modalscope.plot import spectra
    from modalscope.preprocess import decomposition

    check_outputs(options, options.files, PICTURES)
    data, notes = read_test(options)
    check_kind("spectra of records", data, Signals)
    decomposed = decomposition(data, segment=options.segment, overlap=options.overlap, window=options.window)
    written = [write_picture(path, spectra(decomposed, peaks=options.peaks or 12)) for path in options.outputs]
    step = decomposed.frequencies[1] - decomposed.frequencies[0]
    remark(*notes, f"{decomposed.averages} averages, line spacing {step:.4g} Hz")
    peaks = decomposed.damped_peaks(options.peaks)
    say("peak    f [Hz]  zeta [%]" if len(peaks.frequencies) else "no significant peak")
    for number, (frequency, zeta) in enumerate(zip(peaks.frequencies, peaks.damping_ratios, strict=True), 1):
        say(f"{number:4d}  {frequency:8.4f}  " + (f"{100 * zeta:8.3f}" if zeta == zeta else "       -"))
    say(*written)
