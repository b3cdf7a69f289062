"""List the commands and build the parser of them all."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from inspect import cleandoc
from itertools import groupby
from sys import modules
from textwrap import fill
from typing import Any, NamedTuple

from modalscope import __version__
from modalscope.interfaces.cli import about, app, demo, files, identify, results, spectra, watch
from modalscope.interfaces.cli.parser import Parser, add_common


class Command(NamedTuple):
    """A command: `run` gives its name, and its docstring the help; `add` adds its arguments to a parser."""

    run: Callable[[argparse.Namespace], None]
    add: Callable[[Parser], None]
    group: str = ""

    @property
    def name(self) -> str:
        """The name that is typed."""
        return self.run.__name__

    @property
    def title(self) -> str:
        """What it does, in one line."""
        return cleandoc(self.run.__doc__ or self.name).partition("\n")[0].rstrip(".")


#: The groups of the help, and the commands in each. `run` imports what it needs, so that the help loads no numerical library.
_GROUPS: dict[str, tuple[Callable[[argparse.Namespace], None], ...]] = {
    "first": (
        demo.demo,
        app.app,
        files.info,
        identify.identify,
        results.compare,
        results.mac,
        results.report,
        watch.watch,
    ),
    "look": (results.plot, spectra.psd, spectra.ods),
    "check": (results.refine, results.certify, results.next, about.methods, about.reproduce),
    "models": (results.realize, results.validate, files.simulate),
    "files": (spectra.frf, files.merge, files.convert, files.anonymize, about.completion),
}
#: Beside each command `name` its module has `add_name`.
COMMANDS = tuple(
    Command(run, getattr(modules[run.__module__], f"add_{run.__name__}"), group)
    for group, members in _GROUPS.items()
    for run in members
)

_EXAMPLE = "modalscope identify test.uff -o report.html"
_MORE = "modalscope COMMAND --help lists the options of a command; modalscope --version prints the version."
_ABOUT = "Modal identification: from measured data to modes of a structure."


def names() -> tuple[str, ...]:
    """Return the names of the commands."""
    return tuple(command.name for command in COMMANDS)


class Overview(Parser):
    """The parser of all commands: its help lists them by what they are for."""

    def format_help(self) -> str:
        """Return the commands in groups, one example, and how to learn more."""
        parts = ["usage: modalscope COMMAND ...", self.description or "", f"  {_EXAMPLE}"]
        for group, members in groupby(COMMANDS, key=lambda command: command.group):
            lines = [fill(f"{c.name:11} {c.title}", 96, **_INDENT) for c in members]
            parts.append("\n".join([group, *lines]))
        parts.append(_MORE)
        return "\n\n".join(parts) + "\n"


_INDENT: dict[str, Any] = {"initial_indent": "    ", "subsequent_indent": 16 * " "}


def build_parser() -> Parser:
    """Return the parser; each command carries the function that runs it."""
    parser = Overview(prog="modalscope", description=_ABOUT)
    parser.add_argument("--version", action="version", version=__version__)
    commands = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    for command in COMMANDS:
        added = commands.add_parser(command.name, description=cleandoc(command.run.__doc__ or ""))
        added.set_defaults(run=command.run)
        command.add(added)
        add_common(added)
        added.arrange()
    parser.set_defaults(parser=parser, run=lambda _: parser.print_help(), quiet=False, verbose=False, log=None)
    return parser
