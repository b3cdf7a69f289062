"""Commands that identify: one method, or all of them compared."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from modalscope.cli.reading import left_out, parse_orders, read_responses
from modalscope.model.checks import DataError

__all__ = ["compare", "identify"]

_PAGES = (".html", ".htm")


class _Progress:
    """A progress bar on stderr; nothing when that is not a terminal a person looks at."""

    def __init__(self, what: str) -> None:
        from tqdm import tqdm

        self._bar = tqdm(desc=what, unit="order", file=sys.stderr, leave=False, disable=None)

    def __call__(self, done: int, total: int) -> None:
        self._bar.total = total
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        """Take the bar away."""
        self._bar.close()


def identify(options: argparse.Namespace) -> None:
    """Find the modes in a file, print them, and write them where that is asked."""
    from modalscope.judging.bands import merge_bands

    orders, bands = parse_orders(options.orders), [tuple(band) for band in options.band or ()]
    if options.output is not None:
        _check_output(options.output)
        if len(bands) > 1 and options.output.suffix.lower() in _PAGES:
            raise DataError(
                f"one report on {len(bands)} bands was asked",
                "a report shows one stabilization diagram",
                "Write .json or .csv, or one report for each band.",
            )
    data = read_responses(options, "modes")
    wanted: list[Any] = list(bands) or [None]
    found = [_one_band(options, data, band, orders) for band in wanted]
    modes, diagram = found[0]
    if len(found) > 1:
        modes = merge_bands([modes for modes, _ in found], bands)
        print(f"\n{len(bands)} bands merged\n\n{modes.table()}")
    if options.output is not None:
        _write_result(options, modes, diagram)


def _one_band(options: argparse.Namespace, data: Any, band: Any, orders: range | None) -> tuple[Any, Any]:
    from modalscope.judging.select import select
    from modalscope.judging.stabilize import stabilize

    bar = _Progress("identifying")
    try:
        diagram = stabilize(
            data,
            method=options.method,
            domain=options.domain,
            orders=orders,
            band=band,
            exclude=options.exclude,
            progress=bar,
        )
    finally:
        bar.close()
    modes = select(diagram, frequencies=options.frequencies)
    _print_modes(modes, diagram)
    return modes, diagram


def compare(options: argparse.Namespace) -> None:
    """Identify a file by many methods, print what they agree on, and write the comparison where that is asked."""
    from modalscope.comparing import compare as compare_methods

    orders = parse_orders(options.orders)
    if options.output is not None:
        _check_output(options.output)
    data = read_responses(options, "methods compared")
    bar = _Progress("comparing")
    try:
        found = compare_methods(
            data,
            "all" if options.methods == ["all"] else options.methods,
            orders=orders,
            band=None if options.band is None else tuple(options.band),
            exclude=options.exclude,
            progress=bar,
        )
    finally:
        bar.close()
    print(found.table())
    if options.output is None:
        return
    if options.output.suffix.lower() in _PAGES:
        from modalscope.reporting import report

        report(found, options.output, source=str(options.file), command=_command(options))
        print(f"written: {options.output}")
    else:
        _write_modes(options, found.modes, method="consensus", domain="all", orders=orders or ())


def _check_output(path: Path) -> None:
    """Refuse a name that cannot be written before the work is done, not after it."""
    known = (".json", ".csv", ".uff", ".unv", ".html", ".htm", ".npz", ".h5", ".mat")
    if path.suffix.lower() not in known:
        raise DataError(
            f"writing {path.name} was asked",
            f"results are written as {', '.join(known)}",
            "Choose one of these suffixes.",
        )
    if path.is_dir() or not path.resolve().parent.is_dir():
        what = "that is a folder" if path.is_dir() else f"there is no folder {path.resolve().parent}"
        raise DataError(f"writing {str(path)!r} was asked", what, "Name a file in a folder that is there.")


def _print_modes(modes: Any, diagram: Any) -> None:
    from modalscope.modal.rebuilt import fit_of

    print(f"{diagram.method} ({diagram.domain}), orders {diagram.orders[0]} to {diagram.orders[-1]}")
    for note in diagram.notes:
        print(f"  {note}")
    if not len(modes):
        print("no mode stands out of the data")
        return
    print()
    print(modes.table())
    print(
        f"\nthe rebuilt responses leave {100 * fit_of(modes, diagram.response):.2f} % of the measured ones (by norm, in the band)"
    )


def _write_result(options: argparse.Namespace, modes: Any, diagram: Any) -> None:
    if options.output.suffix.lower() in _PAGES:
        from modalscope.reporting import report

        report((modes, diagram), options.output, source=str(options.file), command=_command(options))
        print(f"written: {options.output}")
    else:
        _write_modes(options, modes, method=diagram.method, domain=diagram.domain, orders=diagram.orders)


def _write_modes(options: argparse.Namespace, modes: Any, **found: Any) -> None:
    from modalscope.io import write

    beside = {**found, "data": {"file": options.file.name}} if options.output.suffix.lower() == ".json" else {}
    write(options.output, modes, **beside)
    print(f"written: {options.output}{left_out(options.output, modes)}")


def _command(options: argparse.Namespace) -> str:
    """Return the command that repeats the result."""
    given = dict(vars(options))
    words = ["modalscope", "compare" if "methods" in given else "identify", str(options.file)]
    for name in ("method", "domain", "quantity", "orders"):
        words += [f"--{name} {given[name]}"] if given.get(name) else []
    words += [f"--{name} {item}" for name in ("rename", "axes") for item in given.get(name) or ()]
    bands = given.get("band") or ()
    given["band"] = bands[0] if bands and isinstance(bands[0], list) else bands
    for name in ("methods", "band", "exclude", "frequencies"):
        values = [f"{v:g}" if isinstance(v, float) else str(v) for v in given.get(name) or ()]
        words += [f"--{name} {' '.join(values)}"] if values else []
    return " ".join([*words, f"-o {options.output}"])
