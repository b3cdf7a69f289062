"""The command `watch`: new records of a folder into a store."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.cli.parser import Parser, add_choices, add_method, add_orders, add_reading
from modalscope.cli.process import complain, progress, remark, say

if TYPE_CHECKING:
    from modalscope.monitoring import Store


def add_watch(parser: Parser) -> None:
    """Add the arguments of `watch`."""
    add = parser.add_argument
    add("folder", type=Path, help="folder of records, a file a record; their times stand in the names of the files")
    add("--store", type=Path, required=True, metavar="FILE", help="store of modes, such as bridge.modes")
    add("--once", action="store_true", help="store what is there and stop (default: wait for more)")
    add("--again", action="store_true", help="try files again that could not be used before")
    add("--every", type=float, default=10.0, metavar="SECONDS", help="time between two looks (default: 10)")
    add("--jobs", type=int, default=1, metavar="N", help="number of processes (default: 1)")
    add("--covariates", type=Path, metavar="CSV", help="table of temperature, wind ...: time, then a column for each")
    add_reading(parser)
    add_method(parser)
    add_orders(parser)
    add_choices(parser, bands=True)


def watch(options: argparse.Namespace) -> None:
    """Identify every new record of a folder, and store its modes.

    Files that cannot be used are listed with their reasons; the rest goes on. Every record is stored once, whatever ends the command.
    """
    import time

    from modalscope.monitoring import Store, read_covariates
    from modalscope.numerics.checks import check_positive

    pause = check_positive("--every", options.every)
    with Store(options.store) as store:
        if options.covariates is not None:
            store.add_covariates(*read_covariates(options.covariates))
        if options.again:
            store.forget_refused()
        while True:
            _look(options, store)
            if options.once:
                say(f"{options.store}: {store.history()!r}")
                return
            time.sleep(pause)


def _look(options: argparse.Namespace, store: Store) -> None:
    """Store what is new, and list what cannot be used."""
    from modalscope.monitoring import collect

    with progress("identifying", "record") as show:
        found = collect(options.folder, store, jobs=options.jobs, options=_choices(options), progress=show)
    for name, reason in found.refused:
        complain(f"{name}: {reason}")
    if found.added or found.refused or options.once:
        remark(f"{found.added} stored, {found.known} known before, {len(found.refused)} cannot be used")
    if found.waiting and options.once:
        complain(f"still being written, left for the next run: {', '.join(found.waiting)}")


def _choices(options: argparse.Namespace) -> dict[str, Any]:
    """Return the choices of the command line as `analyze` takes them."""
    from modalscope.cli.reading import choices, parse_orders, reading_options

    bands = [tuple(band) for band in options.band or ()]
    given = choices(options) | {"band": bands[0] if len(bands) == 1 else bands or None}
    reading = reading_options(options, options.folder)
    return given | {
        "method": options.method,
        "domain": options.domain,
        "orders": parse_orders(options.orders),
        "reading": reading or None,
    }
