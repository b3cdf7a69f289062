"""Correlations of records that stay in their file: sums over stretches, by whoever is there, kept as they grow."""

from __future__ import annotations

import itertools
from functools import partial
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from modalscope.blocks.threads import one_thread
from modalscope.model.checks import RealArray
from modalscope.model.crew import crew, each
from modalscope.model.memory import allowed_memory, check_fits
from modalscope.model.sizes import check_size
from modalscope.model.stored import StoredSignals
from modalscope.preprocess.lag_sums import LagSum
from modalscope.preprocess.saved_sums import SavedSums

__all__ = ["Gathered", "gathered", "stretches"]

#: Samples times channels that a task reads one after the other, and that it holds at a time: a task is work of some seconds.
_TASK, _HELD = 64_000_000, 8_000_000

#: What is held of a piece of the record, and of its sums, beside each other: as read, with ones beside it, and transformed.
_COPIES = 6


class Stretch(NamedTuple):
    """One task: the times from `start` to before `stop`, which belong to one block.

    Attributes
    ----------
    number, block : int
        Of the task, and of the block that its sum belongs to.
    start, stop : int
    """

    number: int
    block: int
    start: int
    stop: int


class Gathered(NamedTuple):
    """Sums over the blocks of a record without its mean.

    Attributes
    ----------
    sums : array, (blocks, lags + 1, l, r)
    pairs : array, (blocks, lags + 1)
    """

    sums: RealArray
    pairs: RealArray


#: The sums that were made last of each record: what follows an estimate asks for them again.
_latest: WeakKeyDictionary[StoredSignals, tuple[tuple[object, ...], Gathered]] = WeakKeyDictionary()


def gathered(record: StoredSignals, references: tuple[int, ...], lags: int, edges: tuple[int, ...]) -> Gathered:
    """Return the sums of y(t + k) y_ref(t)' over the times t of each block, the mean of the whole record taken off.

    The record is read once: sums are made of z = y - c, c the mean of its beginning, and of z beside a column of ones, which gives the
    sums of z(t + k) and of z_ref(t), with which the true mean m = c + d is taken off afterwards:
    sum (z(t+k) - d) (z_ref(t) - d)' = sum z z' - sum z(t+k) d' - d sum z_ref' + pairs d d'.

    Parameters
    ----------
    record : StoredSignals
    references : tuple of int
    lags : int
    edges : tuple of int
        Where the blocks begin, and the end of the last one.

    Raises
    ------
    DataError
        Sums that do not fit in memory; samples that are no numbers.
    """
    key = (references, lags, edges)
    if record in _latest and _latest[record][0] == key:
        return _latest[record][1]
    channels, blocks = len(record.output_dofs), len(edges) - 1
    shape = (blocks, lags + 1, channels + 1, len(references) + 1)
    check_fits(
        f"correlations of {channels} channels with {len(references)} references over {lags} lags in {blocks} blocks",
        8.0 * np.prod(shape) * (1 + 2 / blocks) + 8.0 * _COPIES * channels * (lags + 1),
        "Lower lags, or give fewer references.",
    )
    opening = record.part(0, min(record.samples, max(_HELD // channels, 2)))
    check_size(opening)
    offset = opening.outputs.mean(axis=0)
    work = partial(_sum_over, record, references, lags, offset, held_samples(channels, lags))
    saved = SavedSums(crew().folder, f"{record.rows.identity} {key}", shape, len(stretches(edges, channels)))
    found = _centred(_all_sums(work, stretches(edges, channels), saved), record.samples)
    _latest[record] = (key, found)
    return found


def stretches(edges: tuple[int, ...], channels: int) -> list[Stretch]:
    """Return the tasks: every block in one piece, or in several where it is long.

    Parameters
    ----------
    edges : tuple of int
    channels : int

    Examples
    --------
    >>> [tuple(task) for task in stretches((0, 10, 20), 8)]
    [(0, 0, 0, 10), (1, 1, 10, 20)]
    """
    tasks: list[Stretch] = []
    for block, (start, stop) in enumerate(itertools.pairwise(edges)):
        pieces = max(-(-(stop - start) * channels // _TASK), 1)
        cuts = np.linspace(start, stop, pieces + 1).round().astype(int)
        tasks += [Stretch(len(tasks) + k, block, int(a), int(b)) for k, (a, b) in enumerate(itertools.pairwise(cuts))]
    return tasks


def held_samples(channels: int, lags: int) -> int:
    """Return how many samples are read at a time: few beside the memory that may be taken, and many beside the lags.

    Parameters
    ----------
    channels, lags : int
    """
    most = min(_HELD, allowed_memory() // (8 * _COPIES * 4))
    return max(int(most) // channels, 2 * lags, 2)


@one_thread
def _sum_over(
    record: StoredSignals, references: tuple[int, ...], lags: int, offset: RealArray, held: int, task: Stretch
) -> RealArray:
    """Return the sums of one task, (lags + 1, l + 1, r + 1); the last channel, and the last reference, is 1."""
    channels = len(offset)
    total = LagSum(channels + 1, (*references, channels), lags)
    beside = np.ones((min(held, task.stop - task.start) + lags, channels + 1))
    for start in range(task.start, task.stop, held):
        stop = min(start + held, task.stop)
        rows = record.chunk(start, stop + lags)
        np.subtract(rows, offset, out=beside[: len(rows), :channels])
        total.add(beside[: len(rows)], stop - start)
    return total.finish()


def _all_sums(work: partial[RealArray], tasks: list[Stretch], saved: SavedSums) -> RealArray:
    """Return the sums of all blocks: of what was saved, and of the tasks that are left."""
    progress = crew().progress
    try:
        for task, sums in each(work, [task for task in tasks if not saved.done[task.number]]):
            saved.add(task.number, task.block, sums)
            if progress is not None:
                progress(int(saved.done.sum()), len(tasks))
    finally:
        saved.keep()
    saved.forget()
    return saved.sums


def _centred(sums: RealArray, samples: int) -> Gathered:
    """Take the mean off sums beside which the ones stand."""
    products, later = sums[:, :, :-1, :-1], sums[:, :, :-1, -1]
    now, pairs = sums[:, :, -1, :-1], np.round(sums[:, :, -1, -1])
    d = later[:, 0].sum(axis=0) / samples
    d_ref = now[:, 0].sum(axis=0) / samples
    for block in range(len(sums)):  # in place: of many lags these are the largest arrays there are
        products[block] -= later[block][:, :, None] * d_ref
        products[block] -= d[:, None] * now[block][:, None, :]
        products[block] += pairs[block][:, None, None] * np.outer(d, d_ref)
    return Gathered(products, pairs)
