"""The program's one logger, `modalscope`: what is told of a run are its records.

Notes and findings are records of level INFO, settings of DEBUG. Nothing is printed unless a program, or the command line, listens.
"""

from __future__ import annotations

import logging

LOG = logging.getLogger("modalscope")
LOG.addHandler(logging.NullHandler())


def tell(*texts: object) -> None:
    """Record what a run tells, one record a text."""
    for text in texts:
        LOG.info("%s", text)
