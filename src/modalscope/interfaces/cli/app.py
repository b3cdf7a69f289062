"""The command `app`: the page in a browser."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from modalscope.interfaces.cli.parser import Parser
from modalscope.interfaces.cli.process import remark, say

if TYPE_CHECKING:
    from modalscope.interfaces.app.serve import Page


def add_app(parser: Parser) -> None:
    """Add the arguments of `app`."""
    parser.add("files FILE...", "data, an .analysis.json, or a store of months (.modes)", nargs="*")
    parser.add("--folder DIR", "folder whose files the page may open")
    parser.add("--port N", "port (default: any free port)", default=0)
    parser.add("--host NAME", "address to listen on (default: this machine)", default="127.0.0.1")
    dropped = "bytes that files dropped on the page may take together, such as 20GB (default: 10GB)"
    parser.add("--max-dropped SIZE", dropped)
    parser.add("--forget", "delete all documents and dropped files, and start no page")
    parser.add("--no-browser", "print the address, open no browser")


def app(options: argparse.Namespace) -> None:
    """Open the page in the browser: a file in, poles and modes to inspect and select.

    The page is served on this machine. It reads files of one folder and files dropped on it; documents are kept between sessions. Dropped
    files are deleted with their document, or 30 days after its last change. A store of months of records (.modes) is shown as its report.
    """
    from modalscope.numerics.errors import optional_package

    for package in ("starlette", "uvicorn"):
        optional_package("the page", package, "app")
    if len(options.files) == 1 and options.files[0].suffix.lower() == ".modes":
        _months(options)
        return
    from modalscope.interfaces.app.documents import DocumentStore
    from modalscope.interfaces.app.files import FileStore
    from modalscope.interfaces.app.guard import Limits
    from modalscope.interfaces.app.serve import check_front_end, page, state_folder

    if options.forget:
        say(DocumentStore(FileStore(None, state_folder()), Limits()).forget())
        return
    check_front_end()
    folder = _folder(options)
    limits = Limits() if options.max_dropped is None else Limits(uploads=options.max_dropped)
    first = [path.resolve().relative_to(folder.resolve()).as_posix() for path in options.files]
    server = page(first, folder=folder, host=options.host, port=options.port, limits=limits)
    say(f"the page: {server.address}")
    if server.store is not None and server.store.files.total:
        from modalscope.data.shown import figures

        kept = f"{limits.days:g} days after the last change of their document"
        size = f"{figures(server.store.files.total / 1e6)} MB"
        remark(f"files dropped earlier take {size}; they are kept {kept}, or until `modalscope app --forget`")
    _serve(options, server)


def _serve(options: argparse.Namespace, server: Page) -> None:
    """Open a page in the browser, until it is interrupted."""
    from modalscope.interfaces.app.serve import serve

    sys.stdout.flush()  # for a reader that waits at a pipe
    if options.host != "127.0.0.1":
        say("WARNING: other machines can reach the page, unencrypted: whoever has the address can read these files")
    if not options.no_browser:
        import webbrowser

        webbrowser.open(server.address_once())
    serve(server)


def _months(options: argparse.Namespace) -> None:
    """Show the report of a store of months of records in the browser, until it is interrupted."""
    from modalscope.data import DataError
    from modalscope.interfaces.app.months import MonthsReport
    from modalscope.interfaces.app.serve import alone

    path = options.files[0]
    if not path.is_file():
        raise DataError(f"the store {str(path)!r}:", "there is no such file", "Make it: modalscope watch.")
    server = alone(MonthsReport(path), host=options.host, port=options.port)
    say(f"the page: {server.address}")
    _serve(options, server)


def _folder(options: argparse.Namespace) -> Path:
    """Return the folder of the files: the one given, that of the first file, or the current one."""
    from modalscope.data import DataError

    folder: Path = options.folder or (options.files[0].parent if options.files else Path())
    if not folder.is_dir():
        raise DataError(f"the folder {str(folder)!r}:", "it does not exist", "Check its name.")
    for path in options.files:
        asked = f"{str(path)!r}:"
        if not path.is_file():
            raise DataError(asked, "there is no such file", "Check its name.")
        if not path.resolve().is_relative_to(folder.resolve()):
            raise DataError(asked, f"it is not in {str(folder)!r}", "Give its folder with --folder.")
    return folder
