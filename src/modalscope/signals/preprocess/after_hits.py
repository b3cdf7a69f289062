"""Take what follows the hits of a hammer as free decays, and tell how much of them is cut off.

With no force left, outputs are sums of damped exponentials whatever came before, however early the next hit or the end cuts them off.
Averages of such hits leak by what `remaining` tells; the poles of the decays have no bias from it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.data.shown import counted
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError
from modalscope.signals.preprocess.bands import struck_band
from modalscope.signals.preprocess.conditioning import slower_correlation
from modalscope.signals.preprocess.decays import of_decays
from modalscope.signals.preprocess.excitation import excitation_of
from modalscope.signals.preprocess.impacts import between_hits, find_hits, room_of
from modalscope.signals.preprocess.plans import plan_hits, without_offset

#: Vibration at the end of a run or hit, as a part of the largest, that an untapered transform turns into leakage, and the part of the
#: outputs that may have less where hits are cut off. Averages of such hits found 77 to 81 % of the modes of 73 random structures, decays
#: 98 to 99 % (docs/validation/inputs).
MAX_REMAINING, _MAX_SETTLED = 0.05, 0.25

#: A force below this part of the largest has ended.
_MIN_FORCE = 0.01

#: Samples for which filters of the recorder still ring, before and after a pulse; at most this part of a decay is given to them.
_RINGING, _MAX_RINGING = 20, 1 / 20


def remaining(signals: Signals, kind: str) -> tuple[RealArray, int]:
    """Return which part of its largest vibration every output has at the end of what is averaged, and the samples of that: hits or runs.

    Zero where it falls no more: a decay that has ended in noise stays at one level, one that goes on falls from block to block.
    """
    y = without_offset(signals, "impact")[0]
    if kind == "impact" and len(signals.input_dofs) == 1:
        with suppress(DataError):  # no usable hit: an error where responses are asked for
            y = plan_hits(signals, None, "good", 0, None).outputs
    samples = y.shape[1]
    length = max(2, samples // 20)
    blocks = y[:, : samples // length * length].reshape(y.shape[0], -1, length, y.shape[2])
    rms = np.sqrt(np.mean(blocks**2, axis=2)).max(axis=0)  # (blocks, l), the worst run
    part = rms[-1] / np.maximum(rms.max(axis=0), np.finfo(float).tiny)
    return np.where(rms[-1] < 0.9 * rms[len(rms) // 2], part, 0.0), samples


def cut_off(signals: Signals) -> bool:
    """Return whether hits are cut off at three of four outputs; slow drift looks as if some went on, and noise as if they had settled."""
    return bool(np.quantile(remaining(signals, "impact")[0], _MAX_SETTLED) > MAX_REMAINING)


def decays_after_hits(
    records: Records, band: tuple[float, float] | None
) -> tuple[ImpulseResponse, tuple[float, float] | None, tuple[Note, ...]]:
    """Return the free decays after hits, a column each, their band (Hz; by default what the hits excite), and notes.

    All have one length n: of k hits with n samples or more each, those of the largest k n are taken.

    Raises DataError for records that are no hits at one place, and where the force never ends.
    """
    stacked = records.stacked()
    if len(records.input_dofs) != 1 or excitation_of(records.runs) != "impact":
        have = f"the test is of kind {records.kind_of_test!r}, with inputs {', '.join(records.input_dofs)}"
        raise DataError("route='decays' needs one force, of a hammer:", have, 'Leave it out, or take route="records".')
    decays = [decay for part in stacked for decay in _decays(part)]
    samples = max(map(len, decays), key=lambda n: n * sum(len(decay) >= n for decay in decays), default=0)
    if samples < 2:
        raise DataError("free decays after hits:", "the force never ends", 'Take route="records".')
    taken = [decay[:samples] for decay in decays if len(decay) >= samples]
    response = of_decays(stacked[0], taken, "hit", records.sampling_rate).processed("cut to the free decays after hits")
    chosen, *notes = struck_band(stacked, band) or (band,)
    text = f"Taken as {counted(len(taken), 'free decay')} after hits, {samples} samples each, without scale. To average hits: --route frf"
    notes.append(Note("free decay", {"hits": len(taken)}, text))
    return response if chosen is None else slower_correlation(response, chosen[1]), chosen, tuple(notes)


def _decays(part: Signals) -> Iterator[RealArray]:
    """Yield the outputs (n, l) of every usable hit where the force has ended, without what filters still ring."""
    outputs, inputs = without_offset(part, "impact")
    hits = find_hits(inputs[:, :, 0])
    quiet, room = between_hits(inputs[:, :, 0], hits, _MIN_FORCE), room_of(hits, part.samples, 0)
    for hit in hits:
        end = hit.start + room[hit.number]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], quiet[hit.run, hit.start : end], [False]])))
        if hit.unfit or not edges.size:
            continue
        first, last = max(zip(edges[::2], edges[1::2], strict=True), key=lambda stretch: stretch[1] - stretch[0])
        rings = min(_RINGING, int(_MAX_RINGING * (last - first)))
        # before the next hit they ring as well
        yield outputs[hit.run, hit.start + first + rings : hit.start + last - rings * (end < part.samples)]
