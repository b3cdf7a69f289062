"""Commands from records to responses and spectra."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.interfaces.cli.parser import Parser, add_band, add_files, add_outputs
from modalscope.interfaces.cli.process import progress, remark, say

#: Options that `joined_frf` takes, too; without a value its default counts.
_ESTIMATOR_OPTIONS = ("estimator", "segment", "overlap", "window", "period")


def add_frf(parser: Parser) -> None:
    """Add the arguments of `frf`."""
    add_files(parser)
    parser.add("--estimator ESTIMATOR", "h1 (default), h2, hv, or leakage-free: lpm, lrm")
    parser.add("--segment N", "samples per segment; default: chosen by the record")
    parser.add("--overlap OVERLAP", "overlap of consecutive segments, 0 to 1", type=float)
    parser.add("--window WINDOW", "window of each segment, such as hann or none")
    parser.add("--period N", "samples per period of a periodic excitation")
    add_band(parser)
    add_outputs(parser, "write .uff, .npz, .mat, .h5, .csv, or a picture .png, .svg or .pdf")


def frf(options: argparse.Namespace) -> None:
    """Estimate frequency responses from records with inputs, and write them."""
    from modalscope.data import Records, Signals
    from modalscope.data.records import as_records
    from modalscope.data.shown import summary_of
    from modalscope.interfaces.cli.output import DATA, PICTURES, check_outputs, write_data, write_picture
    from modalscope.interfaces.cli.reading import read_test
    from modalscope.interfaces.plot import response
    from modalscope.numerics.checks import check_kind
    from modalscope.signals.doctor import examine
    from modalscope.signals.preprocess.merging import joined_frf

    check_outputs(options, options.files, (*DATA, *PICTURES), "frf.uff")
    data, notes = read_test(options)
    check_kind("frequency responses of records", data, (Signals, Records))
    given = {name: value for name in _ESTIMATOR_OPTIONS if (value := getattr(options, name)) is not None}
    with progress("estimating responses"):
        frf = joined_frf(as_records(data).stacked(), **given)
    if options.band is not None:
        frf = frf.band(*options.band)
    drawn = {path for path in options.outputs if path.suffix.lower() in PICTURES}
    written = [write_picture(p, response, frf) if p in drawn else write_data(p, frf) for p in options.outputs]
    with progress("examining"):
        findings = examine(frf)
    remark(*notes, summary_of(frf), *(f"  {line}" for line in (*frf.processing, *findings)))
    say(*written)


def add_psd(parser: Parser) -> None:
    """Add the arguments of `psd`."""
    add_files(parser)
    parser.add("--segment N", "samples per segment (default: 1/20 of the record)")
    parser.add("--overlap OVERLAP", "overlap of consecutive segments (default: 0.5)", type=float, default=0.5)
    parser.add("--window WINDOW", "window of each segment (default: hann)", default="hann")
    parser.add("--peaks N", "number of peaks (default: all significant ones)")
    add_outputs(parser, "write a picture, .png, .svg or .pdf")


def psd(options: argparse.Namespace) -> None:
    """Compute the singular values of the spectra of records, and their peaks (FDD, EFDD).

    The first singular value of the cross spectra of all outputs peaks at resonances and harmonics. The estimate is independent of the
    methods of the table.
    """
    from modalscope.data import Signals
    from modalscope.interfaces.cli.output import PICTURES, check_outputs, write_picture
    from modalscope.interfaces.cli.reading import read_test
    from modalscope.interfaces.plot import spectra
    from modalscope.numerics.checks import check_kind
    from modalscope.signals.preprocess import decomposition

    check_outputs(options, options.files, PICTURES)
    data, notes = read_test(options)
    check_kind("spectra of records", data, Signals)
    with progress("estimating spectra"):
        decomposed = decomposition(data, segment=options.segment, overlap=options.overlap, window=options.window)
    with progress("finding peaks"):
        peaks = decomposed.damped_peaks(options.peaks)
    written = [write_picture(path, spectra, decomposed, peaks=options.peaks or 12) for path in options.outputs]
    step = decomposed.frequencies[1] - decomposed.frequencies[0]
    remark(*notes, f"{decomposed.averages} averages, line spacing {step:.4g} Hz")
    say("peak    f [Hz]  zeta [%]" if len(peaks.frequencies) else "no significant peak")
    for number, (frequency, zeta) in enumerate(zip(peaks.frequencies, peaks.damping_ratios, strict=True), 1):
        say(f"{number:4d}  {frequency:8.4f}  " + (f"{100 * zeta:8.3f}" if zeta == zeta else "       -"))
    say(*written)


def add_ods(parser: Parser) -> None:
    """Add the arguments of `ods`."""
    add_files(parser)
    parser.add("--frequency HZ...", "frequencies; the nearest lines are taken")
    parser.add("--order K...", "orders of a rotation, all that are loud", type=float)
    parser.add("--tacho CHANNEL", "channel of pulses, one a turn")
    parser.add("--time S...", "times of a record, from its first sample")
    parser.add("--input CHANNEL", "motion per force at one input (default: all)")
    add_outputs(parser, "write the shapes as .uff, .npz, .mat, .h5 or .csv, or a film .gif")


def ods(options: argparse.Namespace) -> None:
    """Compute operating deflection shapes: the measured motion at a frequency, at a time, or at an order of a rotation.

    The motion of all modes together; each output file has all shapes; a film shows them side by side.
    """
    from modalscope.data.records import Records
    from modalscope.interfaces.cli.output import DATA, check_outputs, write_data
    from modalscope.interfaces.cli.reading import read_test
    from modalscope.interfaces.plot import animate
    from modalscope.signals.preprocess.ods import ods

    check_outputs(options, options.files, (*DATA, ".gif"))
    data, notes = read_test(options)
    stacked = data.stacked() if isinstance(data, Records) else (data,)
    data = stacked[0] if len(stacked) == 1 else data
    asked = {name: getattr(options, name) for name in ("frequency", "input", "order", "tacho", "time")}
    with progress("computing shapes"):
        shapes = ods(data, **asked)

    def film(path: Path) -> str:
        with progress(f"drawing {path.name}"):
            return f"written: {animate(shapes, range(len(shapes)), path)}"

    written = [film(p) if p.suffix.lower() == ".gif" else write_data(p, shapes) for p in options.outputs]
    remark(*notes, *shapes.notes)
    say("         f [Hz]  largest motion at")
    for number, (f, shape) in enumerate(zip(shapes.frequencies, shapes.shapes.T, strict=True), 1):
        k = int(abs(shape).argmax())
        say(f"{number:4d}  {f:9.4f}  {shapes.output_dofs[k]}  {abs(shape[k]):.4g}")
    say(*written)
