"""Progress on stderr, for a person who waits."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from modalscope.cli.process import VOICE

__all__ = ["progress"]


@contextmanager
def progress(what: str, unit: str = "order") -> Iterator[Callable[[int, int], None]]:
    """Show a bar while the block runs: `show(done, total)`; nothing when stderr is not a terminal a person looks at."""
    from tqdm import tqdm

    with tqdm(desc=what, unit=unit, file=sys.stderr, leave=False, disable=VOICE.quiet or None) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show
