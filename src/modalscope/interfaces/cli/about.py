"""Commands on the program itself: its methods, its published figures, its completion in shells."""

from __future__ import annotations

import argparse
import os

from modalscope.interfaces.cli.parser import Parser, add_page
from modalscope.interfaces.cli.process import progress, say


def add_methods(parser: Parser) -> None:
    """Add the arguments of `methods`."""
    parser.add("name", "a method, or its name in the literature: show only this one", nargs="?")


def methods(options: argparse.Namespace) -> None:
    """Print the table of methods."""
    from modalscope.data.shown import text_table
    from modalscope.identification.method_names import methods

    rows = [("name", "method", "domain", "realization", "report", "known as")]
    shown = methods(options.name)
    rows += [(m.common, m.name, m.domain, m.realization, m.section, "; ".join(m.known_as)) for m in shown]
    print(text_table(rows, left=range(6)))


def add_reproduce(parser: Parser) -> None:
    """Add the arguments of `reproduce`."""
    add_page(parser, "report-reproduced.html", "page to write")


def reproduce(options: argparse.Namespace) -> None:
    """Recompute what the founding report and others published: values, identities and misprints, on one page."""
    from modalscope.data import DataError
    from modalscope.interfaces.cli.output import check_output
    from modalscope.interfaces.reporting.reproduction import reproduce

    os.environ.setdefault("MPLBACKEND", "Agg")  # no window is opened
    check_output(options.output, (), options.force, (".html", ".htm"))
    with progress("reproducing"):
        parts = reproduce(options.output)
    wrong = [row for rows in parts.values() for row in rows if row[-1] != "yes"]
    say(*(f"{sum(r[-1] == 'yes' for r in rows)} of {len(rows)}: {title}" for title, rows in parts.items()))
    say(f"written: {options.output}")
    if wrong:
        what, expected, computed, *_ = wrong[0]
        fault = f"{len(wrong)} differ, first {what}: {computed}, expected {expected}"
        raise DataError("the report was to be reproduced", fault, "Report this, with your versions.")


def add_completion(parser: Parser) -> None:
    """Add the arguments of `completion`."""
    parser.add("shell", "bash, zsh, fish or tcsh", choices=("bash", "zsh", "fish", "tcsh"))


def completion(options: argparse.Namespace) -> None:
    """Print the script that lets a shell complete commands, options and files.

    For bash: modalscope completion bash > ~/.local/share/bash-completion/completions/modalscope
    """
    from modalscope.numerics.errors import optional_package

    shtab = optional_package("shell completion", "shtab", "completion")
    say(shtab.complete(options.parser, shell=options.shell))
