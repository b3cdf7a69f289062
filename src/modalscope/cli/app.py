"""modalscope app: the page, in a browser of this machine."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from modalscope.cli.parser import Commands
from modalscope.cli.process import say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "app",
        help="open the page: a file in, poles and modes to look at and choose from",
        description="Serve the page on this machine and open it in the browser. Files are read from the folder that is given, and from "
        "what is dropped on the page; documents stay from one start to the next.",
    )
    parser.add_argument(
        "files", nargs="*", type=Path, metavar="FILE", help="data, or an .analysis.json, to open at once"
    )
    parser.add_argument("--folder", type=Path, metavar="DIR", help="the folder whose files the page may open")
    parser.add_argument("--port", type=int, default=0, metavar="N", help="port (any that is free)")
    parser.add_argument("--host", default="127.0.0.1", metavar="NAME", help="address to listen on (this machine alone)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, open no browser")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Serve the page until it is interrupted."""
    from modalscope.numerics.extras import optional_package

    for package in ("starlette", "uvicorn"):
        optional_package("the page", package, "app")
    from modalscope.app.serve import built, page, serve

    built()
    folder = _folder(options)
    first = [path.resolve().relative_to(folder.resolve()).as_posix() for path in options.files]
    made = page(first, folder=folder, host=options.host, port=options.port)
    say(f"the page: {made.address}")
    sys.stdout.flush()  # whoever reads it through a pipe wants it now
    if options.host != "127.0.0.1":
        say("others can reach it, too, unencrypted: who has the address has your files")
    if not options.no_browser:
        import webbrowser

        webbrowser.open(made.address)
    serve(made)


def _folder(options: argparse.Namespace) -> Path:
    """Return the folder that files are read from: the one given, that of the files, or the one we are in."""
    from modalscope.data import DataError

    folder: Path = options.folder or (options.files[0].parent if options.files else Path())
    if not folder.is_dir():
        raise DataError(f"the folder {str(folder)!r} was asked", "there is none", "Name one that is there.")
    for path in options.files:
        if not path.is_file():
            raise DataError(f"{str(path)!r} was asked", "there is no such file", "Check its name.")
        if not path.resolve().is_relative_to(folder.resolve()):
            raise DataError(
                f"{str(path)!r} was asked", f"it is not in {str(folder)!r}", "Name its folder with --folder."
            )
    return folder
