"""The command `identify`: from files to modes, in this process or by the workers of a Dask scheduler."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.interfaces.cli.parser import (
    Parser,
    add_expert,
    add_files,
    add_outputs,
    add_outside,
    add_pictures,
    add_search,
    add_workers,
)
from modalscope.interfaces.cli.process import (
    EXIT_PARTLY,
    EXIT_WRONG,
    MAX_COLUMNS,
    complain,
    explain,
    narrowed,
    note,
    progress,
    remark,
    say,
)
from modalscope.numerics.errors import DataError

if TYPE_CHECKING:
    from modalscope.data import ModalModel
    from modalscope.data.results import Result

#: By default Dask's workers return freed memory at once and request it again for the next transform; with these they keep it. Its monitors
#: run less often: at tasks of seconds the default intervals cost a tenth of a processor per process.
LOCAL_SETTINGS = {
    **{f"distributed.nanny.pre-spawn-environ.MALLOC_{name}_THRESHOLD_": 1_000_000_000 for name in ("TRIM", "MMAP")},
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.monitor-interval": "2s",
}

#: Prefix of the address of processes on this machine.
_LOCAL_ADDRESS = "local"

#: Seconds that a scheduler has to answer.
_CONNECT_SECONDS = 20


def add_identify(parser: Parser) -> None:
    """Add the arguments of `identify`."""
    add_files(parser)
    add_search(parser)
    add = parser.group("modes")
    add("--frequencies HZ...", "report the modes at these frequencies only")
    add("--take HZ...", "also report the modes at these frequencies")
    add("--refuse HZ...", "do not report the modes at these frequencies")
    add("--no-refine", "no maximum likelihood refinement", dest="refine", action="store_false")
    add = parser.group("output")
    add("--all", "also print the candidates left out, with reasons")
    add("--wide", "print all columns: spreads, significance, indicators")
    add = parser.group("several files")
    each = "each file, and each test in it, by itself: one table, with modes paired to those of the first file"
    add("--each", each)
    add("--reference MODES", "with --each: file of modes to pair with")
    add("--apart", "identify the setups one by one and merge their modes, not their records")
    add_outside(parser)
    add_workers(parser)
    add_expert(parser)
    add_outputs(parser, "write .json, .csv, .xlsx, .uff or a report: .html, .docx, .pptx")
    add_pictures(parser)


def identify(options: argparse.Namespace) -> None:
    """Identify the modes in a file, automatically.

    Several files are the parts of one test; with --each, every file is a test of its own.
    """
    from modalscope.interfaces.cli.output import PAGES, check_outputs, write_outputs, write_pictures

    if options.each:
        _run_each(options)
        return
    check_outputs(options, options.files)
    if options.apart and any(path.suffix.lower() in PAGES for path in options.outputs):
        asked = "a report covers one measurement"
        raise DataError(asked, "setups identified apart are several", "Write .json or .csv, or one report per setup.")
    result = result_of(options, options.files)
    written = write_outputs(options, result)
    written += write_pictures(options, result.modes, result.diagrams)
    _print(result, everything=options.all, wide=options.wide)
    say(*written)


@contextmanager
def workers_of(options: argparse.Namespace) -> Iterator[None]:
    """Use the executor of the command line while the block runs, and save partial sums if asked.

    `options`: with `scheduler` and `resume`, if the command has them.
    """
    from modalscope.numerics.executors import working

    address, save = getattr(options, "scheduler", None), getattr(options, "resume", None)
    with ExitStack() as stack:
        client = None if address is None else _client(address, stack)
        show = stack.enter_context(progress("summing", "stretch", at_once=False))
        stack.enter_context(working(client, progress=show, save=save))
        yield


def _client(address: str, stack: ExitStack) -> Any:
    """Return a client of a scheduler; the stack closes it and the processes that were started for it."""
    from modalscope.numerics.errors import optional_package

    distributed = optional_package("--scheduler", "distributed", "cluster")
    if address.split(":")[0] == _LOCAL_ADDRESS:
        count = address.removeprefix(_LOCAL_ADDRESS).removeprefix(":")
        if count and not (count.isdecimal() and int(count)):
            raise _wrong(address, f"{count!r} is no number of processes")
        workers: dict[str, Any] = {"n_workers": int(count)} if count else {}
        stack.enter_context(optional_package("--scheduler", "dask", "cluster").config.set(LOCAL_SETTINGS))
        workers |= {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": 40}
        address = stack.enter_context(distributed.LocalCluster(**workers))
    try:
        client = stack.enter_context(distributed.Client(address, timeout=_CONNECT_SECONDS))
        if not client.nthreads():
            complain(f"{address} has no worker yet; waiting for one: dask worker {address}")
        return client
    except (OSError, ValueError, TypeError) as error:
        raise _wrong(address, f"no scheduler answers there ({type(error).__name__}: {error})") from None


def _wrong(address: str, reason: str) -> DataError:
    remedy = "Give the address that `dask scheduler` prints, or local:4."
    return DataError(f"--scheduler {address}:", reason, remedy)


def result_of(options: argparse.Namespace, files: list[Path], saved: str = ".analysis.json") -> Result:
    """Return the result of the files of one test with the choices of the command line, or of a saved analysis, repeated."""
    from modalscope.analysis.workflow.analyze import analyze
    from modalscope.analysis.workflow.replay import replay
    from modalscope.interfaces.cli.reading import choices, reading_options

    if len(files) == 1 and files[0].name.lower().endswith(saved):
        with progress("identifying") as show:
            return replay(files[0], allow_outside=options.allow_outside, progress=show)
    given = choices(options) | {name: getattr(options, name) for name in ("frequencies", "refine", "apart")}
    given |= {"take": options.take or (), "refuse": options.refuse or ()}
    reading = [reading_options(options, path) for path in files]
    with workers_of(options), progress("identifying") as show:
        return analyze(files[0] if len(files) == 1 else files, reading=reading, progress=show, **given)


#: Notes on how the data are interpreted, printed before the modes.
_ON_READING = ("file", "places", "base", "free decay", "units", "units not known", "bands chosen")


def _print(result: Result, *, everything: bool = False, wide: bool = False) -> None:
    """Print a result: the table, the verdict, how the data were read, findings, notes, candidates left out.

    Each note is printed once, in one line; its reasons and those on computing only with --verbose. `everything`: also the candidates.
    `wide`: all columns.
    """
    from modalscope.data.shown import summary_of
    from modalscope.interfaces.plot.web.verdict import grouped, notes_that_matter, verdict_of_result

    verdict = verdict_of_result(result)
    if len(result.modes):
        table = result.modes.table(wide=wide) if wide else narrowed(result.modes.table(), MAX_COLUMNS)
        say(table, "")
    else:
        reasons = [str(note) for note in result.modes.notes if note.kind == "no mode"]
        say(next(iter(reasons), "no significant mode"))
    candidates = result.modes.left_out
    left = [f"Left out: {len(candidates)} (--all)."] if candidates and not everything else []
    first = " ".join([*verdict.unexplained, *verdict.graded, *left])
    say(*filter(None, [first]), *verdict.warnings)
    texts, computing = notes_that_matter(told for told in result.notes if told.kind not in _ON_READING)
    remark(summary_of(result.data), *_methods(result), *verdict.taken)
    note(*(told for told in result.notes if told.kind in _ON_READING))
    note(*(f"data: {finding}" for finding in grouped(result.findings)), *(f"note: {text}" for text in texts))
    if candidates and everything:
        say("left out:")
        for candidate in candidates:
            significance = "" if candidate.gain != candidate.gain else f" (significance {candidate.gain:.1f})"
            say(f"  {candidate}{significance}. {candidate.remedy}")
    for settings in result.settings:
        explain("settings: " + ", ".join(f"{name}={value!r}" for name, value in settings.items()))
    explain("computing:", *(f"  {text}" for text in computing))
    explain(*(f"mode {index + 1}: {reasons.get('text', '')}" for index, reasons in enumerate(result.modes.reasons)))


def _methods(result: Result) -> list[str]:
    """Return method and orders of each band or setup."""
    from modalscope.identification.method_names import cell_label
    from modalscope.interfaces.reporting.sections import bands_of

    apart, bands = result.analysis.apart, bands_of(result.diagrams)
    lines: dict[str, list[str]] = {}
    for band in bands:
        diagram = band.diagram
        orders = f"orders {diagram.orders[0]} to {diagram.orders[-1]}"
        which = f"setup {band.number}" if apart else band.words
        lines.setdefault(f"{cell_label(diagram.method, diagram.domain)}, {orders}", []).append(which)
    return [text if len(lines) == 1 else f"{', '.join(which)}: {text}" for text, which in lines.items()]


def _run_each(options: argparse.Namespace) -> None:
    """Identify every file by itself, and print the modes of all, paired with those of the first that has any.

    An output names the files to write: `-o results.json` gives results_NAME.json for every NAME. A file that cannot be used is one line on
    stderr, and the others are identified; the exit status is 4 then, and 2 if none could be used.
    """
    from modalscope.interfaces.cli.output import check_output, write_outputs, write_pictures
    from modalscope.interfaces.cli.reading import each_test, read_modes

    each = each_test(options)
    reference = None if options.reference is None else read_modes(options, options.reference)
    parts = [name.partition(", ") for name, _ in each]  # `tower.csv`, or `tower.csv, run 2`
    stems = ["_".join([Path(file).stem, *re.findall(r"\w+", test)]) for file, _, test in parts]
    places = [[out.with_name(f"{out.stem}_{stem}{out.suffix}") for out in options.outputs] for stem in stems]
    targets = [place for group in places for place in group]
    for target in targets:
        check_output(target, options.files, options.force)
        if targets.count(target) > 1:
            asked, clash = "a file per test:", f"{target.name} would be written for several"
            raise DataError(asked, clash, "Give the files distinct names, or identify them one by one.")
    tests: list[tuple[str, ModalModel]] = []
    failed = []
    for (name, alone), written in zip(each, places, strict=True):
        try:
            result = result_of(alone, alone.files)
        except DataError as error:
            complain(f"{name}: {error.args[0]}")
            failed.append(name)
            continue
        alone.outputs = written
        remark(*write_outputs(alone, result), *write_pictures(alone, result.modes, result.diagrams))
        tests.append((name, result.modes))
    if tests:
        say(_table(tests, reference))
    if failed:
        complain(f"{len(failed)} of {len(each)} files failed: {', '.join(failed)}")
        raise SystemExit(EXIT_PARTLY if tests else EXIT_WRONG)


def _table(tests: Sequence[tuple[str, ModalModel]], reference: ModalModel | None) -> str:
    """Return frequencies and damping ratios of several tests, a column per test, a row per mode of the reference.

    `reference`: by default the first test that has modes.
    """
    import numpy as np

    from modalscope.analysis.workflow.pairing import pair_modes
    from modalscope.data.shown import text_table

    first = next((modes for _, modes in tests if len(modes)), None) if reference is None else reference
    if first is None:
        return "no significant mode in any file"
    columns, others = [["mode", *(str(i + 1) for i in range(len(first)))]], []
    if reference is not None:
        columns.append(["reference", *map(_values, first.frequencies, first.damping_ratios)])
    frequencies = np.full((len(tests), len(first)), np.nan)
    for k, (name, modes) in enumerate(tests):
        cells = [name, *["-"] * len(first)]
        pairs = pair_modes(first, modes)
        for i, j in zip(pairs.first, pairs.second, strict=True):
            cells[i + 1] = _values(modes.frequencies[j], modes.damping_ratios[j])
        frequencies[k, pairs.first] = modes.frequencies[pairs.second]
        columns.append(cells)
        alone = ", ".join(f"{f:.4f} Hz" for f in modes.frequencies[pairs.alone[1]])
        others += [f"only in {name}: {alone}"] if alone else []
    known = [f[np.isfinite(f)] for f in frequencies.T]
    columns.append(["scatter of f", *(f"{100 * f.std(ddof=1) / f.mean():.3f} %" if f.size > 1 else "-" for f in known)])
    return "\n".join([text_table(zip(*columns, strict=True), left=(len(columns) - 1,)), *others])


def _values(frequency: float, damping_ratio: float) -> str:
    return f"{frequency:.4f} Hz {100 * damping_ratio:.3f} %"
