"""modalscope identify: the modes in a file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.cli.parser import Commands, add_choices, add_file

if TYPE_CHECKING:
    from modalscope.model import ModalModel, StabilizationDiagram

__all__ = ["add", "run"]


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "identify", help="find the modes in a file", description="Find the modes in a file, automatically."
    )
    add_file(parser)
    parser.add_argument(
        "--method", help="a row of the table (see: modalscope methods); by default the one that suits the data"
    )
    parser.add_argument("--domain", help="time, z or s; by default the one that suits the data")
    add_choices(parser, bands=True)
    parser.add_argument(
        "--frequencies", nargs="+", type=float, metavar="HZ", help="report the modes at these frequencies"
    )
    parser.add_argument("-o", "--output", type=Path, help="write .json, .csv, .uff or an .html report")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Find the modes in a file, print them, and write them where that is asked."""
    from modalscope.cli.output import check_output, is_page, write_modes, write_page
    from modalscope.cli.reading import parse_orders, read_responses
    from modalscope.judging.bands import merge_bands

    orders, bands = parse_orders(options.orders), [tuple(band) for band in options.band or ()]
    check_output(options.output)
    if len(bands) > 1 and options.output is not None and is_page(options.output):
        _refuse_page_of(bands)
    data = read_responses(options, "modes")
    wanted: list[Any] = list(bands) or [None]
    found = [_one_band(options, data, band, orders) for band in wanted]
    modes, diagram = found[0]
    if len(found) > 1:
        modes = merge_bands([modes for modes, _ in found], bands)
        print(f"\n{len(bands)} bands merged\n\n{modes.table()}")
    if options.output is None:
        return
    if is_page(options.output):
        write_page(options, (modes, diagram))
    else:
        write_modes(options, modes, method=diagram.method, domain=diagram.domain, orders=diagram.orders)


def _refuse_page_of(bands: list[Any]) -> None:
    from modalscope.model import DataError

    raise DataError(
        f"one report on {len(bands)} bands was asked",
        "a report shows one stabilization diagram",
        "Write .json or .csv, or one report for each band.",
    )


def _one_band(
    options: argparse.Namespace, data: Any, band: Any, orders: range | None
) -> tuple[ModalModel, StabilizationDiagram]:
    from modalscope.cli.progress import progress
    from modalscope.judging.select import select
    from modalscope.judging.stabilize import stabilize

    with progress("identifying") as show:
        diagram = stabilize(
            data,
            method=options.method,
            domain=options.domain,
            orders=orders,
            band=band,
            exclude=options.exclude,
            progress=show,
        )
    modes = select(diagram, frequencies=options.frequencies)
    _print_modes(modes, diagram)
    return modes, diagram


def _print_modes(modes: ModalModel, diagram: StabilizationDiagram) -> None:
    from modalscope.modal.rebuilt import fit_of

    print(f"{diagram.method} ({diagram.domain}), orders {diagram.orders[0]} to {diagram.orders[-1]}")
    for note in diagram.notes:
        print(f"  {note}")
    if not len(modes):
        print("no mode stands out of the data")
        return
    print()
    print(modes.table())
    left = 100 * fit_of(modes, diagram.response)
    print(f"\nthe rebuilt responses leave {left:.2f} % of the measured ones (by norm, in the band)")
