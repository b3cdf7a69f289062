"""The pole that stands out of what a fit leaves of records: a matched filter under every input and the ends of every run.

With a_i = d_i / (x - p) for every drive i and E the residual, H = a^H a = L L^H and g = a^H E: a mode of shape c under b lowers the squared
misfit by the square of the largest singular value of L^-1 g, and b and c are its vectors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from modalscope.identification.matched import REACH, Peak, grid_of
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.driven_lines import DrivenLines
from modalscope.model.record_spectra import RecordSpectra

__all__ = ["strongest_driven"]

#: Poles whose lines are cut out together; so many lines at least; numbers held at a time.
_TOGETHER, _FEW, _HELD = 32, 16, 1 << 22

#: Directions of the drives that are this weak beside the strongest on the lines of a pole are none.
_WEAK = 1e-6


class _Seen(NamedTuple):
    """Lines in the order of their frequencies: where, points, drives and residual, both divided by the deviation of the row."""

    frequencies: RealArray
    points: ComplexArray
    drives: ComplexArray
    left: ComplexArray


def strongest_driven(
    records: RecordSpectra, lines: DrivenLines, left: RealArray, rows: RealArray, known: Array, least: float
) -> list[Peak]:
    """Return where the residual of records holds the strongest oscillation, if that lowers the squared misfit by `least`.

    Parameters
    ----------
    records : RecordSpectra
        One output: where the lines are.
    lines : DrivenLines
        The drives, each in its own size.
    left : array, (2 F, l)
        Whitened residual.
    rows : array, (2 F,)
        What rows were divided by.
    known : array of complex
        Poles that are there already: nothing is taken within half a half bandwidth of them.
    least : float
    """
    count, order = records.count, np.argsort(records.frequencies, kind="stable")
    seen = _Seen(
        records.frequencies[order],
        lines.points[order],
        lines.drives[order] / rows[:count][order, None],
        (left[:count] + 1j * left[count:])[order],
    )
    grid = grid_of(records)
    best, gain = 0j, 0.0
    for poles, (_, M) in _matched(records, seen, grid):
        found = np.linalg.norm(M, ord=2, axis=(1, 2)) ** 2
        found[np.any(np.abs(poles[:, None] - known) < -0.5 * known.real, axis=1)] = 0
        if found.max() > gain:
            best, gain = complex(poles[np.argmax(found)]), float(found.max())
    if gain < max(least, 1e-300):
        return []
    ((_, (back, M)),) = _matched(records, seen, np.array([best]))
    u, _, Vh = np.linalg.svd(M[0])
    b = back[0] @ u[:, 0]
    return [Peak(best, Vh[0], b / np.linalg.norm(b))]


def _matched(
    records: RecordSpectra, seen: _Seen, grid: ComplexArray
) -> Iterator[tuple[ComplexArray, tuple[ComplexArray, ComplexArray]]]:
    """Yield poles and their (B, B^H g), B B^H the inverse of H: (k, D, D) and (k, D, l)."""
    D, l = seen.drives.shape[1], seen.left.shape[1]
    order = np.argsort(-grid.real / np.abs(grid), kind="stable")
    few = min(_TOGETHER, max(1, _HELD // (len(seen.points) * max(D, 1))))
    for start in range(0, grid.size, few):
        poles = grid[order[start : start + few]]
        s = _near(seen.frequencies, poles)
        d, E = seen.drives[s], seen.left[s]
        filters = 1 / (seen.points[s] - records.in_plane(poles)[:, None])  # (k, F)
        H = (np.abs(filters) ** 2 @ (d.conj()[:, :, None] * d[:, None, :]).reshape(len(d), -1)).reshape(-1, D, D)
        g = np.stack([(filters.conj() * drive.conj()) @ E for drive in d.T], axis=1).reshape(-1, D, l)
        weights, V = np.linalg.eigh(H)
        kept = weights > _WEAK * weights[:, -1:]
        B = V * np.where(kept, 1 / np.sqrt(np.where(kept, weights, 1)), 0)[:, None, :]
        yield poles, (B, B.conj().transpose(0, 2, 1) @ g)


def _near(frequencies: RealArray, poles: ComplexArray) -> slice:
    """Return the lines that poles show on."""
    f, half = np.abs(poles.imag) / (2 * np.pi), REACH * np.max(-poles.real) / (2 * np.pi)
    low, high = np.searchsorted(frequencies, [f.min() - half, f.max() + half])
    return slice(max(min(low, frequencies.size - _FEW), 0), max(high, low + _FEW))
