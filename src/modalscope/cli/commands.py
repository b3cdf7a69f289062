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

#: The commands in the order of the help. Each is a module: the first line of its docstring is the help, all of it the description,
#: `add` adds its arguments and `run` runs it. `run` imports what it needs, so that the help loads no numerical library.
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
    parser = Parser(prog="modalscope", description="Modal identification: from measured data to modes of a structure.")
    parser.add_argument("--version", action="version", version=__version__, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    for name, command in zip(names(), COMMANDS, strict=True):
        text = (command.__doc__ or name).strip()
        title = text.partition("\n")[0].rstrip(".")
        added = commands.add_parser(name, help=title[0].lower() + title[1:], description=text)
        added.set_defaults(run=command.run)
        command.add(added)
        add_common(added)
    *most, last = names()
    needed = f"a command is needed: {', '.join(most)} or {last} (see --help)"
    parser.set_defaults(parser=parser, run=lambda _: parser.error(needed))
    return parser
