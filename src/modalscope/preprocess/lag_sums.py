"""Sums of products y(t + k) y_ref(t)' over chunks of a record, by short transforms: additive over chunks, and over who gathers them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy import fft

from modalscope.model.checks import ComplexArray, RealArray
from modalscope.model.crew import crew
from modalscope.model.device import fetched, namespace

__all__ = ["LagSum"]

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
            if crew().device is not None:
                total += self._at_once(crew().place(later), crew().place(now))
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
