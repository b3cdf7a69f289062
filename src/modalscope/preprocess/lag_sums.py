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
_ENOUGH, _SMALL = 24, 300_000


class LagSum:
    """Sum over t of y(t + k) y_ref(t)', k = 0 ... lags, of the products that were added.

    Every block is padded with zeros, so that no product wraps around; the blocks' cross spectra are summed, and one inverse transform
    serves all of them.

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
        self._block = max(_TIMES_LAGS * lags, _LEAST)
        self._length = int(fft.next_fast_len(self._block + lags, real=True))
        self._block = self._length - lags
        self._sums: RealArray = np.zeros((lags + 1, channels, len(self.references)))

    def add(self, chunk: RealArray, times: int | None = None) -> None:
        """Take in the products of the first `times` rows with the rows up to `lags` later.

        Parameters
        ----------
        chunk : array, (rows, l)
        times : int, optional
            All rows by default: then the last have no products beyond the end.
        """
        used = len(chunk) if times is None else times
        each = max(_GATHERED // ((self._length // 2 + 1) * self.channels), 1)
        for first in range(0, len(self.references), each):
            columns = list(self.references[first : first + each])
            cross = self._cross(chunk, used, columns)
            back = fft.irfft(cross, n=self._length, axis=0)[: self.lags + 1]
            self._sums[:, :, first : first + len(columns)] += back

    def _cross(self, chunk: RealArray, times: int, columns: list[int]) -> ComplexArray:
        """Return the cross spectra of all blocks together, (length / 2 + 1, l, r)."""
        total = np.zeros((self._length // 2 + 1, self.channels, len(columns)), dtype=complex)
        for later, now in self._blocks(chunk, times, columns):
            if crew().device is not None:
                total += self._at_once(crew().place(later), crew().place(now))
                continue
            ahead, behind = fft.rfft(later, axis=1), fft.rfft(now, n=self._length, axis=1)
            for cross, y, y_now in zip(total, ahead.swapaxes(0, 1), behind.conj().swapaxes(0, 1), strict=True):
                cross += y.T @ y_now  # line by line: what is summed stays in the cache
        return total

    def _at_once(self, later: Any, now: Any) -> ComplexArray:
        """Return the cross spectra of some blocks, all lines in one product."""
        xp = namespace(later)
        ahead, behind = xp.fft.rfft(later, axis=1), xp.fft.rfft(now, n=self._length, axis=1)
        return fetched(xp.permute_dims(ahead, (1, 2, 0)) @ xp.conj(xp.permute_dims(behind, (1, 0, 2))))

    def _blocks(self, chunk: RealArray, times: int, columns: list[int]) -> Iterator[tuple[RealArray, RealArray]]:
        """Yield some blocks with what follows them, (blocks, length, l), and the references of these times alone."""
        starts = range(0, times, self._block)
        size = self._length * self.channels
        together = max(_SMALL // size, min(_TOGETHER // size, _ENOUGH), 1)
        for k in range(0, len(starts), together):
            some = starts[k : k + together]
            later = np.zeros((len(some), self._length, self.channels))
            now = np.zeros((len(some), self._block, len(columns)))
            for i, start in enumerate(some):
                rows = chunk[start : start + self._length]
                later[i, : len(rows)] = rows - self.mean
                own = min(self._block, times - start)
                now[i, :own] = later[i, :own, columns].T
            yield later, now

    def merge(self, other: LagSum) -> None:
        """Take in what another has gathered."""
        self._sums += other._sums

    def finish(self) -> RealArray:
        """Return the sums, (lags + 1, l, r), lag 0 first."""
        return self._sums
