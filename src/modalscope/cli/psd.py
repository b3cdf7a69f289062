"""modalscope psd: singular values of the spectra of records without inputs."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands, add_files, add_outputs
from modalscope.cli.process import remark, say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "psd",
        help="singular values of the spectra of records, and their peaks (FDD, EFDD)",
        description="Singular values of the cross spectra of all outputs over frequency, and where the first of them peaks: a check "
        "that shares nothing with the methods of the table. A peak may be a resonance or a harmonic.",
    )
    add_files(parser)
    parser.add_argument(
        "--segment", type=int, metavar="N", help="samples of a segment; by default a twentieth of the record"
    )
    parser.add_argument("--overlap", type=float, default=0.5, help="part of a segment that the next one shares (0.5)")
    parser.add_argument("--window", default="hann", help="of every segment (hann)")
    parser.add_argument("--peaks", type=int, metavar="N", help="how many peaks are told; by default all that stand out")
    add_outputs(parser, "write a picture, .png, .svg or .pdf")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the peaks of the first singular value, and draw all of them where that is asked."""
    from modalscope.cli.output import PICTURES, check_outputs, write_picture
    from modalscope.cli.reading import read_test
    from modalscope.data import Signals
    from modalscope.numerics.checks import check_kind
    from modalscope.plot import spectra
    from modalscope.preprocess import decomposition

    check_outputs(options, options.files, PICTURES)
    data, told = read_test(options)
    check_kind("spectra of records", data, Signals)
    found = decomposition(data, segment=options.segment, overlap=options.overlap, window=options.window)
    written = [write_picture(path, spectra(found, peaks=options.peaks or 12)) for path in options.outputs]
    step = found.frequencies[1] - found.frequencies[0]
    for line in (*told, f"{found.averages} segments averaged, a line every {step:.4g} Hz"):
        remark(line)
    peaks = found.damped_peaks(options.peaks)
    say("peak    f [Hz]  zeta [%]" if len(peaks.frequencies) else "no peak stands out")
    for number, (frequency, zeta) in enumerate(zip(peaks.frequencies, peaks.damping_ratios, strict=True), 1):
        say(
            f"{number:4d}  {frequency:8.4f}  {100 * zeta:8.3f}"
            if zeta == zeta
            else f"{number:4d}  {frequency:8.4f}         -"
        )
    for line in written:
        say(line)
