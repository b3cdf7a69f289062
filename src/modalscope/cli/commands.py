"""List the commands and build the parser of them all."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from inspect import cleandoc
from typing import NamedTuple

from modalscope import __version__
from modalscope.cli import about, app, files, identify, results, spectra, watch
from modalscope.cli.parser import Parser, add_common


class Command(NamedTuple):
    """A command: `run` gives its name, and its docstring the help; `add` adds its arguments to a parser."""

    run: Callable[[argparse.Namespace], None]
    add: Callable[[Parser], None]

    @property
    def name(self) -> str:
        """The name that is typed."""
        return self.run.__name__


#: The commands in the order of the help. `run` imports what it needs, so that the help loads no numerical library.
COMMANDS = (
    Command(identify.identify, identify.add_identify),
    Command(app.app, app.add_app),
    Command(watch.watch, watch.add_watch),
    Command(results.compare, results.add_compare),
    Command(results.certify, results.add_certify),
    Command(results.refine, results.add_refine),
    Command(results.report, results.add_report),
    Command(results.mac, results.add_mac),
    Command(results.plot, results.add_plot),
    Command(files.info, files.add_info),
    Command(files.plan, files.add_plan),
    Command(spectra.frf, spectra.add_frf),
    Command(spectra.psd, spectra.add_psd),
    Command(spectra.ods, spectra.add_ods),
    Command(files.merge, files.add_merge),
    Command(files.convert, files.add_convert),
    Command(results.realize, results.add_realize),
    Command(results.validate, results.add_validate),
    Command(about.methods, about.add_methods),
    Command(files.simulate, files.add_simulate),
    Command(about.selfcheck, about.add_selfcheck),
    Command(about.completion, about.add_completion),
)


def names() -> tuple[str, ...]:
    """Return the names of the commands."""
    return tuple(command.name for command in COMMANDS)


def build_parser() -> Parser:
    """Return the parser; each command carries the function that runs it."""
    parser = Parser(prog="modalscope", description="Modal identification: from measured data to modes of a structure.")
    parser.add_argument("--version", action="version", version=__version__, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    for command in COMMANDS:
        text = cleandoc(command.run.__doc__ or command.name)
        title = text.partition("\n")[0].rstrip(".")
        added = commands.add_parser(command.name, help=title[0].lower() + title[1:], description=text)
        added.set_defaults(run=command.run)
        command.add(added)
        add_common(added)
    *most, last = names()
    needed = f"a command is needed: {', '.join(most)} or {last} (see --help)"
    parser.set_defaults(parser=parser, run=lambda _: parser.error(needed))
    return parser
