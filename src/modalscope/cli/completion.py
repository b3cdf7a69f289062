"""Print the script that lets a shell complete commands, options and files.

For bash: modalscope completion bash > ~/.local/share/bash-completion/completions/modalscope
"""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser
from modalscope.cli.process import say


def add(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("shell", choices=("bash", "zsh", "fish", "tcsh"), help="bash, zsh, fish or tcsh")


def run(options: argparse.Namespace) -> None:
    """Print the completion script of one shell."""
    from modalscope.numerics.extras import optional_package

    shtab = optional_package("shell completion", "shtab", "completion")
    say(shtab.complete(options.parser, shell=options.shell))
