"""Records whose outputs come late after the forces, shifted back: each sample asks for states, and false modes stand for these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from modalscope.model.checks import DataError
from modalscope.model.notes import Note
from modalscope.model.records import Records
from modalscope.model.signals import Signals
from modalscope.preprocess.causality_checks import exchanged
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.late_checks import lateness

__all__ = ["DELAYS", "aligned", "seen_delays"]

#: The kind of the note.
DELAYS = "delays taken out"


def seen_delays(records: Records) -> dict[str, int]:
    """Return the samples by which outputs come late after random forces, where all runs say the same; empty where none do.

    Parameters
    ----------
    records : Records
        With inputs.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> run = chain5().simulate(inputs="white", samples=4000, sampling_rate=12.0, quantity="acceleration", seed=0)
    >>> late = Signals(outputs=run.outputs[:-20], inputs=run.inputs[20:], sampling_rate=12.0)
    >>> set(seen_delays(Records(runs=(late,))).values())
    {20}
    """
    found: dict[str, int] | None = None
    for part in records.stacked():
        own = lateness(part).samples
        if not own or found not in (None, own) or find_excitation(part) not in ("random", "burst") or exchanged(part):
            return {}
        found = own
    return found or {}


def aligned(records: Records, delays: Mapping[str, int]) -> tuple[Records, tuple[Note, ...]]:
    """Return records with outputs shifted back against the forces, and what is said of it; nothing late is returned as it is.

    Parameters
    ----------
    records : Records
        With inputs.
    delays : mapping of label to int
        Samples that outputs come late, whole and not negative; all others are in time.

    Raises
    ------
    DataError
        An output that is not there, or a run that is no longer than its delay.
    """
    longest, shortest = max(delays.values(), default=0), min(records.samples)
    unknown = [dof for dof in delays if dof not in records.output_dofs]
    if unknown or longest > shortest - 2:
        raise DataError(
            f"delays of {dict(delays)} were asked",
            f"the outputs are {', '.join(records.output_dofs)}, the shortest run has {shortest} samples",
            "Name outputs that are there, and samples that a run has.",
        )
    if not longest:
        return records, ()
    lags = [delays.get(dof, 0) for dof in records.output_dofs]
    moved = replace(records, runs=tuple(_shifted(run, lags, longest) for run in records.runs), groups=records.groups)
    alike = len(set(lags)) == 1
    what = "all outputs" if alike else ", ".join(f"{dof} {own}" for dof, own in delays.items() if own)
    of = f"come {longest} samples" if alike else "samples come"
    text = (
        f"{what} {of} late after the forces, which was taken out, and moves neither poles nor shapes; "
        "delays={} (--delays none) leaves it in"
    )
    return moved, (Note(DELAYS, {"samples": float(longest)}, text),)


def _shifted(run: Signals, lags: list[int], longest: int) -> Signals:
    """Return a run with every output shifted back by its lag, as long as all allow."""
    assert run.inputs is not None
    count = run.samples - longest
    outputs = np.column_stack([own[lag : lag + count] for own, lag in zip(run.outputs.T, lags, strict=True)])
    return replace(run, outputs=outputs, inputs=run.inputs[:count])
