"""Commands on results: refined, certified, compared, drawn, reported."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.interfaces.cli.parser import (
    Parser,
    add_band,
    add_choices,
    add_file,
    add_files,
    add_geometry,
    add_method,
    add_orders,
    add_outputs,
    add_outside,
    add_pictures,
    add_reading,
    add_search,
)
from modalscope.interfaces.cli.process import explain, progress, remark, say

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def add_realize(parser: Parser) -> None:
    """Add the arguments of `realize`."""
    add_files(parser)
    parser.add("--order ORDER", "number of states (default: chosen by the data)", type=int)
    part = "share of records with inputs held out to judge candidates (default .25; 0: none)"
    parser.add("--holdout PART", part, default=0.25)
    parser.add("--unstable", "keep poles that grow")
    add_method(parser)
    add_choices(parser)
    add_outputs(parser, "write A, B, C, D as .mat, .npz, .h5 or .json, or a report of records with inputs, .html")


def realize(options: argparse.Namespace) -> None:
    """Identify a state-space model for control design, of records with inputs the one that simulates best what it was not fitted to."""
    from modalscope.analysis.workflow.realize import realize
    from modalscope.data.shown import summary_of
    from modalscope.interfaces.cli.output import check_outputs, write_outputs
    from modalscope.interfaces.cli.reading import choices, read_test

    check_outputs(options, options.files, (".mat", ".npz", ".h5", ".hdf5", ".json", ".html"), "model.mat")
    data, notes = read_test(options)
    with progress("identifying"):
        own = {"order": options.order, "stable": not options.unstable, "holdout": options.holdout}
        model = realize(data, **own, **choices(options))
    written = write_outputs(options, model, record=data, data={"file": ""})
    remark(*notes, *model.notes)
    if model.validation is not None:
        explain(model.validation.table())
    said = [] if model.validation is None else [summary_of(model.validation)]
    say(summary_of(model), *said, *written)


def add_validate(parser: Parser) -> None:
    """Add the arguments of `validate`."""
    parser.add("model MODEL", "state-space model, as `modalscope realize` writes it, or modes", type=Path)
    add_files(parser)
    sides = "of modes: sides that are left out in turn (default: inputs)"
    parser.add("--leaving {inputs,outputs}", sides, default="inputs")
    add_outputs(parser, "of a model: draw measured against simulated outputs, .png, .svg or .pdf")


def validate(options: argparse.Namespace) -> None:
    """Say how well a model simulates and predicts a record, or how well modes explain what they are not fitted to.

    Of a state-space model: variance of every output explained by simulation from the inputs alone, and one sample ahead, and whether the
    errors of prediction are white. Of modes: the unexplained part of each input or output that is left out in turn.
    """
    from modalscope.analysis.checking.validation import validate
    from modalscope.analysis.workflow.simulation import ModelValidation
    from modalscope.data.shown import summary_of
    from modalscope.interfaces.cli.output import PICTURES, check_outputs, write_picture
    from modalscope.interfaces.cli.reading import read_data, read_test
    from modalscope.interfaces.plot.on_axes import painted
    from modalscope.interfaces.reporting.simulations import simulation_picture

    check_outputs(options, (options.model, *options.files), PICTURES)
    model, told = read_data(options, options.model)
    data, notes = read_test(options)
    with progress("validating"):
        seen = validate(model, data, leaving=options.leaving)
    remark(*told, *notes)
    if not isinstance(seen, ModelValidation):
        say(summary_of(seen), "", seen.table())
        return
    written = [write_picture(path, lambda: painted(simulation_picture(model, data))) for path in options.outputs]
    say(summary_of(seen), "", seen.table_of_outputs(), *written)


def add_refine(parser: Parser) -> None:
    """Add the arguments of `refine`."""
    add_files(parser)
    parser.add("--modes MODES", "modes to start from: .json, .npz, .mat or .h5", required=True)
    add_choices(parser)
    parser.add("--complete", "add poles that are significant in the residual, where it is white")
    add_outputs(parser, "write .json, .csv, .uff, .npz, .mat or .h5")


def refine(options: argparse.Namespace) -> None:
    """Refine modes to the maximum of the likelihood, with standard deviations."""
    from modalscope.analysis.workflow.pairing import pair_modes
    from modalscope.interfaces.cli.output import check_outputs, write_outputs
    from modalscope.interfaces.cli.reading import choices, read_modes, read_test
    from modalscope.selection.judging.refine import refine

    check_outputs(options, (*options.files, options.modes))
    data, notes = read_test(options)
    modes = read_modes(options, options.modes)
    with progress("refining") as show:
        refined = refine(data, modes, complete=options.complete, settings=choices(options), progress=show)
    written = write_outputs(options, refined, method="refined")
    remark(*dict.fromkeys((*notes, *refined.notes)))
    say(refined.table(), "", "before (a) and after (b):", pair_modes(modes, refined).table(), *written)


def add_certify(parser: Parser) -> None:
    """Add the arguments of `certify`."""
    add_files(parser)
    add_search(parser)
    parser.add("--no-refine", "certify the values of the diagram", dest="refine", action="store_false")
    parser.add("--replicates N", "number of simulations (default: 40)", default=40)
    parser.add("--select", "repeat the selection of modes in each simulation")
    parser.add("--seed SEED", "seed of the simulations (default: 0)", type=int, default=0)
    add_outside(parser)
    add_outputs(parser, "write the modes with corrected intervals (.json, .csv, .uff), or an .html report")
    parser.set_defaults(frequencies=None, take=None, refuse=None, apart=False)


def certify(options: argparse.Namespace) -> None:
    """Check the intervals of the modes by simulations of the same case.

    The modes of a file are identified, the same case is simulated repeatedly, and the coverage of each interval is counted.
    """
    from modalscope.analysis.checking.certify import certify
    from modalscope.interfaces.cli.identify import result_of
    from modalscope.interfaces.cli.output import check_outputs, write_outputs

    check_outputs(options, options.files)
    result = result_of(options, options.files, saved=".json")
    with progress("simulating", "replicate") as show:
        own = {name: getattr(options, name) for name in ("replicates", "select", "seed")}
        certificate = certify(result, progress=show, **own)
    written = write_outputs(options, replace(result, modes=certificate.modes), certificate=certificate)
    diagram = result.diagram
    say(f"{diagram.method} ({diagram.domain}), simulated at order {certificate.order}\n\n{certificate.table()}")
    say(*(f"  {note}" for note in certificate.notes))
    passed = bool(certificate.holds.all())
    say("\nall intervals hold" if passed else f"\nwith corrected intervals:\n\n{certificate.modes.table()}", *written)


def add_compare(parser: Parser) -> None:
    """Add the arguments of `compare`."""
    add_files(parser)
    methods = "rows or cells of the table, such as era alternate/s (default: all)"
    parser.add("--methods METHOD...", methods, default=["all"])
    parser.add("--all-sets", "also run the rows without a vote, and show them")
    add_orders(parser)
    add_choices(parser)
    parser.add("--replicates N", "certify the intervals by this many simulations (see certify)", default=0)
    add_outputs(parser, "write .json, .csv, .uff (the consensus) or an .html report")


def compare(options: argparse.Namespace) -> None:
    """Identify a file by every method, and report on which modes they agree.

    All methods of the table are run; the output states where they agree, where they differ, and the likely causes. Intervals are no
    narrower than those of `modalscope identify`, and grades are its grades.
    """
    from modalscope.analysis.comparing import compare
    from modalscope.interfaces.cli.output import check_outputs, write_outputs
    from modalscope.interfaces.cli.reading import choices, read_test

    given = choices(options) | {"replicates": options.replicates, "all_sets": options.all_sets}
    check_outputs(options, options.files)
    data, notes = read_test(options)
    methods = "all" if options.methods == ["all"] else options.methods
    with progress("comparing") as show:
        comparison = compare(data, methods, progress=show, **given)
    comparison = replace(comparison, notes=(*notes, *comparison.notes))
    written = write_outputs(options, comparison, method="consensus", domain="all", orders=given["orders"] or ())
    remark(*notes)
    hint = () if options.verbose or options.quiet else ("\n-v prints the values of every method",)
    say(comparison.table(each=options.verbose), *hint, *written)


def add_next(parser: Parser) -> None:
    """Add the arguments of `next`."""
    add_files(parser)
    wish = 'what is asked of the modes: "damping 5 %%", "f .1 %%", "shapes .98", or several with commas (default: damping 5 %%)'
    parser.add("--ask TEXT", wish, default="damping 5 %")
    parser.add("--candidates DOF...", "places that may be taken (default: all known)")
    add_choices(parser)


def next(options: argparse.Namespace) -> None:
    """Say what to measure next: where, how often, and what each place reaches.

    Records with forces are taken as the responses that they give.
    """
    from modalscope.analysis.planning.next_measurement import asked_of, next_measurement
    from modalscope.analysis.workflow.analyze import analyze
    from modalscope.data.response import Response
    from modalscope.data.shown import summary_of
    from modalscope.interfaces.cli.reading import choices, read_test

    asked_of(options.ask)  # a wish that cannot be read is told before the work
    data, notes = read_test(options)
    given = choices(options)
    if data.input_dofs and not isinstance(data, Response) and given.get("route") is None:
        given["route"] = "frf"
    with progress("identifying") as show:
        result = analyze(data, progress=show, **given)
    remark(*notes, summary_of(result.data))
    say(str(next_measurement(result, ask=options.ask, candidates=options.candidates)))


def add_mac(parser: Parser) -> None:
    """Add the arguments of `mac`."""
    parser.add("first", "modes: .json, .uff, .npz, .mat or .h5", type=Path)
    parser.add("second", "modes to compare with", type=Path)
    tolerance = "maximum relative difference of two frequencies (default: 0.1)"
    parser.add("--tolerance TOLERANCE", tolerance, type=float, default=0.1)
    add_reading(parser)
    add_outputs(parser, "write the MAC matrix as a picture, .png, .svg or .pdf")


def mac(options: argparse.Namespace) -> None:
    """Pair two sets of modes: differences, MAC and COMAC."""
    from modalscope.analysis.workflow.pairing import pair_modes
    from modalscope.interfaces.cli.output import PICTURES, check_outputs, write_picture
    from modalscope.interfaces.cli.reading import read_modes
    from modalscope.interfaces.plot import mac

    check_outputs(options, (options.first, options.second), PICTURES)
    first, second = (read_modes(options, path) for path in (options.first, options.second))
    pairs = pair_modes(first, second, tolerance=options.tolerance)
    say(pairs.table(), *(write_picture(path, mac, pairs.a, pairs.b) for path in options.outputs))


def add_plot(parser: Parser) -> None:
    """Add the arguments of `plot`."""
    add_file(parser)
    parser.add("--modes FILE", "modes to draw over a response or a diagram")
    add_band(parser)
    parser.add("--mode K", "number of the mode, from one (default: 1)", type=int, default=1)
    parser.add("--channel DOF", "output to draw (default: the strongest)")
    parser.add("--input DOF", "input to draw (default: the strongest)")
    add_outputs(parser, "write .png, .svg or .pdf")


def plot(options: argparse.Namespace) -> None:
    """Draw the contents of a file: responses, spectra, mode shapes, a stabilization diagram, poles of a model, tracks of a store.

    A response is drawn with the modes of another file over it, records by their spectra, modes by the shape of one of them.
    """
    from modalscope.interfaces.cli.output import PICTURES, check_outputs, write_picture
    from modalscope.interfaces.cli.reading import read_data, read_modes

    check_outputs(options, [path for path in (options.file, options.modes) if path], PICTURES, "picture.png")
    if options.file.suffix.lower() == ".modes":
        say(*_pictures_of_store(options))
        return
    data, notes = read_data(options, options.file)
    modes = None if options.modes is None else read_modes(options, options.modes)
    written = [write_picture(path, _picture, data, modes, options) for path in options.outputs]
    remark(*notes)
    say(*written)


def _pictures_of_store(options: argparse.Namespace) -> list[str]:
    """Draw the modes of a store over time, joined into tracks."""
    from modalscope.analysis.monitoring import Store, track
    from modalscope.data import DataError
    from modalscope.interfaces.cli.output import write_picture
    from modalscope.interfaces.plot import tracks

    if not options.file.exists():
        raise DataError(f"the store {options.file}:", "there is no such file", "Make it: modalscope watch.")
    with progress("following modes"), Store(options.file) as store:
        found = track(store.history())
    remark(found.table())
    return [write_picture(path, tracks, found) for path in options.outputs]


def _picture(data: Any, modes: Any, options: argparse.Namespace) -> Axes:
    from modalscope.data import ModalModel, Signals, StabilizationDiagram
    from modalscope.data.response import Response
    from modalscope.interfaces import plot
    from modalscope.interfaces.plot.shown import drawn
    from modalscope.signals.preprocess import decomposition

    if isinstance(data, ModalModel):
        return plot.shape(data, options.mode - 1)
    if isinstance(data, StabilizationDiagram):
        return plot.stabilization(data, modes)
    if isinstance(data, Response):
        band = None if options.band is None else tuple(options.band)
        return plot.response(data.in_band(band), modes, options.channel, options.input)
    if isinstance(data, Signals):
        return plot.spectra(decomposition(data))
    return drawn(data)


def add_report(parser: Parser) -> None:
    """Add the arguments of `report`."""
    parser.add("file", "a result of identify (.json), an .analysis.json, or a diagram", type=Path)
    parser.add("--data FILE...", "the data files, if they were moved")
    add_outside(parser)
    parser.add("--title TITLE", "heading of the report")
    add_geometry(parser)
    add_outputs(parser, "write .html, .docx or .pptx")
    add_pictures(parser)


def report(options: argparse.Namespace) -> None:
    """Write a report on a saved result; its analysis is repeated on the same data.

    The result is a .json file of identify, an .analysis.json document or a stabilization diagram. The data file must be unchanged.
    """
    from modalscope.interfaces.cli.output import PAGES, check_outputs, write_file, write_pictures
    from modalscope.interfaces.plot.web.alive import selected
    from modalscope.io import set_max_memory

    set_max_memory(options.max_memory)
    check_outputs(options, (options.file, *(options.data or ())), PAGES, "report.html")
    with progress("identifying") as show:
        result = _saved(options, show)
    say(*(write_file(options, path, result, {}, title=options.title) for path in options.outputs))
    if options.pictures is not None:
        options.files = [options.file, *(options.data or ())]
        with progress("selecting"):
            modes, diagrams = selected(result)
        say(*write_pictures(options, modes, diagrams))


def _saved(options: argparse.Namespace, show: Any) -> Any:
    """Return the diagram of a file, or the result of its analysis on the data."""
    from modalscope.analysis.workflow.replay import replay
    from modalscope.data import DataError, StabilizationDiagram
    from modalscope.io import survey

    try:
        saved = survey(options.file).thing
    except DataError:
        saved = None  # a document alone contains no data: the error of `replay` says so
    if isinstance(saved, StabilizationDiagram):
        return saved
    return replay(options.file, options.data, allow_outside=options.allow_outside, progress=show)
