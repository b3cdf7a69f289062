"""List the commands and build the parser of them all."""

from __future__ import annotations

from modalscope import __version__
from modalscope.cli import (
    app,
    certify,
    compare,
    completion,
    convert,
    frf,
    identify,
    info,
    mac,
    merge,
    methods,
    plan,
    plot,
    psd,
    realize,
    refine,
    report,
    selfcheck,
    simulate,
)
from modalscope.cli.parser import Parser, add_common

#: The commands in the order of the help. Each is a module with `add`, what can be written, and `run`, what is done; `run`
#: imports what it needs itself, so that the help of all costs the import of none.
COMMANDS = (
    identify,
    app,
    compare,
    certify,
    refine,
    report,
    mac,
    plot,
    info,
    plan,
    frf,
    psd,
    merge,
    convert,
    realize,
    methods,
    simulate,
    selfcheck,
    completion,
)


def names() -> tuple[str, ...]:
    """Return the names of the commands, those of their modules."""
    return tuple(command.__name__.rpartition(".")[2] for command in COMMANDS)


def build_parser() -> Parser:
    """Return the parser; each command carries the function that runs it."""
    parser = Parser(prog="modalscope", description="Measured responses of a structure to its modes.")
    parser.add_argument("--version", action="version", version=__version__, help="print the version and stop")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    for command in COMMANDS:
        command.add(commands)
    for each in commands.choices.values():
        add_common(each)
    *most, last = commands.choices
    needed = f"a command is needed: {', '.join(most)} or {last} (see --help)"
    parser.set_defaults(parser=parser, run=lambda _: parser.error(needed))
    return parser
