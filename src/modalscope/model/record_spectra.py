"""Records on lines: the transforms of whole runs beside the inputs that drove them, judged where no frequency response is estimated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.model import record_sums as sums
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray, freeze, locked
from modalscope.model.driven_basis import DrivenBasis, Run, driven_basis
from modalscope.model.driven_lines import DrivenLines
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.groups import check_groups, run_groups
from modalscope.model.line_checks import lines_inside
from modalscope.model.line_choice import near_modes, telling_lines
from modalscope.model.no_response import NoResponse
from modalscope.model.notes import Note
from modalscope.model.poles import to_discrete
from modalscope.model.record_picture import picture_of
from modalscope.model.record_residual import excess, excess_notes, pole_notes
from modalscope.model.statespace import StateSpace

if TYPE_CHECKING:
    from modalscope.model.modes import ModalModel

__all__ = ["RecordSpectra"]

#: The degree below which damping is hardly known.
_LEAST_DEGREE = 8

#: Lines on which models of long records are judged, and refined, at most; numbers of the outputs on them, but so many lines at least.
_JUDGED, _REFINED = 32_768, 131_072
_NUMBERS, _LEAST_LINES = 1 << 19, 8192


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class RecordSpectra(NoResponse):
    """Transforms of the outputs on the lines of all runs, one run after the other, beside those of the inputs.

    A model gives Y = D U + sum_j c_j (l_j' U + w_j x) / (x - s_j) + conj: nothing is estimated, and a run may begin and end anywhere.

    Parameters
    ----------
    values : array of complex, (F, l, 1)
        Outputs, divided by the root of the number of samples.
    frequencies : array, (F,)
        Hz; increasing within a run.
    drive : array of complex, (F, m)
        Inputs; zero where a run has not this input.
    run : array of int, (F,)
        Which run each line belongs to.
    durations : tuple of float
        Seconds of every run.
    sampling_rate : float, optional
        Samples per second, when the inputs were held between samples (z-plane); None for those of a continuous structure.
    source : RecordSpectra, optional
        All lines, where these are some of them.
    groups : sequence of labels, "auto" or None
        One label a run: what disagrees between groups is repeatability. By default every run of several is one.
    level : array, (l,), optional
        What every output is divided by to be level with the others by its noise, where that was seen.
    line_scale : array, (F,), optional
        What outputs and inputs of every line were divided by, where their noise is not alike on all lines.
    """

    frequencies: RealArray
    drive: ComplexArray
    run: IntArray
    durations: tuple[float, ...]
    source: RecordSpectra | None = None
    level: RealArray | None = None
    line_scale: RealArray | None = None

    def __post_init__(self) -> None:
        given = (name for name in ("level", "line_scale") if getattr(self, name) is not None)
        arrays = ("values", "frequencies", "drive", "run", *given)
        freeze(self, **{name: locked(np.asarray(getattr(self, name))) for name in arrays})
        runs = len(self.durations)
        freeze(self, groups=check_groups(self.groups, runs, "a run", run_groups(runs)))
        self._label(self.values.shape[1], self.drive.shape[1])

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest line, Hz."""
        return float(self.frequencies.min()), float(self.frequencies.max())

    @property
    def grid(self) -> RealArray:
        """The lines of all runs, Hz, increasing."""
        return np.unique(self.frequencies)

    @property
    def held_input(self) -> bool:
        """Whether the inputs were held between samples."""
        return self.sampling_rate is not None

    @property
    def points(self) -> ComplexArray:
        """Where the lines lie: exp(j w dt), or j w."""
        return self._point(self.frequencies)

    def _point(self, frequencies: Array) -> ComplexArray:
        s = np.asarray(2j * np.pi * frequencies)
        return s if self.sampling_rate is None else np.exp(s / self.sampling_rate)

    def in_plane(self, poles: Array) -> ComplexArray:
        """Return poles in the plane of the points."""
        return (
            np.asarray(poles, dtype=complex)
            if self.sampling_rate is None
            else to_discrete(poles, 1 / self.sampling_rate)
        )

    def chain(self, poles: Array) -> ComplexArray:
        """Return d p / d s of poles p in the plane of the points."""
        one = np.ones(len(poles), dtype=complex)
        return one if self.sampling_rate is None else np.asarray(self.in_plane(poles) / self.sampling_rate)

    @property
    def spans_of_runs(self) -> tuple[slice, ...]:
        """Where the lines of every run stand."""
        return tuple(
            slice(*ends)
            for ends in pairwise(np.searchsorted(self.run, np.arange(len(self.durations) + 1, dtype=self.run.dtype)))
        )

    def runs(self) -> Iterator[Run]:
        """Yield the lines of every run."""
        for own in self.spans_of_runs:
            x = self._point(self.frequencies[own])
            yield Run(x, self.values[own, :, 0], self.drive[own], self.ends(own))

    def ones(self, lines: slice | IntArray) -> RealArray:
        """Return a one on some lines, divided by what the data there are divided by, (lines,)."""
        if self.line_scale is None:
            return np.ones(len(self.frequencies[lines]))
        return np.asarray(1 / self.line_scale[lines])

    def ends(self, lines: slice | IntArray) -> ComplexArray:
        """Return what the first and the last state of a run act through on some lines, (lines,): x in the z-plane, 1 in the s-plane."""
        one = self.ones(lines)
        return np.asarray(one + 0j if self.sampling_rate is None else one * self._point(self.frequencies[lines]))

    @property
    def lines(self) -> DrivenLines:
        """All lines with all drives, inputs and ends side by side."""
        own = self.run[:, None] == np.arange(len(self.durations))
        ends = own * self.ends(slice(None))[:, None]
        return DrivenLines(self.points, np.hstack([self.drive, ends]), self.drive.shape[1])

    @property
    def parts(self) -> tuple[int, str]:
        """Runs."""
        return len(self.durations), "a run"

    @property
    def drives(self) -> int:
        """Inputs and the ends of every run."""
        return int(self.drive.shape[1]) + len(self.durations)

    def continuous(self) -> RecordSpectra:
        """Return the same records as those of a continuous structure, measured through filters (s-plane)."""
        return replace(self, sampling_rate=None, source=None)

    def basis(self, poles: Array, powers: tuple[int, ...] = (0,), weights: Array | None = None) -> DrivenBasis:
        """Return what poles can contribute on the lines of all runs; see `Response.basis`."""
        return driven_basis(list(self.runs()), self.in_plane(poles))

    def judging(self) -> RecordSpectra:
        """Return the lines on which models are judged: of a long record some of all, and those of the peaks; `whole` has the others."""
        most = int(np.clip(_NUMBERS // self.values.shape[1], _LEAST_LINES, _JUDGED))
        if self.count <= most:
            return self
        return replace(self._at(telling_lines(sums.line_power(self), self.run, most)), source=self)

    @property
    def whole(self) -> RecordSpectra:
        """The records with all their lines."""
        return self if self.source is None else self.source

    def around(self, poles: Array) -> RecordSpectra:
        """Return the lines that tell about modes: all, or of a long record those nearest to a mode in half bandwidths."""
        kept = near_modes(self.frequencies, poles, 1 / max(self.durations), _REFINED)
        return self if kept.size == self.count else self._at(kept)

    def _at(self, lines: Array) -> RecordSpectra:
        names = ("values", "frequencies", "drive", "run", *(() if self.line_scale is None else ("line_scale",)))
        own = {name: getattr(self, name)[lines] for name in names}
        for array in own.values():
            array.setflags(write=False)  # nobody else has it: it need not be copied again
        return replace(self, source=None, **own)

    def whole_basis(self, poles: Array, powers: tuple[int, ...] = (0,)) -> DrivenBasis:
        """Return the same columns on all rows, with powers of the inputs and one less of the ends; see `Response.whole_basis`."""
        relative = np.asarray(1j * self.frequencies / self.span[1])
        return self.lines.basis(self.in_plane(poles), self.values, relative, powers)

    def left_of(self, poles: Array, shapes: Array, participation: Array, powers: tuple[int, ...] = (0,)) -> RealArray:
        """Return the data without what modes give; see `Response.left_of`."""
        nothing = np.zeros((1, self.values.shape[1], self.drive.shape[1]))
        return sums.left_rows(self, self.modelled(poles, shapes, participation, nothing))

    @property
    def eliminated(self) -> tuple[int, int]:
        """Functions beside the outputs: at most in one run (its inputs and its ends), and of all runs together."""
        each = [1 + int(np.any(self.drive[own], axis=0).sum()) for own in self.spans_of_runs if own.stop > own.start]
        return max(each), sum(each)

    @property
    def room(self) -> int:
        """Largest number of states worth a try: half of the columns that are left at the least degree."""
        return max((2 * self.count - (_LEAST_DEGREE + 1) * self.eliminated[1]) // 2, 2)

    @property
    def refined_powers(self) -> tuple[int, ...]:
        """Powers 0 to 5: what the response has beside its modes where forces were not held between samples, and modes outside the band."""
        return (0, 1, 2, 3, 4, 5)

    def named_terms(self, terms: RealArray, powers: tuple[int, ...]) -> dict[str, RealArray | None]:
        """Return the direct term by name."""
        return {"feedthrough": terms[0]}

    def spectrum(self) -> tuple[RealArray, ComplexArray]:
        """Return lines in Hz and the outputs on them and their neighbours, (F, l, p), whose singular values are a smoothed spectrum's."""
        f, values = zip(*sums.smoothed(self), strict=True)
        return np.concatenate(f), np.concatenate(values)

    def spectra(self) -> Iterator[tuple[RealArray, ComplexArray]]:
        """Yield the same, some lines at a time."""
        return sums.smoothed(self)

    def doubts(
        self, poles: Array, shapes: Array, participation: Array, terms: Array, trusted: Array
    ) -> tuple[Note, ...]:
        """Return what the fit of a model shows: forces that were not measured, noise on the inputs, drift, delay; see `Response.doubts`."""
        power = sums.left_power(self, self.modelled(poles, shapes, participation, terms))
        found = excess(self.frequencies, power, self.values[:, :, 0], poles[trusted], 1 / max(self.durations))
        return (*excess_notes(found), *pole_notes(self.in_plane(poles), self.sampling_rate, max(self.durations)))

    def told_of(self, participation: Array) -> ComplexArray:
        """Return the shortest participation of the inputs that gives the same; see `Response.told_of`."""
        return sums.shortest_participation(self, participation)

    @property
    def untold(self) -> tuple[Note, ...]:
        """A note on inputs that are zero or depend on each other; see `ResponseFacts.untold`."""
        return sums.untold_notes(self)

    def picture(self) -> FrequencyResponse:
        """Return frequency responses H1 of the lines and their neighbours, for the eye alone: nothing is judged on them."""
        return picture_of(
            self.frequencies, self.values[:, :, 0], self.drive, {**self.labelled(), "quantity": self.quantity}
        )

    def energy(self, decay: Array) -> RealArray:
        """Return T / (2 decay), T the seconds of all runs: the sum of |1 / (j w - s)|^2 over lines that lie 1 / T apart."""
        return np.asarray(sum(self.durations) / (2 * np.asarray(decay)))

    def driven(self, poles: Array, participation: Array) -> RealArray:
        """Return the root mean square of what drives each pole on the lines near its frequency, (n,); see `Response.driven`."""
        return sums.drive_of_poles(self, poles, participation)

    def in_band(self, band: tuple[float, float] | None) -> RecordSpectra:
        """Return the lines in a band."""
        return self if band is None else self._at(lines_inside(self.frequencies, band))

    def reported_band(self, band: tuple[float, float] | None) -> tuple[float, float]:
        """Return the lowest and the highest line: the band has cut them."""
        return self.span

    def rebuilt_by(self, model: StateSpace) -> RecordSpectra:
        """Return what a model gives on these lines under the measured inputs, from the first states that fit best."""
        return replace(self, values=sums.rebuilt_values(self, model))

    def of_modes(self, modes: ModalModel) -> RecordSpectra:
        """Return what modes give on these lines under the measured inputs, from the first states that fit best."""
        participation = modes.known_participation("records rebuilt from modes were asked")
        direct = modes.feedthrough
        terms = np.zeros((1, self.values.shape[1], self.drive.shape[1])) if direct is None else direct[None]
        values = self.evaluated(modes.poles, modes.shapes, participation, terms)
        values.setflags(write=False)  # nobody else has it: it need not be copied again
        return replace(self, values=values[:, :, None])

    def evaluated(self, poles: Array, shapes: Array, participation: Array, terms: Array) -> ComplexArray:
        """Return the outputs (F, l) of shapes (l, n), participation (n, m) or (n, m + R) and D (1, l, m); ends not given are fitted."""
        found = np.empty(self.values.shape[:2], complex)
        for s, part in self.modelled(poles, shapes, participation, terms):
            found[s] = part
        return found

    def modelled(
        self, poles: Array, shapes: Array, participation: Array, terms: Array
    ) -> Iterator[tuple[slice, ComplexArray]]:
        """Yield some lines, and what `evaluated` returns there: of long records all outputs together are large."""
        if participation.shape[1] == self.drive.shape[1]:
            ends = self.basis(poles).fit_ends(shapes, participation, terms)
            participation = np.hstack([participation, ends])
        return self.lines.evaluated(self.in_plane(poles), shapes, participation, terms[0])

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        own = {} if self.level is None else {"level": self.level[outputs]}
        return {"values": self.values[:, outputs], "drive": self.drive[:, inputs], "source": None, **own}
