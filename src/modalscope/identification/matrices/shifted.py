"""Shifted transfer functions Y_t(z) = sum_k Y(k + t) z^-k over a finite window (Eqs. 78-82), exact for any record.

Nothing is assumed beyond the last sample: Y_t = C A^t G B with G = sum_(k < K) A^k z^-k, whatever has or has not decayed. On the
window's own lines the block matrix is the Hankel matrix times an orthogonal one; on some of them, a band, it leaves the rest
of the spectrum out. The samples are those of a pulse response, or the inverse transform of a sampled system's full grid of lines, which
is periodised, C A^k (I - A^M)^-1 B, and so has the same A and C.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.influence import (
    ConvolvedInfluence,
    LineInfluence,
    Lines,
    Outer,
    all_lines,
    convolved,
    transformed,
)
from modalscope.identification.matrices.line_columns import LineMatrix, VectorsOnLines, kept_block_rows
from modalscope.identification.matrices.lines import real_columns
from modalscope.identification.matrices.matrix import Eigen, ModalFit, RowShift, Triple
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import stacked_basis
from modalscope.numerics.functions.poles import to_continuous, to_discrete
from modalscope.numerics.linear_systems import HELD


def window_lines(window: int, sampling_rate: float) -> RealArray:
    """Return the lines of a window of samples from 0 to half the sampling rate, Hz."""
    return np.asarray(np.fft.rfftfreq(window, 1 / sampling_rate), dtype=float)


def shifted_transfer(
    values: Array, points: ArrayLike, window: int, shifts: Sequence[int], start: ComplexArray | None = None
) -> ComplexArray:
    """Return Y_t(z) = sum_(k < K) Y(k + t) z^-k for every shift t, (shifts, F, l, m).

    `values` (N, l, m): markov parameters; K + the last shift of them are read. `points` (F,): z of the lines, on the unit circle.
    `window`: k. `shifts`: increasing. `start` (F, l, m): y_0, where it is known already. By recursion, Eq. 81:
    Y_(t+1) = z (Y_t - Y(t) + z^-K Y(K + t)).
    """
    z = np.asarray(points, dtype=complex)
    need = window + max(shifts)
    if need > len(values):
        raise DataError(
            f"a window of {window} samples with shifts to {max(shifts)} reads {need} samples",
            f"the response has {len(values)}",
            f"Lower block_columns to at most {len(values) - max(shifts)}, or measure a longer response.",
        )
    current = _sum(values[:window], z) if start is None else start
    last = z**-window
    shifted = []
    for t in range(max(shifts) + 1):
        if t in shifts:
            shifted.append(current)
        current = z[:, None, None] * (current - values[t])
        if window + t < len(values):
            current += (z * last)[:, None, None] * values[window + t]
    return np.stack(shifted)


def _sum(values: Array, z: ComplexArray) -> ComplexArray:
    """Return sum_k values[k] z^-k, some lines at a time."""
    steps = np.arange(len(values))
    at_once = max(1, HELD // len(values))
    parts = [np.tensordot(z[i : i + at_once, None] ** -steps, values, axes=1) for i in range(0, z.size, at_once)]
    return np.concatenate(parts)


def is_full_grid(response: FrequencyResponse) -> bool:
    """Whether the lines are all of a sampled system's DFT grid from 0 to (nearly) half the sampling rate."""
    f, rate = response.frequencies, response.sampling_rate
    if rate is None or f.size < 3 or f[0] != 0:
        return False
    step = f[1]
    length = rate / step
    even = np.max(np.abs(f - step * np.arange(f.size))) < 1e-6 * step
    return bool(even and abs(length - round(length)) < 1e-6 and f.size == round(length) // 2 + 1)


def window_sum(poles: Array, points: ComplexArray, window: int) -> ComplexArray:
    """Return sum_(k < K) r^k = (1 - r^K) / (1 - r), r = z_j / z_i."""
    r = np.asarray(poles)[None, :] / points[:, None]
    with np.errstate(under="ignore", divide="ignore", invalid="ignore", over="ignore"):
        total = (1 - r**window) / (1 - r)
    return np.where(np.abs(1 - r) < 1e-14, complex(window), total)


def shifted(
    response: Response,
    *,
    block_rows: int,
    block_columns: int | None = None,
    band: tuple[float, float] | None = None,
    weights: ArrayLike | None = None,
    row_shifts: Sequence[int] | None = None,
) -> Shifted:
    """Stack Y_t(z_i), t = 0 ... block_rows, on the lines of a window of block_columns samples.

    `response`: samples, or the full DFT grid of a sampled system. `block_rows`: q: H(0) holds Y_0 ... Y_(q-1). `block_columns`: samples
    in the window, K; K + q of them are read. All by default. `band`: lines of the window that are used, Hz; all by default. `weights`
    (lines used,). `row_shifts`: the t_i of Eq. 82, 0 among them, in the place of block_rows.

    Raises `DataError`: A record that is too short, a band without lines, lines that are not a full grid.
    """
    samples, rate = _samples_of(response)
    rows = kept_block_rows(row_shifts)
    q = check_count("block_rows", block_rows if rows is None else rows[-1] + 1)
    window = len(samples) - q if block_columns is None else check_count("block_columns", block_columns)
    if window < 2 or window + q > len(samples):
        raise DataError(
            f"block_rows={q} with block_columns={window} reads {window + q} samples",
            f"there are {len(samples)}",
            "Lower block_rows or block_columns, or measure a longer response.",
        )
    lines = window_lines(window, rate)
    used = np.arange(lines.size) if band is None else np.flatnonzero((lines >= band[0]) & (lines <= band[1]))
    if used.size == 0:
        raise DataError(
            f"the band {band} Hz:",
            f"the {lines.size} lines of the window lie from 0 to {lines[-1]:g} Hz, {lines[1]:g} Hz apart, none of them inside",
            "Widen the band, or raise block_columns.",
        )
    # an inner line stands for its mirror image at -w too
    mirrored = np.where((used == 0) | (2 * used == window), 1.0, np.sqrt(2.0))
    return Shifted(
        response=response,
        samples=samples,
        used=used,
        points=np.exp(2j * np.pi * lines[used] / rate),
        frequencies=lines[used],
        window=window,
        line_weights=mirrored if weights is None else mirrored * np.asarray(weights),
        interval=1 / rate,
        degree=q,
        row_shifts=rows,
    )


def _samples_of(response: Response) -> tuple[RealArray, float]:
    """Return samples, periodised where lines were measured, and their rate."""
    if isinstance(response, FrequencyResponse):
        if not is_full_grid(response):
            raise DataError(
                "periodised samples of the lines:",
                "the lines do not cover 0 Hz to half the sampling rate in even steps",
                "Use source='elimination', which takes any lines.",
            )
        return response.to_impulse_response().values, float(response.sampling_rate or 0)
    assert isinstance(response, ImpulseResponse)
    return response.values, response.sampling_rate


@dataclass(frozen=True, eq=False)
class Shifted(LineMatrix):
    """The block matrix of shifted transfer functions (made by `shifted`)."""

    response: Response
    samples: RealArray
    used: IntArray
    points: ComplexArray
    frequencies: RealArray
    window: int
    line_weights: RealArray
    interval: float
    degree: int
    row_shifts: tuple[int, ...] | None = None

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0), q."""
        return self.degree

    @property
    def outputs(self) -> int:
        """Rows of a block."""
        return int(self.samples.shape[1])

    @property
    def inputs(self) -> int:
        """Columns of a line."""
        return int(self.samples.shape[2])

    def columns_array(self, i: int) -> RealArray:
        """Return all block rows of input i, transposed: (2 F, l (q + 1))."""
        values = self.samples[:, :, i : i + 1]
        transfer = shifted_transfer(
            values, self.points, self.window, range(self.degree + 1), start=self.transformed(values)
        )
        return real_columns(
            transfer[..., 0].transpose(1, 0, 2).reshape(self.points.size, -1), self.line_weights / np.sqrt(self.window)
        )

    def column_functions(self, poles: Array) -> tuple[ComplexArray, RealArray]:
        """Return sum_(k < K) (s_j / z_i)^k along the columns of one input, (2 F, k), of which nothing is eliminated."""
        g, mirrored = (window_sum(poles, x, self.window) for x in (self.points, self.points.conj()))
        w = (self.line_weights / np.sqrt(self.window))[:, None]
        return np.vstack([w * (g + mirrored) / 2, w * (g - mirrored) / 2j]), np.ones(len(poles))

    @property
    def of_lines(self) -> bool:
        """Whether lines were measured, of which the samples are periodised."""
        return self.response.grid is not None

    def residue_scale(self, poles: Array) -> ComplexArray:
        """Participation at the first sample for that at the impulse: z^(steps between them), (k,)."""
        power = np.asarray(poles, dtype=complex) ** self.response.steps_late
        if self.of_lines:  # periodised: B' = (I - A^M)^-1 B
            power = power / (1 - np.asarray(poles) ** (len(self.samples) + 1))
        return power

    @cached_property
    def level(self) -> RealArray:
        """Size of the response on every line, (F,)."""
        return np.asarray(np.linalg.norm(self.transformed(self.samples), axis=(1, 2)))

    @property
    def full_shift(self) -> RowShift:
        """E0 and E1."""
        return RowShift.by_block(self.outputs, self.degree)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return (first block row of H(k)) X."""
        return np.asarray(self.triangle[k * self.outputs : (k + 1) * self.outputs] @ right)

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""
        return to_continuous(poles, self.interval)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles on the z-plane."""
        return to_discrete(poles, self.interval)

    @property
    def dt(self) -> float:
        """Sampling interval."""
        return self.interval

    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """Return z^k."""
        return np.asarray(np.asarray(poles)[None, :] ** self.block_indices(blocks)[:, None], dtype=complex)

    def influence(
        self, left: Array, right: VectorsOnLines, lines: Lines | None = None
    ) -> ConvolvedInfluence | LineInfluence:
        """Return the gradient: right vectors go back from lines to the window's samples, where they meet the rows as in a Hankel matrix.

        Where lines were measured the gradient is that by the lines, through their inverse transform.
        """
        real, imaginary = right.parts()
        w = (self.line_weights / np.sqrt(self.window) / 2)[:, None]
        spectrum = np.zeros((len(left), self.window, self.inputs), dtype=complex)
        spectrum[:, self.used] += w * (real + 1j * imaginary)
        spectrum[:, -self.used % self.window] += w * (real - 1j * imaginary)
        columns = self.window * np.fft.ifft(spectrum, axis=1)
        L = left.reshape(len(left), -1, self.outputs)
        if self.of_lines:
            return self._by_lines(L, columns)
        return convolved(L, columns)

    def _by_lines(self, rows: ComplexArray, columns: ComplexArray) -> LineInfluence:
        """Return the gradient by the lines: sample k is Re sum_f c_f H_f exp(j (k + 1) angle_f) / M, c = 1 at the ends and 2 between."""
        length = len(self.samples) + 1
        lines = np.arange(self.response.count)
        g = transformed(rows, columns, length)
        share = np.where((lines == 0) | (2 * lines == length), 1.0, 2.0) / (2 * length)
        turn = (share * np.exp(2j * np.pi * lines / length))[:, None]
        back = -lines % length
        direct = Outer(g.left[:, back], g.right[:, back] * turn)
        mirrored = Outer(g.left[:, lines], g.right[:, lines] * turn.conj())
        return LineInfluence((direct,), (mirrored,), all_lines(self.response.count))

    def transformed(self, values: Array) -> ComplexArray:
        """Return Y_0 of samples on the lines used, (F, l, m): what the fit of B is made to and judged on."""
        return np.asarray(np.fft.rfft(values[: self.window], axis=0)[self.used])

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes C X; participation by least squares over the lines of the window, or over those that were measured."""
        shapes = np.asarray(model.C @ eigen.vectors)
        if self.of_lines:
            basis = self.response.basis(self.to_s(eigen.values))
            participation, terms = basis.fit_participation(shapes)
            return ModalFit(shapes, participation, terms, reach=basis.reach)
        z = eigen.values
        functions, mirrored = (window_sum(poles, self.points, self.window) for poles in (z, z.conj()))
        nothing = np.zeros((len(functions), 0))
        window = stacked_basis(
            functions, mirrored, z.imag == 0, nothing, self.transformed(self.samples), self.line_weights
        )
        participation = window.fit_participation(shapes)[0]
        late = self.response.steps_late
        if late:
            participation = participation / z[:, None] ** late
        feedthrough = self.response.feedthrough
        return ModalFit(
            shapes, participation, (np.zeros(self.samples.shape[1:]) if feedthrough is None else feedthrough)[None]
        )

    def compared(self, model: StateSpace, poles: Array, fit: ModalFit) -> Iterator[tuple[Array, Array]]:
        """Yield data and model on the lines of the window; where lines were measured, on those."""
        if self.of_lines:
            yield from super().compared(model, poles, fit)
            return
        yield self.transformed(self.judged.values), self.transformed(self.judged.values_of(model))

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        of = (
            f"{self.window} periodised samples (exact: the lines are a sampled system's full grid)"
            if self.of_lines
            else f"{self.window} samples (exact, whatever follows the last one)"
        )
        rows = (
            f"shifts to {self.degree}"
            if self.row_shifts is None
            else f"shifts {', '.join(map(str, self.row_shifts))} and one more"
        )
        f = self.frequencies
        return f"shifted transfer functions of {of} on {f.size} lines, {f[0]:g} to {f[-1]:g} Hz, {rows}"
