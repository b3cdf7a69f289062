"""What an examination of data finds, in words: which channels, why, and what to do."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.setups import Setups
from modalscope.numerics.checks import Array, RealArray

__all__ = ["KINDS", "Finding", "Side", "dead_channels", "identical_channels", "sides_of"]

#: One side of the data: "output" or "input", its channels as columns (N, c), and their labels.
Side = tuple[str, Array, tuple[str, ...]]

#: All kinds of findings.
KINDS = (
    "overload",
    "double hit",
    "clipped",
    "dead",
    "noisy",
    "duplicate",
    "swapped",
    "polarity",
    "leakage",
    "low coherence",
    "reciprocity",
    "wrong quantity",
    "short record",
    "overflow",
    "frozen",
    "gap",
    "spikes",
    "transposed",
    "conjugated",
    "no phase",
    "lone lines",
    "exchanged",
    "delay",
    "missing samples",
    "no complex values",
    "places",
    "event",
)

#: Channels whose RMS about their mean is so many times the rounding of their largest value are dead; how large others are says nothing:
#: their unit may be another.
_DEAD = 32 * float(np.finfo(float).eps)

#: Channels are the same when what one has beside a multiple of the other is below this part of it.
_SAME = 1e-6


class Finding(NamedTuple):
    """One thing that is wrong, or may be, with data.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    channels : tuple of str
        Labels of the channels concerned.
    reason : str
        What was seen.
    change : str
        What to do about it.
    frequencies : tuple of float
        Hz: the lines or resonances concerned, where it concerns single ones.
    """

    kind: str
    channels: tuple[str, ...]
    reason: str
    change: str
    frequencies: tuple[float, ...] = ()

    def beside(self, bands: Sequence[tuple[float, float]]) -> Finding:
        """Return the same finding, which says so where it concerns no line of the bands (Hz).

        Parameters
        ----------
        bands : sequence of (float, float)
        """
        inside = any(low <= f <= high for f in self.frequencies for low, high in bands)
        if not bands or not self.frequencies or inside:
            return self
        words = ", ".join(f"{low:g} to {high:g} Hz" for low, high in bands)
        return self._replace(reason=f"{self.reason} (no line of the band {words} is concerned)")

    def __str__(self) -> str:
        return f"{self.kind}: {', '.join(self.channels)}: {self.reason}. {self.change}"


def sides_of(data: Signals | Records | Setups | Response) -> list[Side]:
    """Return outputs and, where there are any, inputs as columns: samples or lines, runs and channels of the other side below each other.

    Examples
    --------
    >>> [
    ...     (side, x.shape)
    ...     for side, x, _ in sides_of(Signals(outputs=np.ones((9, 3)), inputs=np.ones((9, 2)), sampling_rate=1.0))
    ... ]
    [('output', (9, 3)), ('input', (9, 2))]
    """
    if isinstance(data, Records):
        return _sides_of_runs(data)
    if isinstance(data, Setups):
        return [side for part in data.parts for side in sides_of(part)]
    both = (data.outputs, data.inputs) if isinstance(data, Signals) else (data.values.swapaxes(1, 2), data.values)
    named = zip(("output", "input"), both, (data.output_dofs, data.input_dofs), strict=True)
    return [(side, x.reshape(-1, x.shape[-1]), labels) for side, x, labels in named if x is not None and x.shape[-1]]


def _sides_of_runs(records: Records) -> list[Side]:
    """Return the same of runs below each other; an input that a run has not is zero in it."""
    outputs = np.concatenate([run.outputs for run in records.runs])
    inputs = np.zeros((len(outputs), len(records.input_dofs)))
    starts = np.cumsum([0, *records.samples])
    for r, run in enumerate(records.runs):
        if run.inputs is not None:
            inputs[starts[r] : starts[r + 1], list(records.inputs_of(r))] = run.inputs
    sides: list[Side] = [("output", outputs, records.output_dofs), ("input", inputs, records.input_dofs)]
    return [side for side in sides if side[1].shape[1]]


def dead_channels(samples: Array, labels: Sequence[str]) -> list[Finding]:
    """Find channels (N, c) that are constant, but for the rounding of their values."""
    found = []
    for label, x in zip(labels, samples.T, strict=True):
        largest = float(np.max(np.abs(x), initial=0.0))
        # from the first on, so that a sum of many rounds nothing, and over the largest, so that squares of any size are numbers
        if largest == 0 or float(np.std((x - x[0]) / largest)) < _DEAD:
            change = f"Check cable and sensor, or leave it out: exclude={[label]!r}."
            found.append(Finding("dead", (label,), "it never changes", change))
    return found


def identical_channels(samples: Array, labels: Sequence[str]) -> list[Finding]:
    """Find channels (N, c) that are multiples of an earlier one to 1e-6, each beside the first; channels at rest are passed over."""
    x = np.concatenate([samples.real, samples.imag]) if np.iscomplexobj(samples) else np.array(samples, dtype=float)
    x -= x.mean(axis=0)
    size = np.linalg.norm(x, axis=0)
    x /= np.where(size > 0, size, 1)
    found = []
    for group in _alike(x, np.flatnonzero(size > 0)):
        i = group[0]
        for j in group[1:]:
            a, b, factor = labels[i], labels[j], float(x[:, i] @ x[:, j]) * size[j] / size[i]
            found.append(
                Finding(
                    "duplicate",
                    (a, b),
                    f"{b} is {factor:.6g} times {a}, to rounding",
                    "Leave one out if a channel was recorded twice; of a symmetric structure without noise it is to be expected.",
                )
            )
    return found


def _alike(unit: RealArray, alive: Array) -> list[list[int]]:
    """Return groups of columns of unit length that are multiples of each other to 1e-6, each by rising number.

    Where u_j -+ u_i is small, |g u_i| and |g u_j| differ by no more for any row g of unit length: in their order only neighbours are
    compared, not all pairs.
    """
    g = np.random.default_rng(0).standard_normal(len(unit))
    place = np.abs(g @ unit) / np.linalg.norm(g)
    groups: list[list[int]] = []
    near = deque[list[int]]()
    for j in sorted(alive.tolist(), key=lambda k: float(place[k])):
        while near and place[near[0][0]] < place[j] - 2 * _SAME:
            near.popleft()
        own = next((group for group in near if _multiple(unit[:, group[0]], unit[:, j])), None)
        if own is None:
            near.append([j])
            groups.append(near[-1])
        else:
            own.append(j)
    return sorted(sorted(group) for group in groups if len(group) > 1)


def _multiple(one: RealArray, other: RealArray) -> bool:
    # the difference itself: 1 - likeness^2 would lose half of the digits
    return bool(np.linalg.norm(other - (one @ other) * one) < _SAME)
