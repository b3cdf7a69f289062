"""Sum lagged products y(t + k) y_ref(t)' over chunks of a record, by short transforms; those of stored records by an executor."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from scipy import fft

from modalscope.data.sizes import check_size
from modalscope.data.stored import StoredSignals
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.executors import each, executor
from modalscope.numerics.resources import allowed_memory, check_fits, fetched, namespace, one_thread
from modalscope.numerics.sums import SavedSums

#: Samples of a block over the lags, so that little of a transform is padding, and their minimum; a transform stays in the cache.
_BLOCK_OVER_LAGS, _MIN_BLOCK = 4, 1024

#: Maximum number of complex numbers: in the cross spectra that are summed, and in the transforms of the blocks of one matrix product.
_MAX_CROSS_SPECTRA, _MAX_TRANSFORMS = 8_000_000, 2_000_000

#: Blocks that make a matrix product efficient, and numbers up to which more of them are taken.
_EFFICIENT_BLOCKS, _FEW_NUMBERS = 12, 300_000

#: Cross spectra that are summed at a time: they stay in the cache.
_CACHED_CROSS_SPECTRA = 15_000

#: Samples times channels that a task reads in turn, and in memory at a time: a task takes some seconds.
_TASK_NUMBERS, _NUMBERS_IN_MEMORY = 64_000_000, 8_000_000

#: Copies of a piece of the record, and of its sums, in memory at a time: as read, with a column of ones, and transformed.
_COPIES = 6


class LagSum:
    """Sum over t of y(t + k) y_ref(t)', k = 0 ... lags, of the products that were added, chunk by chunk.

    Every block is padded with zeros, so that no product wraps around. The cross spectra of the blocks are summed and transformed back
    once, at the end where those of all references take little memory.

    `channels`: l. `references`: channels at t. `mean` (l,): subtracted from every sample as it is read; zero until it is set.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((50, 2))
    >>> total = LagSum(2, [0], lags=3)
    >>> total.add(y[:33], times=30)  # products of the first thirty times reach three samples on
    >>> total.add(y[30:])
    >>> bool(np.allclose(total.finish()[2], y[2:].T @ y[:-2, :1]))
    True
    """

    def __init__(self, channels: int, references: Sequence[int], lags: int) -> None:
        self.channels, self.references, self.lags = channels, tuple(references), lags
        self.mean: RealArray = np.zeros(channels)
        self._length = int(fft.next_fast_len(max(_BLOCK_OVER_LAGS * lags, _MIN_BLOCK) + lags, real=True))
        self._block = self._length - lags
        self._sums: RealArray = np.zeros((lags + 1, channels, len(self.references)))
        self._cross: ComplexArray | None = None  # of all references, where it is small: transformed back at the end

    def add(self, chunk: RealArray, times: int | None = None) -> None:
        """Add the products of the first `times` rows of a chunk (rows, l), by default all, with the rows up to `lags` later."""
        used = len(chunk) if times is None else times
        count, lines = len(self.references), self._length // 2 + 1
        step = max(_MAX_CROSS_SPECTRA // (lines * self.channels), 1)  # references at a time
        if step >= count:
            if self._cross is None:
                self._cross = np.zeros((lines, self.channels, count), dtype=complex)
            self._sum_spectra(self._cross, chunk, used, list(self.references))
            return
        for first in range(0, count, step):
            columns = list(self.references[first : first + step])
            cross = np.zeros((lines, self.channels, len(columns)), dtype=complex)
            self._sum_spectra(cross, chunk, used, columns)
            self._sums[:, :, first : first + len(columns)] += self._back(cross)

    def _back(self, cross: ComplexArray) -> RealArray:
        """Return the sums of products of cross spectra."""
        return np.asarray(fft.irfft(cross, n=self._length, axis=0)[: self.lags + 1])

    def _sum_spectra(self, total: ComplexArray, chunk: RealArray, times: int, columns: list[int]) -> None:
        """Add the cross spectra of all blocks, (length / 2 + 1, l, r), to `total`."""
        for later, now in self._blocks(chunk, times, columns):
            if executor().device is not None:
                total += _cross_spectra(executor().place(later), executor().place(now))
                continue
            ahead, behind = fft.rfft(later, axis=1), fft.rfft(now, axis=1)
            np.conjugate(behind, out=behind)
            y, y_now = ahead.transpose(1, 2, 0), behind.swapaxes(0, 1)
            step = max(_CACHED_CROSS_SPECTRA // total[0].size, 1)
            for k in range(0, len(total), step):
                total[k : k + step] += y[k : k + step] @ y_now[k : k + step]

    def _blocks(self, chunk: RealArray, times: int, columns: list[int]) -> Iterator[tuple[RealArray, RealArray]]:
        """Yield blocks with the samples after them, (blocks, length, l), and the references of the blocks alone, padded with zeros."""
        starts = range(0, times, self._block)
        size = self._length * self.channels
        step = max(_FEW_NUMBERS // size, min(_MAX_TRANSFORMS // size, _EFFICIENT_BLOCKS), 1)
        later = np.zeros((min(step, len(starts)), self._length, self.channels))
        now = np.zeros((len(later), self._length, len(columns)))
        for k in range(0, len(starts), step):
            group = starts[k : k + step]
            for i, start in enumerate(group):
                rows, count = chunk[start : start + self._length], min(self._block, times - start)
                np.subtract(rows, self.mean, out=later[i, : len(rows)])
                np.take(later[i, :count], columns, axis=1, out=now[i, :count], mode="clip")  # without a copy
                later[i, len(rows) :], now[i, count:] = 0, 0
            yield later[: len(group)], now[: len(group)]

    def finish(self) -> RealArray:
        """Return the sums, (lags + 1, l, r), lag 0 first."""
        if self._cross is not None:
            self._sums += self._back(self._cross)
            self._cross = None
        return self._sums


def _cross_spectra(later: Any, now: Any) -> ComplexArray:
    """Return the cross spectra of blocks on a device, all lines in one product."""
    xp = namespace(later)
    ahead, behind = xp.fft.rfft(later, axis=1), xp.fft.rfft(now, axis=1)
    return fetched(xp.permute_dims(ahead, (1, 2, 0)) @ xp.conj(xp.permute_dims(behind, (1, 0, 2))))


class Stretch(NamedTuple):
    """One task, by its number: the times from `start` to before `stop`, of one block."""

    number: int
    block: int
    start: int
    stop: int


#: The latest sums of each record, for the next estimate with the same arguments.
_latest: WeakKeyDictionary[StoredSignals, tuple[tuple[object, ...], RealArray]] = WeakKeyDictionary()


def lag_sums(record: StoredSignals, references: tuple[int, ...], lags: int, edges: tuple[int, ...]) -> RealArray:
    """Return the sums (blocks, lags + 1, l, r) of y(t + k) y_ref(t)' over the times t of each block, without the mean of the record.

    The record is read once. With z = y - c, c the mean of its beginning, sums of [z, 1] also give those of z(t + k) and of z_ref(t), by
    which the true mean m = c + d is subtracted afterwards:
    sum (z(t+k) - d) (z_ref(t) - d)' = sum z z' - sum z(t+k) d' - d sum z_ref' + pairs d d'.
    `edges` are the first times of the blocks, and the end of the last one. Raises DataError for sums that do not fit in memory and for
    samples that are no numbers.
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
    opening = record.part(0, min(record.samples, max(_NUMBERS_IN_MEMORY // channels, 2)))
    check_size(opening)
    offset = opening.outputs.mean(axis=0)
    # few samples at a time against the allowed memory, and many against the lags
    most = min(_NUMBERS_IN_MEMORY, allowed_memory() // (8 * _COPIES * 4))
    chunk = max(int(most) // channels, 2 * lags, 2)
    work = partial(_sum_over, record, references, lags, offset, chunk)
    tasks = stretches(edges, channels)
    folder = executor().folder
    content = "" if folder is None else record.fingerprint
    saved = SavedSums(folder, f"{record.rows.identity} {content} {key}", shape, len(tasks))
    sums = _centred(_all_sums(work, tasks, saved), record.samples)
    _latest[record] = (key, sums)
    return sums


def stretches(edges: tuple[int, ...], channels: int) -> list[Stretch]:
    """Cut blocks into tasks: one for each, or several where it is long.

    Examples
    --------
    >>> [tuple(task) for task in stretches((0, 10, 20), 8)]
    [(0, 0, 0, 10), (1, 1, 10, 20)]
    """
    tasks: list[Stretch] = []
    for block, (start, stop) in enumerate(itertools.pairwise(edges)):
        pieces = max(-(-(stop - start) * channels // _TASK_NUMBERS), 1)
        cuts = np.linspace(start, stop, pieces + 1).round().astype(int)
        tasks += [Stretch(len(tasks) + k, block, int(a), int(b)) for k, (a, b) in enumerate(itertools.pairwise(cuts))]
    return tasks


@one_thread
def _sum_over(
    record: StoredSignals, references: tuple[int, ...], lags: int, offset: RealArray, chunk: int, task: Stretch
) -> RealArray:
    """Return the sums of one task, (lags + 1, l + 1, r + 1); the last channel, and the last reference, is 1."""
    channels = len(offset)
    total = LagSum(channels + 1, (*references, channels), lags)
    extended = np.ones((min(chunk, task.stop - task.start) + lags, channels + 1))
    for start in range(task.start, task.stop, chunk):
        stop = min(start + chunk, task.stop)
        rows = record.chunk(start, stop + lags)
        np.subtract(rows, offset, out=extended[: len(rows), :channels])
        total.add(extended[: len(rows)], stop - start)
    return total.finish()


def _all_sums(work: partial[RealArray], tasks: list[Stretch], saved: SavedSums) -> RealArray:
    """Return the sums of all blocks, saved ones and those of the remaining tasks."""
    progress = executor().progress
    with saved:
        try:
            for task, sums in each(work, [task for task in tasks if not saved.done[task.number]]):
                saved.add(task.number, task.block, sums)
                if progress is not None:
                    progress(int(saved.done.sum()), len(tasks))
        finally:
            saved.keep()
        saved.forget()
    return saved.sums


def _centred(sums: RealArray, samples: int) -> RealArray:
    """Subtract the mean from sums whose last channel and reference is 1."""
    products, later = sums[:, :, :-1, :-1], sums[:, :, :-1, -1]
    now, pairs = sums[:, :, -1, :-1], np.round(sums[:, :, -1, -1])
    d, d_ref = (side[:, 0].sum(axis=0) / samples for side in (later, now))
    for block in range(len(sums)):  # in place: these are the largest arrays
        products[block] -= later[block][:, :, None] * d_ref
        products[block] -= d[:, None] * now[block][:, None, :]
        products[block] += pairs[block][:, None, None] * np.outer(d, d_ref)
    return products
