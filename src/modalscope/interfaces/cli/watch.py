"""The command `watch`: new records of a folder into a store, and changes told."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from modalscope.interfaces.cli.parser import Parser, add_reading, add_search
from modalscope.interfaces.cli.process import complain, progress, remark, say

if TYPE_CHECKING:
    from modalscope.analysis.monitoring import Store

#: Exit status where a change was told.
EXIT_ALARM = 3


def add_watch(parser: Parser) -> None:
    """Add the arguments of `watch`."""
    add = parser.add
    folder = "folder of records, a file per record; their times stand in the names of the files"
    add("folder", folder, type=Path)
    add("--store FILE", "store of modes, such as bridge.modes", required=True)
    add("--once", "store what is there and stop (default: wait for more)")
    add("--again", "try files again that could not be used before")
    add("--every SECONDS", "seconds between two checks of the folder (default: 10)", default=10.0)
    add("--settled SECONDS", "how long a file stands still (default: 60)", default=60.0)
    add("--jobs N", "number of processes (default: 1)", default=1)
    add("--scheduler ADDRESS", "Dask scheduler whose workers identify; local:4 starts four processes")
    output = "report of the period, .html: tracks, covariates, control chart, records that could not be used"
    add("-o/--output REPORT", output)
    add("--reference FIRST LAST", "times of the sound structure, UTC: changes after them are alarms")
    add("--false-per-year N", "rate of false alarms (default: 1)", type=float, default=1.0)
    add("--chart PICTURE", "with --reference: draw the control chart, .png, .svg or .pdf")
    add("--call COMMAND", "with --reference: command run at each alarm; it reads the alarm as JSON from its input")
    add("--force", "replace a picture or report that modalscope did not write")
    add("--covariates CSV", "table of temperature, wind ...: time, then a column for each")
    add_reading(parser)
    add_search(parser)


def watch(options: argparse.Namespace) -> None:
    """Identify every new record of a folder, store its modes, and tell changes.

    Files that cannot be used are listed with their reasons; the rest goes on. Every record is stored once, whatever ends the command; a
    file that changed replaces its record. With --reference, modes are followed through all records, and each alarm is a line of JSON, told
    once; with --once, the exit status is 3 then.
    With -o, a report of the period is written after every look that found something new.
    """
    import time

    from modalscope.analysis.monitoring import Store, read_covariates
    from modalscope.interfaces.cli.identify import workers_of

    pause = _checked(options)
    told = False
    with Store(options.store) as store, workers_of(options):
        if options.covariates is not None:
            times, columns = read_covariates(options.covariates)
            for name, values in columns.items():
                store.add_covariates(name, times, values)
        if options.again:
            store.forget_refused()
        while True:
            if _look(options, store) or options.once:
                told |= _tell(options, store)
            if options.once:
                remark(f"{options.store}: {store.history()!r}")
                if told:
                    raise SystemExit(EXIT_ALARM)
                return
            time.sleep(pause)


def _checked(options: argparse.Namespace) -> float:
    """Raise for options that cannot be met, before the work is done; return the seconds between two looks."""
    from modalscope.interfaces.cli.output import PICTURES, check_output
    from modalscope.numerics.checks import check_positive
    from modalscope.numerics.errors import DataError

    if options.reference is None and (options.chart or options.call):
        raise DataError("a chart of changes needs --reference", "none was given", "Add --reference FIRST LAST.")
    for path, suffixes in ((options.chart, PICTURES), (options.output, (".html", ".htm"))):
        if path is not None:
            check_output(path, (), options.force, suffixes)
    return check_positive("--every", options.every)


def _tell(options: argparse.Namespace, store: Store) -> bool:
    """Write the report and tell changes, where they were asked for; return whether there was one. Too few records are no end of waiting."""
    from modalscope.numerics.errors import DataError

    try:
        _report(options, store)
        return options.reference is not None and _judge(options, store)
    except DataError as error:
        if options.once:
            raise
        complain(error.args[0])
        return False


def _report(options: argparse.Namespace, store: Store) -> None:
    """Write the report of the period, where one was asked for."""
    if options.output is None:
        return
    from modalscope.interfaces.reporting.document import write_page
    from modalscope.interfaces.reporting.months import months_sections

    with progress(f"writing {options.output.name}"):
        parts = months_sections(store, reference=options.reference, false_per_year=options.false_per_year)
        written = write_page(options.output, store.path.name, "Months of records", parts, [store.path])
    remark(str(written))


def _judge(options: argparse.Namespace, store: Store) -> bool:
    """Follow the modes of all records, and tell the alarms that were not told before; return whether there was one."""
    import subprocess

    from modalscope.analysis.monitoring import alarms, track
    from modalscope.interfaces.cli.output import write_picture

    with progress("following modes"):
        tracks = track(store.history())
        found = alarms(tracks, reference=options.reference, false_per_year=options.false_per_year)
    remark(tracks.table(), *found.notes)
    new = [alarm for alarm in found.alarms if store.tell(alarm)]
    for alarm in new:
        line = json.dumps(alarm.to_dict())
        say(line)
        if options.call is not None:  # as the user's shell would
            status = subprocess.run(options.call, input=line.encode(), shell=True, check=False).returncode
            if status:
                complain(f"--call: the command failed (status {status}); the alarm counts as told")
    if options.chart is not None:
        from modalscope.interfaces.plot import control_chart

        remark(write_picture(options.chart, control_chart, found))
    return bool(new)


def _look(options: argparse.Namespace, store: Store) -> bool:
    """Store what is new, and list what cannot be used; return whether anything is new."""
    from modalscope.analysis.monitoring import collect
    from modalscope.interfaces.cli.reading import choices, reading_options

    given = choices(options) | {"reading": reading_options(options, options.folder) or None}
    with progress("identifying", "record") as show:
        own = {"jobs": options.jobs, "settled": options.settled, "options": given}
        found = collect(options.folder, store, **own, progress=show)
    for name, reason in found.refused:
        complain(f"{name}: {reason}")
    if found.added or found.refused or options.once:
        remark(f"{found.added} stored, {found.known} known before, {len(found.refused)} cannot be used")
    if found.replaced:
        remark(f"their content changed, the earlier record is replaced: {', '.join(found.replaced)}")
    if found.waiting and options.once:
        complain(f"still being written, left for the next run: {', '.join(found.waiting)}")
    return found.added > 0
