"""Correlations of records that stay in their file: sums over stretches, by whoever is there, kept as they grow."""

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

__all__ = ["Gathered", "LagSum", "gathered", "stretches"]


# ------------------------------------------------------------------------------------------------------------ lag sums
# Sums of products y(t + k) y_ref(t)' over chunks of a record, by short transforms: additive over chunks, and over who gathers them.

#: Times of a block: so many times the lags that little of a transform is padding, and few enough that it stays in the cache.
_TIMES_LAGS, _LEAST = 4, 1024

#: Complex numbers in the cross spectra that are gathered, and in the transforms of the blocks taken together.
_GATHERED, _TOGETHER = 8_000_000, 2_000_000

#: So many blocks together make products of matrices worth their name; more of them only take memory, but small ones cost little of it.
_ENOUGH, _SMALL = 12, 300_000

#: Cross spectra that are summed at a time: they stay in the cache.
_IN_CACHE = 15_000


class LagSum:
    """Sum over t of y(t + k) y_ref(t)', k = 0 ... lags, of the products that were added.

    Every block is padded with zeros, so that no product wraps around; the blocks' cross spectra are summed, and one inverse transform
    serves all of them, at the end where the spectra of all references take little memory.

    Parameters
    ----------
    channels : int
        l.
    references : sequence of int
        Channels at t.
    lags : int
    mean : array, (l,), optional
        Taken off every sample as it is read; zero by default.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((50, 2))
    >>> total, other = LagSum(2, [0], lags=3), LagSum(2, [0], lags=3)
    >>> total.add(y[:33], times=30)  # products of the first thirty times reach three samples on
    >>> other.add(y[30:])
    >>> total.merge(other)
    >>> bool(np.allclose(total.finish()[2], y[2:].T @ y[:-2, :1]))
    True
    """

    def __init__(self, channels: int, references: Sequence[int], lags: int, mean: RealArray | None = None) -> None:
        self.channels, self.references, self.lags = channels, tuple(references), lags
        self.mean = np.zeros(channels) if mean is None else mean
        self._length = int(fft.next_fast_len(max(_TIMES_LAGS * lags, _LEAST) + lags, real=True))
        self._block = self._length - lags
        self._sums: RealArray = np.zeros((lags + 1, channels, len(self.references)))
        self._cross: ComplexArray | None = None  # of all references, where it is small: transformed back at the end

    def add(self, chunk: RealArray, times: int | None = None) -> None:
        """Take in the products of the first `times` rows with the rows up to `lags` later.

        Parameters
        ----------
        chunk : array, (rows, l)
        times : int, optional
            All rows by default: then the last have no products beyond the end.
        """
        used = len(chunk) if times is None else times
        count, lines = len(self.references), self._length // 2 + 1
        together = max(_GATHERED // (lines * self.channels), 1)
        if together >= count:
            if self._cross is None:
                self._cross = np.zeros((lines, self.channels, count), dtype=complex)
            self._gather(self._cross, chunk, used, list(self.references))
            return
        for first in range(0, count, together):
            columns = list(self.references[first : first + together])
            cross = np.zeros((lines, self.channels, len(columns)), dtype=complex)
            self._gather(cross, chunk, used, columns)
            self._sums[:, :, first : first + len(columns)] += self._back(cross)

    def _back(self, cross: ComplexArray) -> RealArray:
        """Return the sums that cross spectra stand for."""
        return np.asarray(fft.irfft(cross, n=self._length, axis=0)[: self.lags + 1])

    def _gather(self, total: ComplexArray, chunk: RealArray, times: int, columns: list[int]) -> None:
        """Add the cross spectra of all blocks, (length / 2 + 1, l, r), to what there is."""
        for later, now in self._blocks(chunk, times, columns):
            if executor().device is not None:
                total += self._at_once(executor().place(later), executor().place(now))
                continue
            ahead, behind = fft.rfft(later, axis=1), fft.rfft(now, axis=1)
            np.conjugate(behind, out=behind)
            y, y_now = ahead.transpose(1, 2, 0), behind.swapaxes(0, 1)
            step = max(_IN_CACHE // total[0].size, 1)
            for k in range(0, len(total), step):
                total[k : k + step] += y[k : k + step] @ y_now[k : k + step]

    def _at_once(self, later: Any, now: Any) -> ComplexArray:
        """Return the cross spectra of some blocks, all lines in one product."""
        xp = namespace(later)
        ahead, behind = xp.fft.rfft(later, axis=1), xp.fft.rfft(now, axis=1)
        return fetched(xp.permute_dims(ahead, (1, 2, 0)) @ xp.conj(xp.permute_dims(behind, (1, 0, 2))))

    def _blocks(self, chunk: RealArray, times: int, columns: list[int]) -> Iterator[tuple[RealArray, RealArray]]:
        """Yield some blocks with what follows them, (blocks, length, l), and the references of these times alone, zeros after them."""
        starts = range(0, times, self._block)
        size = self._length * self.channels
        together = max(_SMALL // size, min(_TOGETHER // size, _ENOUGH), 1)
        later = np.zeros((min(together, len(starts)), self._length, self.channels))
        now = np.zeros((len(later), self._length, len(columns)))
        for k in range(0, len(starts), together):
            some = starts[k : k + together]
            for i, start in enumerate(some):
                rows, own = chunk[start : start + self._length], min(self._block, times - start)
                np.subtract(rows, self.mean, out=later[i, : len(rows)])
                np.take(later[i, :own], columns, axis=1, out=now[i, :own], mode="clip")  # with no copy between
                later[i, len(rows) :], now[i, own:] = 0, 0
            yield later[: len(some)], now[: len(some)]

    def merge(self, other: LagSum) -> None:
        """Take in what another has gathered."""
        self._sums += other.finish()

    def finish(self) -> RealArray:
        """Return the sums, (lags + 1, l, r), lag 0 first."""
        if self._cross is not None:
            self._sums += self._back(self._cross)
            self._cross = None
        return self._sums


# -------------------------------------------------------------------------------------------------- stored correlation

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
    saved = SavedSums(executor().folder, f"{record.rows.identity} {key}", shape, len(stretches(edges, channels)))
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
    progress = executor().progress
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
