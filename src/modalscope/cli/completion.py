"""modalscope completion: commands, options and files completed by the shell."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands
from modalscope.cli.process import say

SHELLS = ("bash", "zsh", "fish", "tcsh")


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "completion",
        help="print what makes a shell complete commands, options and files",
        description="Print what makes a shell complete commands, options and files. For bash: "
        "modalscope completion bash > ~/.local/share/bash-completion/completions/modalscope",
    )
    parser.add_argument("shell", choices=SHELLS, help=f"{', '.join(SHELLS[:-1])} or {SHELLS[-1]}")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the completion of all commands for one shell."""
    from modalscope.numerics.extras import optional_package

    shtab = optional_package("shell completion", "shtab", "completion")
    say(shtab.complete(options.parser, shell=options.shell))
