"""Filters and decimation of records that stay in their file: every stretch is filtered with what comes before it, as the whole would be."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from modalscope.model.checks import Array, RealArray
from modalscope.model.stored import Rows, StoredSignals

__all__ = ["FilteredRows", "apply_filter", "filtered", "settling"]

#: What is left of a filter's transient at the start of a stretch: below rounding, and below what its poles make of each other.
_LEFT = 1e-20


@dataclass(frozen=True)
class FilteredRows:
    """Rows behind a filter, one in q kept.

    Parameters
    ----------
    rows : Rows
        Before the filter.
    sections : tuple of tuple of float
        Of second order, as `scipy.signal` has them; none: nothing is filtered.
    factor : int
        q.
    zero_phase : bool
        Forwards and backwards.
    """

    rows: Rows
    sections: tuple[tuple[float, ...], ...]
    factor: int
    zero_phase: bool

    @property
    def shape(self) -> tuple[int, int]:
        """Samples that are kept, and channels."""
        samples, channels = self.rows.shape
        return -(-samples // self.factor), channels

    @property
    def identity(self) -> str:
        """The rows' own, and the filter."""
        return f"{self.rows.identity} filtered {self.sections} {self.factor} {self.zero_phase}"

    def read(self, start: int, stop: int) -> Array:
        """Return filtered rows: from so far before them that the start is forgotten, filtered backwards from so far behind them."""
        samples, q = self.rows.shape[0], self.factor
        first, last = start * q, min((stop - 1) * q + 1, samples)
        if not self.sections:
            return np.asarray(self.rows.read(first, last)[::q], dtype=float)
        sections = np.array(self.sections)
        far = settling(sections)
        begin = max(first - far, 0)
        end = min(last + far, samples) if self.zero_phase else last
        rows = np.asarray(self.rows.read(begin, end), dtype=float)
        return np.ascontiguousarray(apply_filter(sections, rows, self.zero_phase)[first - begin : last - begin : q])


def settling(sections: Array) -> int:
    """Return in how many samples a filter forgets its start: its slowest pole decays to 1e-20, one of several by some samples more.

    Parameters
    ----------
    sections : array, (s, 6)

    Examples
    --------
    >>> settling(np.array([[1.0, 0.0, 0.0, 1.0, -0.5, 0.0]]))
    67
    """
    size = max(float(np.abs(np.roots(section[3:])).max(initial=0.0)) for section in np.atleast_2d(sections))
    return int(np.ceil(np.log(_LEFT) / np.log(size))) if size > 0 else 2 * len(sections)


def apply_filter(sections: Array, x: RealArray, zero_phase: bool) -> RealArray:
    """Return x filtered along its samples.

    Parameters
    ----------
    sections : array, (s, 6)
    x : array, (..., samples, channels)
    zero_phase : bool
    """
    if zero_phase:
        pad = min(3 * (2 * len(sections) + 1), x.shape[-2] - 1)
        return np.asarray(scipy.signal.sosfiltfilt(sections, x, axis=-2, padlen=pad))
    # the filter starts as if the first sample had been there for ever: no step at the start of the record
    state = scipy.signal.sosfilt_zi(sections)
    start = np.moveaxis(np.multiply.outer(state, x[..., 0, :]), 1, -2)  # (sections, ..., 2, channels)
    return np.asarray(scipy.signal.sosfilt(sections, x, axis=-2, zi=start)[0])


def filtered(
    record: StoredSignals, sections: Array | None, factor: int, zero_phase: bool, note: str, rate: float
) -> StoredSignals:
    """Return a stored record behind a filter: nothing is read before somebody asks.

    Parameters
    ----------
    record : StoredSignals
    sections : array, (s, 6), or None
    factor : int
        One sample in so many is kept.
    zero_phase : bool
    note : str
        What is done, in words.
    rate : float
        The new sampling rate.
    """
    own = () if sections is None else tuple(tuple(map(float, section)) for section in sections)
    rows = FilteredRows(record.rows, own, factor, zero_phase)
    return replace(record, rows=rows, sampling_rate=rate).processed(note)
