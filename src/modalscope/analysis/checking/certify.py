"""Certify the confidence intervals of a result by simulation: their bias, width and coverage on replicates of the data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.analysis.checking.certificate import Certificate, certified, replicates_of
from modalscope.analysis.workflow.analyze import analyze
from modalscope.analysis.workflow.replay import replay
from modalscope.data.records import Signals
from modalscope.data.results import Result, StabilizationDiagram
from modalscope.identification.prepare import measure
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_count, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread
from modalscope.selection.judging.bands import SPLIT

Progress = Callable[[int, int], None]

#: Replicates: of 100 000 a coverage of 95 % is known to .0014 (1.96 sqrt(.95 .05 / 100 000)), and 88 % are asked.
MOST_REPLICATES = 100_000


@named()
@one_thread
def certify(
    result: Result | str | Path,
    *,
    replicates: int = 40,
    select: bool = False,
    data: Any = None,
    seed: int = 0,
    allow_outside: bool = False,
    progress: Progress | None = None,
) -> Certificate:
    """Test the confidence intervals of a result by simulation: count how often they contain the truth.

    A replicate is the response of the reported modes plus noise of the estimated variance. It is identified by the same method at the
    order nearest to the reported values, and refined where they were. An interval holds when the bias is below half a standard
    deviation, the standard deviation right within .8 to 1.25, and the truth inside in at least 88 % of the replicates. What fails is
    judged again on five times as many; where it still fails the standard deviation is replaced by that of the replicates. Replicates of an
    ambient record are correlations: its values before the refinement are certified.

    Parameters
    ----------
    result : Result or path
        Of `analyze`; a file of data is analysed first, an analysis (`.json`) is repeated.
    replicates : int
    select : bool
        Whether the diagram and the selection are repeated, too: `found` then counts how often each mode is reported.
    data : path or data object, optional
        Of a result that was read from a file, instead of the file that its analysis names.
    seed : int
        The same seed gives the same certificate.
    allow_outside : bool
        Whether a geometry is read wherever the analysis says that it lies, as by `replay`.
    progress : callable, optional
        Called with (replicates done, replicates in all).

    Returns
    -------
    Certificate
        With `holds`, `bias`, `ratio`, `coverage`, `found`, `modes` and `notes`.

    Raises
    ------
    DataError
        A result without modes or of several bands, data whose noise is not known, a method that works on records themselves.

    Examples
    --------
    >>> from modalscope import analyze
    >>> from modalscope.systems import chain5
    >>> result = analyze(chain5().impulse_response(300, noise=0.01, seed=0), orders=[10, 12])
    >>> bool(certify(result, replicates=3).found.min() >= 3)
    True
    """
    count = check_count("replicates", replicates, least=2, most=MOST_REPLICATES)
    start = check_count("seed", seed, least=0)
    if isinstance(result, str | Path):
        stored = Path(result).suffix.lower() == ".json"
        result = replay(result, data, allow_outside=allow_outside) if stored else analyze(result)
    check_kind("certify", result, Result)
    if not result.diagrams:
        result = replay(result.analysis, data, allow_outside=allow_outside)
    parts = [int(note.numbers["parts"]) for note in result.diagram.notes if note.kind == SPLIT]
    if len(result.diagrams) > 1 or parts:
        asked = f"a certificate of {(*parts, len(result.diagrams))[0]} bands:"
        raise DataError(asked, "replicates need one band", "Analyse the bands one by one: analyze(data, band=...).")
    diagram = result.diagram
    made = replicates_of(diagram, result.modes, _records(result, diagram), whole=select)
    return certified(made, count, np.random.default_rng(start), progress)


def _records(result: Result, diagram: StabilizationDiagram) -> Signals | None:
    """Return the records of correlations, filtered to the band; None for responses."""
    if not diagram.response.ambient or result.data is None:
        return None
    settings = diagram.settings
    records = measure(result.data, settings.band, settings.exclude).records
    return None if records is None else records.load()
