"""Hold spectra of whole runs with the inputs that drove them, and compare models with them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from modalscope.data.channels import check_groups, run_groups
from modalscope.data.line_choice import near_modes, picture_of, telling_lines
from modalscope.data.mode_fields import ModeFields
from modalscope.data.notes import Note
from modalscope.data.quadruple import Quadruple
from modalscope.data.record_residual import excess, excess_notes, pole_notes
from modalscope.data.residual_terms import ResidualTerms
from modalscope.data.response import INSEPARABLE, Conversion, Response, output_scale
from modalscope.data.responses import FrequencyResponse, lines_inside
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, freeze, locked
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.driven_basis import DrivenBasis, DrivenLines, Run, driven_basis
from modalscope.numerics.functions.poles import to_discrete

#: Neighbouring lines on either side of which one value of the smoothed spectrum is made.
_NEIGHBOURS = 3

#: Complex numbers that are computed at a time: 4 MB.
_NUMBERS_AT_A_TIME = 1 << 18

#: Singular value below which a direction of the inputs, each of length one, is zero, and the minimum share of an input in it.
_ZERO_DIRECTION, _MIN_SHARE_OF_DIRECTION = 1e-9, 1e-6

#: The degree below which damping is hardly known.
_MIN_DEGREE = 8

#: Powers of the terms at most: with more, neither poles nor the coverage of intervals change (50 random structures under forces not
#: held between samples, noise of 40 dB, white and AR(.95)).
_MAX_POWERS = 21

#: Lines of a run for each term of an input at least.
_MIN_LINES_PER_TERM = 10

#: Lines on which models of long records are judged, and refined, at most; numbers of the outputs on them, but so many lines at least.
_MAX_JUDGED_LINES, _MAX_REFINED_LINES = 32_768, 131_072
_MAX_JUDGED_NUMBERS, _MIN_JUDGED_LINES = 1 << 19, 8192


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class RecordSpectra(Response):
    """Transforms of the outputs on the lines of all runs, one run after the other, beside those of the inputs.

    A model gives Y = D U + sum_j c_j (l_j' U + w_j x) / (x - s_j) + conj: nothing is estimated, and a run may begin and end anywhere.

    `values` (F, l, 1): outputs, divided by the root of the number of samples. `frequencies` (F,): hz; increasing within a run. `drive`
    (F, m): inputs; zero where a run has not this input. `run` (F,): which run each line belongs to. `durations`: seconds of every run.
    `sampling_rate`: samples per second, when the inputs were held between samples (z-plane); None for those of a continuous structure.
    `source`: all lines, where these are some of them. `groups`: one label per run: what disagrees between groups is repeatability. By
    default every run of several is one. `level` (l,): what every output is divided by to be level with the others by its noise, where
    that was seen. `line_scale` (F,): what outputs and inputs of every line were divided by, where their noise is not alike on all lines.
    """

    frequencies: RealArray
    drive: ComplexArray
    run: IntArray
    durations: tuple[float, ...]
    source: RecordSpectra | None = None
    level: RealArray | None = None
    line_scale: RealArray | None = None
    origin: ClassVar[str] = "records"
    separable: ClassVar[bool] = False
    columns: ClassVar[tuple[str, ...]] = ("all inputs",)

    def __post_init__(self) -> None:
        given = (name for name in ("level", "line_scale") if getattr(self, name) is not None)
        arrays = ("values", "frequencies", "drive", "run", *given)
        freeze(self, **{name: locked(np.asarray(getattr(self, name))) for name in arrays})
        runs = len(self.durations)
        freeze(self, groups=check_groups(self.groups, runs, "run", run_groups(runs)))
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
    def points(self) -> ComplexArray:
        """Where the lines lie: exp(j w dt), or j w."""
        return self._point(self.frequencies)

    def _point(self, frequencies: Array) -> ComplexArray:
        s = np.asarray(2j * np.pi * frequencies)
        return s if self.sampling_rate is None else np.exp(s / self.sampling_rate)

    def in_plane(self, poles: Array) -> ComplexArray:
        """Return poles in the plane of the points."""
        if self.sampling_rate is None:
            return np.asarray(poles, dtype=complex)
        return to_discrete(poles, 1 / self.sampling_rate)

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
        return 1 / self.line_scale[lines]

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
        return len(self.durations), "run"

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

    def power(self) -> RealArray:
        """Return the squares of all outputs together on every line, each output level, (F,): single precision, as a weight of lines."""
        power: Any = np.empty(self.count, np.float32)
        weight = output_scale(self) ** -2.0
        step = max(_NUMBERS_AT_A_TIME // weight.size, 1)
        for start in range(0, self.count, step):
            lines = slice(start, start + step)
            power[lines] = np.abs(self.values[lines, :, 0]) ** 2 @ weight
        return np.asarray(power)

    def judging(self) -> RecordSpectra:
        """Return the lines on which models are judged: of a long record some of all, and those of the peaks; `whole` has the others."""
        most = int(np.clip(_MAX_JUDGED_NUMBERS // self.values.shape[1], _MIN_JUDGED_LINES, _MAX_JUDGED_LINES))
        if self.count <= most:
            return self
        return replace(self._at(telling_lines(self.power(), self.run, most)), source=self)

    @property
    def whole(self) -> RecordSpectra:
        """The records with all their lines."""
        return self if self.source is None else self.source

    def around(self, poles: Array) -> RecordSpectra:
        """Return the lines that tell about modes: all, or of a long record those nearest to a mode in half bandwidths."""
        kept = near_modes(self.frequencies, poles, 1 / max(self.durations), _MAX_REFINED_LINES)
        return self if kept.size == self.count else replace(self._at(kept), source=self.whole)

    def _at(self, lines: Array) -> RecordSpectra:
        names = ("values", "frequencies", "drive", "run", *(() if self.line_scale is None else ("line_scale",)))
        own = {name: getattr(self, name)[lines] for name in names}
        for array in own.values():
            array.setflags(write=False)  # nobody else has it: it need not be copied again
        return replace(self, source=None, **own)

    def whole_basis(self, poles: Array, powers: tuple[int, ...] = (0,)) -> DrivenBasis:
        """Return the same columns on all rows, with powers of the inputs and one less of the ends; see `Response.whole_basis`."""
        return self._basis(self.lines, slice(None), poles, powers)

    def pieces(self, poles: Array, powers: tuple[int, ...]) -> Iterator[DrivenBasis]:
        """Yield `whole_basis` of some lines at a time: of long records it is large."""
        lines, width = self.lines, max(self.drives * (2 * len(poles) + len(powers)), self.values.shape[1])
        step = max(_NUMBERS_AT_A_TIME // width, 1)
        for start in range(0, self.count, step):
            s = slice(start, start + step)
            yield self._basis(DrivenLines(lines.points[s], lines.drives[s], lines.inputs), s, poles, powers)

    def _basis(self, own: DrivenLines, lines: slice, poles: Array, powers: tuple[int, ...]) -> DrivenBasis:
        relative = np.asarray(1j * self.frequencies[lines] / self.span[1])
        return own.basis(self.in_plane(poles), self.values[lines], relative, powers)

    def residual_of(
        self, poles: Array, shapes: Array, participation: Array, powers: tuple[int, ...] = (0,)
    ) -> RealArray:
        """Return the data without what modes give; see `Response.residual_of`."""
        nothing = np.zeros((1, self.values.shape[1], self.drive.shape[1]))
        rows = np.empty((2, *self.values.shape))
        for s, part in self.modelled(poles, shapes, participation, nothing):
            residual = self.values[s, :, 0] - part
            rows[0, s, :, 0], rows[1, s, :, 0] = residual.real, residual.imag
        return rows.reshape(-1, *self.values.shape[1:])

    @property
    def eliminated(self) -> tuple[int, int]:
        """Functions beside the outputs: at most in one run (its inputs and its ends), and of all runs together."""
        each = [1 + int(np.any(self.drive[own], axis=0).sum()) for own in self.spans_of_runs if own.stop > own.start]
        return max(each), sum(each)

    @property
    def max_states(self) -> int:
        """Largest number of states worth a try: half of the columns that are left at the least degree."""
        return max((2 * self.count - (_MIN_DEGREE + 1) * self.eliminated[1]) // 2, 2)

    @property
    def refined_powers(self) -> tuple[int, ...]:
        """Powers 0 to 5: what the response has beside its modes where forces were not held between samples, and modes outside the band."""
        return (0, 1, 2, 3, 4, 5)

    @property
    def max_powers(self) -> int:
        """Twenty-one at most: noise far below the response shows what fewer leave of forces that were not held."""
        return max(min(_MAX_POWERS, self.count // (_MIN_LINES_PER_TERM * self.drives)), len(self.refined_powers))

    def named_terms(self, terms: RealArray, powers: tuple[int, ...]) -> dict[str, RealArray | None]:
        """Return the direct term by name."""
        return {"feedthrough": terms[0]}

    def spectrum(self) -> tuple[RealArray, ComplexArray]:
        """Return lines in Hz and the outputs on them and their neighbours, (F, l, p), whose singular values are a smoothed spectrum's."""
        f, values = zip(*self.spectra(), strict=True)
        return np.concatenate(f), np.concatenate(values)

    def spectra(self) -> Iterator[tuple[RealArray, ComplexArray]]:
        """Yield the same, some lines at a time, increasing."""
        order, offsets = np.argsort(self.frequencies, kind="stable"), np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)
        lowest, highest = (np.array([getattr(run, end) for run in self.spans_of_runs]) for end in ("start", "stop"))
        step = max(_NUMBERS_AT_A_TIME // (self.values.shape[1] * offsets.size), 1)
        for start in range(0, order.size, step):
            lines = order[start : start + step]
            r = self.run[lines, None]
            values = self.values[np.clip(lines[:, None] + offsets, lowest[r], highest[r] - 1), :, 0]
            values /= np.sqrt(offsets.size)
            yield self.frequencies[lines], values.transpose(0, 2, 1)

    def doubts(
        self, poles: Array, shapes: Array, participation: Array, terms: Array, trusted: Array
    ) -> tuple[Note, ...]:
        """Return what the fit of a model shows: forces that were not measured, noise on the inputs, drift, delay; see `Response.doubts`."""
        power, level = np.empty(self.values.shape[:2]), output_scale(self)
        for s, part in self.modelled(poles, shapes, participation, terms):
            power[s] = np.abs((self.values[s, :, 0] - part) / level) ** 2
        found = excess(self.frequencies, power, self.values[:, :, 0], poles[trusted], 1 / max(self.durations), level)
        return (*excess_notes(found), *pole_notes(self.in_plane(poles), self.sampling_rate, max(self.durations)))

    def shortest_participation(self, participation: Array) -> ComplexArray:
        """Return the shortest participation of the inputs that gives the same; see `Response.shortest_participation`."""
        size, alone = self._silent_inputs()
        scaled = participation * size
        return np.asarray((scaled - (scaled @ alone.T) @ alone) / size)

    @property
    def inseparable_inputs(self) -> tuple[Note, ...]:
        """A note on inputs that are zero or depend on each other; see `Response.inseparable_inputs`."""
        _, alone = self._silent_inputs()
        share = dict(zip(self.input_dofs, np.linalg.norm(alone, axis=0).tolist(), strict=True))
        inseparable = {dof: size for dof, size in share.items() if size > _MIN_SHARE_OF_DIRECTION}
        text = (
            f"inputs {', '.join(inseparable)} are zero or depend on each other: only their joint effect is known, not that of each "
            "(participation: minimum norm, inputs scaled to one size)"
        )
        return (Note(INSEPARABLE, inseparable, text),) if inseparable else ()

    def _silent_inputs(self) -> tuple[RealArray, RealArray]:
        """Return the sizes of the inputs, one for zero inputs, and the directions of scaled inputs that are zero on every line, (k, m)."""
        U = np.concatenate([self.drive.real, self.drive.imag])
        size = np.linalg.norm(U, axis=0)
        size = np.where(size > 0, size, 1)
        _, d, Vt = np.linalg.svd(np.linalg.qr(U / size, mode="r"))
        return size, Vt[np.count_nonzero(d > _ZERO_DIRECTION) :]

    def picture(self) -> FrequencyResponse:
        """Return frequency responses H1 of the lines and their neighbours, for the eye alone: nothing is judged on them."""
        return picture_of(
            self.frequencies, self.values[:, :, 0], self.drive, {**self.labelled(), "quantity": self.quantity}
        )

    def energy(self, decay: Array) -> RealArray:
        """Return T / (2 decay), T the seconds of all runs: the sum of |1 / (j w - s)|^2 over lines that lie 1 / T apart."""
        return sum(self.durations) / (2 * np.asarray(decay))

    def driven(self, poles: Array, participation: Array) -> RealArray:
        """Return the root mean square of what drives each pole on the lines near its frequency, (n,); see `Response.driven`."""
        rate = self.sampling_rate or 1.0
        f, half = np.abs(poles.imag) / (2 * np.pi), np.abs(poles.real) / (2 * np.pi)
        power, count = np.zeros(len(poles)), np.zeros(len(poles))
        for r, run in enumerate(self.runs()):
            lines = self.frequencies[self.run == r]
            if not lines.size:
                continue
            drives = np.hstack([run.inputs, np.zeros((lines.size, len(self.durations)))])
            drives[:, run.inputs.shape[1] + r] = run.ends
            middle = np.searchsorted(lines, f)
            low = np.clip(np.minimum(np.searchsorted(lines, f - half), middle - _NEIGHBOURS), 0, lines.size - 1)
            high = np.clip(np.maximum(np.searchsorted(lines, f + half), middle + _NEIGHBOURS), low + 1, lines.size)
            for j, (a, b) in enumerate(zip(low, high, strict=True)):
                power[j] += np.sum(np.abs(drives[a:b, : participation.shape[1]] @ participation[j]) ** 2)
                count[j] += b - a
        return rate * np.sqrt(power / np.maximum(count, 1))

    def functions(self, poles: Array, *, slopes: bool = False, lines: slice = slice(None)) -> RealArray:
        """Raise: in records every pole is driven by all inputs together."""
        raise DataError("functions of poles alone:", "inputs of records act together", "Use a frequency response.")

    def as_samples(self) -> Conversion:
        """Raise: records are no response; see `estimate_markov`."""
        raise DataError("samples of a response:", "the data are records on lines", "Use route='markov'.")

    def as_lines(self) -> Conversion:
        """Raise: records are no response; see `estimate_frf`."""
        raise DataError("frequency responses:", "the data are records on lines", "Use route='frf'.")

    def in_band(self, band: tuple[float, float] | None) -> RecordSpectra:
        """Return the lines in a band."""
        return self if band is None else self._at(lines_inside(self.frequencies, band))

    def reported_band(self, band: tuple[float, float] | None) -> tuple[float, float]:
        """Return the lowest and the highest line: the band has cut them."""
        return self.span

    def rebuilt_by(self, model: Quadruple) -> RecordSpectra:
        """Return what a model gives on these lines under the measured inputs, from the first states that fit best."""
        s = 2j * np.pi * self.frequencies
        x = s if model.dt is None else np.exp(s * model.dt)
        values, level = np.einsum("flm,fm->fl", model.transfer(x), self.drive), output_scale(self)
        states = Quadruple(A=model.A, B=np.eye(model.order), C=model.C, dt=model.dt)
        for r in range(len(self.durations)):
            lines = self.run == r
            free = states.transfer(x[lines]) * self.ends(np.flatnonzero(lines))[:, None, None]
            columns = (free / level[:, None]).reshape(-1, model.order)
            residual = ((self.values[lines, :, 0] - values[lines]) / level).reshape(-1)
            first = np.linalg.lstsq(
                np.concatenate([columns.real, columns.imag]), np.concatenate([residual.real, residual.imag]), rcond=None
            )[0]
            values[lines] += free @ first
        return replace(self, values=values[:, :, None])

    def of_modes(self, modes: ModeFields) -> Array:
        """Return what modes give on these lines under the measured inputs, from the first states that fit best."""
        participation = modes.known_participation("records rebuilt from modes:")
        direct = None if modes.residual_terms else modes.feedthrough
        terms = np.zeros((1, self.values.shape[1], self.drive.shape[1])) if direct is None else direct[None]
        if not modes.residual_terms:
            return self.evaluated(modes.poles, modes.shapes, participation, terms)[:, :, None]
        besides = sum(self._of_terms(each) for each in modes.residual_terms)
        # ends of the modes are fitted to what the terms leave
        own = replace(self, values=self.values - besides, level=output_scale(self), source=None)
        participation = own._with_ends(modes.poles, modes.shapes, participation, terms)
        return self.evaluated(modes.poles, modes.shapes, participation, terms)[:, :, None] + besides

    def _with_ends(self, poles: Array, shapes: Array, participation: Array, terms: Array) -> ComplexArray:
        """Return participation with that of the ends, fitted with outputs brought level."""
        basis, level = self.basis(poles), output_scale(self)[:, None]
        even = replace(basis, data=basis.data / level)
        return np.hstack([participation, even.fit_ends(shapes / level, participation, terms / level)])

    def _of_terms(self, terms: ResidualTerms) -> ComplexArray:
        """Return what residual terms give on these lines under the measured inputs, (F, l, 1); nothing outside their band."""
        found, coefficients, done = np.zeros(self.values.shape, complex), terms.packed(self.drives, self.span[1]), 0
        for basis in self.pieces(terms.poles, terms.powers):
            count = len(basis.data) // 2
            rows = basis.columns @ coefficients
            found[done : done + count, :, 0] = rows[:count] + 1j * rows[count:]
            done += count
        found[(self.frequencies < terms.band[0]) | (self.frequencies > terms.band[1])] = 0
        return found

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
            participation = self._with_ends(poles, shapes, participation, terms)
        return self.lines.evaluated(self.in_plane(poles), shapes, participation, terms[0])

    def _arrays(self, outputs: list[int], inputs: list[int]) -> dict[str, Any]:
        own = {} if self.level is None else {"level": self.level[outputs]}
        return {"values": self.values[:, outputs], "drive": self.drive[:, inputs], "source": None, **own}
